"""Corrects a run: the pose of one frame is given, and tracking continues from it, forwards or backwards.

The old run is unchanged: the corrected run is a new one with the old one's body, cameras, behaviour model and the
frames that the correction does not affect; its record names the old run, the frame and the pose. The given pose serves
as a start pose of the frame: the search begins there (`start_repeats` times).

Forwards, the frames before the corrected one are copied; it and all after it are tracked as in any run, which can be
stopped and resumed. Backwards, all frames are copied; the corrected one is searched, then the frame before it from
that result, and so on. Each result replaces the old frame when it is done, so that a cancelled correction keeps the
frames done so far.
"""

from collections.abc import Callable
from contextlib import closing

from studio.body.branches import within_limits
from studio.body.model import checked_pose
from studio.foundations.arrays import Array
from studio.foundations.errors import RunError
from studio.foundations.progress import Progress, no_progress
from studio.runs.derived_runs import check_branching_frame, derived_record, new_folder
from studio.runs.problem_source import ProblemSource
from studio.runs.reannealing import Reannealing
from studio.runs.tracking_run import TrackingRun
from studio.search.settings import settings_from_values
from studio.sessions.session import Session, make_numbered_run
from studio.sessions.stored_run import StoredRun


def prepare_correction(
    session: Session,
    run: StoredRun,
    frame: int,
    pose: Array,
    *,
    source: str = "given",
    backwards_to: int | None = None,
    name: str = "",
) -> StoredRun:
    """Make the corrected run's folder; then track it (`operations.jobs.batch.track_to_end`), or call `track_backwards`.

    frame : of the run, or (forwards) the one after its last. pose : (D,) radians and mm, in that frame. source : of the
    pose, as text. backwards_to : the last frame to track backwards; it may lie before the run's first frame; None:
    forwards to the run's end. Raises RunError, SessionError; then nothing was made.
    """
    record, body = run.record, run.body()
    given = checked_pose(body, pose, RunError)
    _check_frames(run, frame, backwards_to)
    way = "on" if backwards_to is None else f"backwards to frame {backwards_to}"
    changed = derived_record(
        session,
        run,
        name,
        f"Run '{run.name}', frame {frame} corrected ({source}) and tracked {way} from it.",
        corrected=frame,
        corrected_pose=tuple(within_limits(body, given).tolist()),
        backwards_to=backwards_to,
        first=record.first if backwards_to is None else min(record.first, backwards_to),
    )
    last = frame if backwards_to is None else None
    return make_numbered_run(session, changed, name, lambda record: new_folder(run, record, last))


def track_backwards(
    session: Session,
    run: StoredRun,
    progress: Progress = no_progress,
    cancelled: Callable[[], bool] | None = None,
) -> int:
    """Track a prepared correction backwards; returns the number of frames with new poses.

    progress : called after each frame. cancelled : checked before each layer; True stops and keeps the frames done.
    Raises RunError for a run that was not prepared for this, or that another process has open.
    """
    record = run.record
    if record.corrected is None or record.backwards_to is None:
        raise RunError(f"Run '{run.name}' was not prepared for tracking backwards.", "Resume it instead.")
    total = record.corrected - record.backwards_to + 1
    with (
        closing(ProblemSource(session, run.body(), run.cameras())) as problems,
        closing(TrackingRun(run, problems)) as tracking,
    ):
        for done, frame in enumerate(range(record.corrected, record.backwards_to - 1, -1)):
            if not _track_again(tracking, frame, cancelled):
                return done
            progress(f"{session.name} / {run.name}, backwards", done + 1, total)
    return total


def _track_again(tracking: TrackingRun, frame: int, cancelled: Callable[[], bool] | None) -> bool:
    """Search a frame with its old settings and replace the old result; False if cancelled."""
    entry, record = tracking.history.in_use(frame, 0) or tracking.history.entries[0], tracking.record
    settings = settings_from_values(record.tracker, record.weighting, entry.values)
    search = Reannealing(tracking, frame, entry.version, settings)
    while not search.finished:
        if cancelled is not None and cancelled():
            return False
        search.step_layer()
    search.keep(alone=True)
    return True


def _check_frames(run: StoredRun, frame: int, backwards_to: int | None) -> None:
    record = run.record
    frames = check_branching_frame(run, frame, beyond=backwards_to is None)
    if backwards_to is None:
        return
    if not 0 <= backwards_to < frame:
        raise RunError(
            f"The frames from {frame} back to {backwards_to} are not in the footage of run '{run.name}'.",
            f"Go back to a frame from 0 to {frame - 1}.",
        )
    missing = sorted(set(range(max(backwards_to, record.first), frame + 1)) - set(frames))
    if missing:
        raise RunError(
            f"Frame {missing[0]} of run '{run.name}' was dropped, so the run cannot be tracked back over it.",
            "Go back to a later frame, or track the footage again without dropping frames.",
        )
