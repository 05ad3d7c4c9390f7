"""Runs tracked to their ends in this process, for commands and scripts; Ctrl-C keeps what is done."""

import time
from collections.abc import Hashable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass

from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import read_file
from studio.foundations.progress import Progress
from studio.operations.jobs.open_live_run import opened
from studio.operations.jobs.open_run import OpenRun
from studio.runs.tracking_run import step_together
from studio.sessions.run_record import CAMERAS_NAME
from studio.sessions.session import Session
from studio.sessions.stored_run import BODY_FOLDER, StoredRun


@dataclass(frozen=True, slots=True)
class BatchResult:
    """evaluations_per_frame : poses weighed in the last frame (a frame after the first, where there is one).

    last_beta : exponent of the last layer. seconds : from opening to the last result, compilation included.
    """

    evaluations_per_frame: int
    last_beta: float
    seconds: float


def track_together(session: Session, runs: Sequence[StoredRun], report: Progress) -> None:
    """Track runs to their last frames, a frame of all at a time, side by side where a card searches them. Each is
    stored as it is alone. Raises as `track_to_end`; what is done of all is kept.
    """
    total, stack = sum(run.record.frame_count for run in runs), ExitStack()
    at_hand = list[OpenRun]()
    bodies = dict[Hashable, OpenRun]()
    with stack:
        for run in runs:
            beside = bodies.get(key := _seen_as(run))
            at_hand.append(OpenRun(str(session.path), str(run.folder), beside, len(runs)))
            bodies.setdefault(key, at_hand[-1])
            stack.callback(at_hand[-1].close)
            at_hand[-1].tracking.mark_going_on()
        report("compiling kernels, once", sum(one.tracking.done for one in at_hand), total)
        for one in bodies.values():
            one.warm_up()
        try:
            while going := [one.tracking for one in at_hand if not one.tracking.finished]:
                frame = min(one.next_frame for one in going)
                done = step_together([one for one in going if one.next_frame == frame])
                if any(one.result is not None for one in done):
                    finished = sum(one.tracking.done for one in at_hand)
                    report(f"{session.name}: {len(runs)} runs together", finished, total)
            for one in at_hand:
                one.conclude(lambda _: report("comparing left and right", total, total))
        except KeyboardInterrupt:
            for one in at_hand:
                with suppress(StudioError):
                    one.tracking.mark_cancelled()
            raise


def _seen_as(run: StoredRun) -> Hashable:
    """The same for runs of a session that have one body, one calibration and the same last frame."""
    files = (run.folder / CAMERAS_NAME, *sorted((run.folder / BODY_FOLDER).glob("*")))
    record = run.record
    return record.body, tuple(record.dimensions.items()), record.last, tuple(map(read_file, files))


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
