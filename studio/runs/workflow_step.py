"""One step of the guided set-up and its status."""

from dataclasses import dataclass
from typing import Literal

StepName = Literal[
    "footage", "calibration", "background", "subject", "start-pose", "track", "check", "export"
]
StepState = Literal["done", "ready", "blocked", "stale", "running"]
STEPS: tuple[StepName, ...] = (
    "footage",
    "calibration",
    "background",
    "subject",
    "start-pose",
    "track",
    "check",
    "export",
)


@dataclass(frozen=True, slots=True)
class StepStatus:
    """A step. words : its result; why : why it is stale, blocked or unreadable, sentences. optional : tracking works
    without it.
    """

    step: StepName
    state: StepState
    words: str
    why: str = ""
    optional: bool = False


def counted(number: int, one: str, many: str = "") -> str:
    """A number with its noun: "1 camera", "4 cameras"."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def enumerated(words: list[str]) -> str:
    """A list as text: "a, b and c"."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} and {words[-1]}"
