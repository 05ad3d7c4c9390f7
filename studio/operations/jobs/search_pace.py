"""How slowly a search goes for a person to watch it: the seconds that each tracked layer takes at least.

It changes no result and is no knob of a run: it belongs to the tracking process and lasts as long as that does.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from studio.foundations.errors import SettingsError

MOST_SECONDS = 10.0
SPEEDS = (0.0, 0.1, 1.0 / 3.0, 1.0)
"""The choices that the page and the scene offer, in seconds a layer; 0 is as fast as it can."""


@dataclass(frozen=True, slots=True)
class SpeedChoice:
    """seconds_a_layer in words."""

    label: str
    seconds_a_layer: float


@dataclass(frozen=True, slots=True)
class PaceView:
    """The pace that the search has, and what is offered: fast to slow, the present one among them."""

    seconds_a_layer: float
    choices: tuple[SpeedChoice, ...]


class SearchPace:
    """Says how long the next layer has to wait. clock : seconds, rising."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began = float("-inf")
        self.seconds_a_layer = 0.0

    def set(self, seconds: float) -> None:
        """Let each layer take at least so many seconds. Raises SettingsError outside 0 to `MOST_SECONDS`."""
        if not 0.0 <= seconds <= MOST_SECONDS:
            raise SettingsError(
                f"A layer cannot be made to take {seconds:g} seconds.",
                f"Give 0 (as fast as it can) to {MOST_SECONDS:g} seconds.",
            )
        self.seconds_a_layer = float(seconds)

    def begin(self) -> None:
        """Note that a layer begins now."""
        self._began = self._clock()

    @property
    def left(self) -> float:
        """Seconds until the layer that began last has had its time; 0 if it has."""
        return max(0.0, self._began + self.seconds_a_layer - self._clock())


def in_words(seconds: float) -> str:
    """A speed as a person reads it: layers a second down to one, seconds a layer below that."""
    if seconds <= 0.0:
        return "full speed"
    rate = f"{1.0 / seconds:.3g}"
    if rate == "1":
        return "1 layer/s"
    return f"{rate} layers/s" if seconds < 1.0 else f"{seconds:.3g} s a layer"


def pace_view(seconds: float = 0.0) -> PaceView:
    """A pace, and the choices with it among them."""
    choices = tuple(SpeedChoice(in_words(speed), speed) for speed in sorted({*SPEEDS, seconds}))
    return PaceView(seconds, choices)
