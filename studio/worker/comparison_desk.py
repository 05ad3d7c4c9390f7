"""Comparisons in the background of a server: one at a time, in processes of its own beside the tracking process."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from studio.errors import RunError, StudioError
from studio.experiments.kept_comparison import KeptComparison
from studio.sessions.session import Session
from studio.worker.comparison_run import run_comparison
from studio.worker.trial_pool import cores

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ComparisonState:
    """How a comparison stands.

    state : running, cancelling, finished, cancelled or failed. step : the trial that was done last. done, total :
    trials. seconds_left : an estimate, None before there is one. message, hint : why it failed.
    """

    session: str
    name: str
    state: str = "running"
    step: str = ""
    done: int = 0
    total: int = 0
    seconds_left: float | None = None
    message: str = ""
    hint: str = ""


class _CancelledError(Exception):
    """Someone does not want the result any more."""


class ComparisonDesk:
    """Works at one comparison in a thread; the trials run in processes. tell : hears of every change, in any thread."""

    def __init__(self, tell: Callable[[ComparisonState], None], processes: int | None = None) -> None:
        self._tell = tell
        # One core stays free for the studio itself, which is being looked at meanwhile.
        self._processes = processes or max(1, cores() - 1)
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._state: ComparisonState | None = None
        self._begun = (0.0, 0)
        self._closing = False

    @property
    def state(self) -> ComparisonState | None:
        """How the one that is running or was run last stands, None before the first."""
        return self._state

    def is_busy(self) -> bool:
        """Whether a comparison is being worked at."""
        return self._thread is not None and self._thread.is_alive()

    def check_free(self) -> None:
        """Raise RunError while a comparison is being worked at."""
        if self.is_busy() and self._state is not None:
            raise RunError(
                f"Comparison '{self._state.name}' of '{self._state.session}' is running; one runs at a time.",
                "Wait for it, or cancel it.",
            )

    def start(self, kept: KeptComparison, session: Session) -> ComparisonState:
        """Begin or go on. Raises RunError while another one is being worked at."""
        with self._lock:
            self.check_free()
            self._stop = threading.Event()
            self._begun = (time.monotonic(), -1)
            self._state = state = ComparisonState(session.name, kept.name)
            self._thread = threading.Thread(
                target=self._work, args=(kept, session), name="comparison", daemon=True
            )
            self._thread.start()
        return state

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
        self._stop.set()
        if self._thread is not None:
            self._thread.join(patience)

    def _work(self, kept: KeptComparison, session: Session) -> None:
        """Run it; whatever goes wrong becomes a state."""
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

    def _change(self, **changes: object) -> None:
        if self._state is not None:
            self._state = replace(self._state, **changes)  # pyright: ignore[reportArgumentType]
            self._tell(self._state)
