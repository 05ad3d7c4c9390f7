"""Finished runs looked at as a whole (`runs.sides`), one after the other, while the process serves commands."""

import threading
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

from studio.errors import StudioError, WorkCancelledError
from studio.jobs.open_run import OpenRun
from studio.runs.problem_source import ProblemSource
from studio.runs.sides import can_be_looked_at, in_words, put_sides_right

Say = Callable[[OpenRun, str, str], None]
"""A line for a run's log: the run, level, text."""


class SideLooking:
    """Puts sides right in a thread of its own. Close it when done: what is under way is given up."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._ended = threading.Event()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="sides")

    def add(self, run: OpenRun) -> None:
        """Look at a finished run when those before it are done. It may be closed meanwhile."""
        if can_be_looked_at(run.stored):
            self._thread.submit(self._look, run)

    def close(self) -> None:
        """End, at the next frame that is read."""
        self._ended.set()
        self._thread.shutdown(cancel_futures=True)

    def _look(self, run: OpenRun) -> None:
        try:
            with closing(ProblemSource(run.session, run.stored.body(), run.stored.cameras())) as problems:
                words = put_sides_right(run.stored, problems, self._go_on)
        except WorkCancelledError:
            return
        except StudioError as error:
            self._say(run, "error", f"Left and right were not looked at again: {error}")
        except Exception:
            if not run.stored.folder.is_dir():  # moved or deleted meanwhile
                return
            self._say(run, "error", traceback.format_exc())
        else:
            if words:
                self._say(run, "info", in_words(words))

    def _go_on(self, _frame: int) -> None:
        if self._ended.is_set():
            raise WorkCancelledError(
                "Looking at left and right was given up.", "'studio refine' does it, too."
            )
