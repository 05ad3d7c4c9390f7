"""A run tracked to its end in this process, for commands and scripts; Ctrl-C keeps what is done."""

import time
from contextlib import suppress
from dataclasses import dataclass

from studio.foundations.errors import StudioError
from studio.foundations.progress import Progress
from studio.operations.jobs.open_live_run import opened
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@dataclass(frozen=True, slots=True)
class BatchResult:
    """evaluations_per_frame : poses weighed in the last frame (a frame after the first, where there is one).

    last_beta : exponent of the last layer. seconds : from opening to the last result, compilation included.
    """

    evaluations_per_frame: int
    last_beta: float
    seconds: float


def track_to_end(session: Session, run: StoredRun, report: Progress) -> BatchResult:
    """Track a prepared or interrupted run to its last frame.

    Raises StudioError; KeyboardInterrupt is passed on after the run was marked as cancelled.
    """
    began = time.perf_counter()
    total = run.record.frame_count
    at_hand = opened(str(session.path), str(run.folder))
    evaluations, beta = 0, float("nan")
    try:
        at_hand.tracking.mark_going_on()
        report("compiling kernels, once", at_hand.tracking.done, total)
        at_hand.warm_up()
        while not at_hand.tracking.finished:
            stepped = at_hand.step_layer()
            if stepped is not None and stepped.result is not None:
                evaluations, beta = stepped.result.evaluations, stepped.record.beta
                report(f"{session.name} / {run.name}", at_hand.tracking.done, total)
        at_hand.conclude(lambda _: report("comparing left and right", total, total))
    except BaseException as problem:
        # What went wrong first is what counts, not that a full disk refuses the rest, too.
        with suppress(StudioError):
            if isinstance(problem, KeyboardInterrupt):
                at_hand.tracking.mark_cancelled()
        with suppress(StudioError):
            at_hand.close()
        raise
    at_hand.close()
    return BatchResult(evaluations, beta, time.perf_counter() - began)
