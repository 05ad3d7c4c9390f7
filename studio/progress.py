"""How long work tells how far it is, and hears that it is not wanted any more."""

from collections.abc import Callable

from studio.errors import StudioError

Progress = Callable[[str, int, int], None]
"""Called with a step in words, how many parts of it are done and how many there are (0: nobody knows)."""
Cancelled = Callable[[], bool]
"""Asked often; True once nobody wants the work any more."""


def watched(progress: Progress | None, cancelled: Cancelled | None, ending: StudioError) -> Progress:
    """What the work calls: tells `progress` if somebody listens, and raises `ending` once it is cancelled."""

    def tell(step: str, done: int, total: int) -> None:
        if cancelled is not None and cancelled():
            raise ending
        if progress is not None:
            progress(step, done, total)

    return tell
