"""The runs that are tracked after the one at hand, in the order in which they were asked for."""

from pathlib import Path

from studio.errors import RunError

# Folders of a session and of one of its runs, as text.
Place = tuple[str, str]


class WaitingRuns:
    """Each run waits once."""

    def __init__(self) -> None:
        self._places: list[Place] = []

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Names of sessions and runs, the next one first."""
        return tuple((Path(session).name, Path(run).name) for session, run in self._places)

    def add(self, place: Place) -> None:
        """Let a run wait, unless it does already."""
        if place not in self._places:
            self._places.append(place)

    def remove(self, place: Place) -> None:
        """Let a run wait no longer. Raises RunError if it does not wait."""
        if place not in self._places:
            raise RunError(f"Run '{Path(place[1]).name}' does not wait.", "Cancel it if it is tracked.")
        self._places.remove(place)

    def next(self) -> Place | None:
        """Take out the one whose turn it is; None when none waits."""
        return self._places.pop(0) if self._places else None
