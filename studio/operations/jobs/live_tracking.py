"""A live run tracked in this process, for commands and scripts; Ctrl-C ends it and keeps what is done."""

from collections.abc import Sequence

from studio.foundations.progress import Progress
from studio.operations.jobs.open_live_run import MakeSource, OpenLiveRun
from studio.operations.jobs.send_addresses import SendAddress
from studio.runs.live.live_replay import Comparison, compare, replay
from studio.runs.live.live_summary import LiveSummary, summary_of
from studio.runs.problem_source import ProblemSource
from studio.runs.run_footage import footage_of
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


def track_live(
    session: Session,
    run: StoredRun,
    report: Progress,
    make_source: MakeSource | None = None,
    send_to: Sequence[SendAddress] | None = None,
) -> LiveSummary:
    """Track a prepared or interrupted live run until its last frame has come.

    make_source : of its sets; None: its footage at its own rate. send_to : as `OpenLiveRun` takes it. Raises
    StudioError; KeyboardInterrupt is passed on after the run was marked as cancelled.
    """
    record = run.record
    opened = OpenLiveRun(str(session.path), str(run.folder), make_source, send_to)
    try:
        opened.tracking.mark_going_on()
        report("getting ready", 0, record.frame_count)
        opened.warm_up()
        while not opened.live.finished:
            stepped = opened.step_layer()
            if stepped is not None and stepped.result is not None:
                came = opened.live.next_frame - record.first
                report(opened.live.standing.in_words, came, record.frame_count)
    except KeyboardInterrupt:
        opened.tracking.mark_cancelled()
        raise
    finally:
        opened.close()
    return summary_of(run)


def replay_live(session: Session, run: StoredRun, into: StoredRun, report: Progress) -> Comparison:
    """Track the frames of a live run again, into a run made by `live_replay.prepare_replay`, and compare the two."""
    problems = ProblemSource(session, into.body(), into.cameras(), footage=footage_of(session, into))
    with run.results() as results:
        total = results.done()
    try:
        for done, frame in enumerate(replay(run, into, problems), 1):
            report(f"frame {frame} again", done, total)
    finally:
        problems.close()
    return compare(run, into)
