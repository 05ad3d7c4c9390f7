"""How long work tells how far it is, and hears that it is not wanted any more."""

from collections.abc import Callable

from studio.errors import WorkCancelledError

Progress = Callable[[str, int, int], None]
"""Called with a step in words, how many parts of it are done and how many there are (0: nobody knows)."""
Cancelled = Callable[[], bool]
"""Asked often; True once nobody wants the work any more."""


def unheard(_step: str, _done: int, _total: int) -> None:
    """Progress that nobody is shown."""


def watched(progress: Progress | None, cancelled: Cancelled | None, work: str) -> Progress:
    """What the work calls: tells `progress` if somebody listens, raises WorkCancelledError once it is cancelled.

    work : what is going on, as a sentence begins with it: "The export".
    """

    def tell(step: str, done: int, total: int) -> None:
        if cancelled is not None and cancelled():
            raise WorkCancelledError(f"{work} was cancelled.", "Start it again when you like.")
        if progress is not None:
            progress(step, done, total)

    return tell
