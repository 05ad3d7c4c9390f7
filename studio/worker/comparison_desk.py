"""Comparisons in the background of a server: one at a time, in processes of its own beside the tracking process."""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

from studio.comparison.kept_comparison import KeptComparison
from studio.errors import RunError, StudioError
from studio.sessions.session import Session
from studio.worker.comparison_run import run_comparison
from studio.worker.trial_pool import cores
from studio.worker.work_desk import WorkDesk, WorkState

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonState(WorkState):
    """How a comparison stands: running, cancelling, finished, cancelled or failed.

    session : whose. step : the trial that was done last. done, total : trials.
    """

    session: str


class _CancelledError(Exception):
    """Someone does not want the result any more."""


class ComparisonDesk(WorkDesk[ComparisonState]):
    """Works at one comparison in a thread; the trials run in processes. tell : hears of every change, in any thread."""

    def __init__(self, tell: Callable[[ComparisonState], None], processes: int | None = None) -> None:
        super().__init__(tell)
        # One core stays free for the studio itself, which is being looked at meanwhile.
        self._processes = processes or max(1, cores() - 1)
        self._begun = (0.0, 0)
        self._closing = False

    def start(self, kept: KeptComparison, session: Session) -> ComparisonState:
        """Begin or go on. Raises RunError while another one is being worked at."""
        first = ComparisonState(session=session.name, name=kept.name)
        return self._begin(first, lambda: self._work(kept, session))

    def cancel(self, session: str, name: str) -> bool:
        """Stop that comparison; whether it was the one. Its finished trials stay."""
        state = self._state
        if not self.is_busy() or state is None or (state.session, state.name) != (session, name):
            return False
        self._stop.set()
        self._change(state="cancelling")
        return True

    def close(self, patience: float = 10.0) -> None:
        """Stop what is running, which can go on another time, and wait for its processes to end."""
        self._closing = True
        super().close(patience)

    def _busy_with(self, state: ComparisonState) -> str:
        return f"Comparison '{state.name}' of '{state.session}' is running; one runs at a time."

    def _work(self, kept: KeptComparison, session: Session) -> None:
        """Run it; whatever goes wrong becomes a state."""
        self._begun = (time.monotonic(), -1)
        try:
            run_comparison(kept, session, self._report, processes=self._processes, checkpoint=self._check)
        except _CancelledError:
            if not self._closing:
                kept.end("cancelled")
            self._change(state="cancelled", seconds_left=None)
        except StudioError as error:
            self._fail(kept, error)
        except Exception as error:
            logger.exception("comparison '%s' failed", kept.folder)
            self._fail(
                kept, RunError(f"The comparison failed: {type(error).__name__}: {error}.", "See the log.")
            )
        else:
            self._change(state="finished", seconds_left=None)

    def _fail(self, kept: KeptComparison, error: StudioError) -> None:
        try:
            kept.end("failed", str(error))
        except (StudioError, OSError):
            logger.exception("what became of '%s' could not be written", kept.folder)
        self._change(state="failed", message=error.message, hint=error.hint, seconds_left=None)

    def _report(self, step: str, done: int, total: int) -> None:
        began, before = self._begun
        if before < 0:
            self._begun = (began, done)
            before = done
        left = None
        if done > before:
            left = (time.monotonic() - began) * (total - done) / (done - before)
        self._change(step=step, done=done, total=total, seconds_left=left)

    def _check(self) -> None:
        if self._stop.is_set():
            raise _CancelledError
