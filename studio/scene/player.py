"""The clock of playback: which stored frame is shown next, and how it is asked for."""

from collections.abc import Sequence
from dataclasses import replace

from studio.scene.playback import Playback


class Player:
    """Used by the presenter's thread only."""

    def __init__(self) -> None:
        self.state = Playback()

    def play(self, playing: bool | None) -> None:
        """Play or stop; None: the other of the two."""
        wanted = not self.state.playing if playing is None else playing
        self.state = replace(self.state, playing=wanted, debt=0.0)

    def set_pace(self, speed: float | None, loop: bool | None) -> None:
        """Change speed and looping; None leaves it."""
        self.state = replace(
            self.state,
            speed=self.state.speed if speed is None else speed,
            loop=self.state.loop if loop is None else loop,
        )

    def advance(self, seconds: float, fps: float, frame: int | None, frames: Sequence[int]) -> int | None:
        """Let time go by; the frame to show now."""
        self.state, shown = self.state.advanced(seconds, fps, frame, frames)
        return shown
