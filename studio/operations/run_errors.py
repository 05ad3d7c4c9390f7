"""How far a run's poses are from the session's truth, measured again only when there are new frames."""

import threading
from collections import OrderedDict
from functools import lru_cache
from pathlib import Path

from studio.body.motion_files.trc import MarkerMotion, read_trc
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import NotFoundError, StudioError
from studio.results.evaluation.errors import Evaluation, evaluate
from studio.runs.tracks import RAW, read_track, track_stamp
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

KEPT = 64

_lock = threading.Lock()
_evaluations: OrderedDict[tuple[Path, int, Path, int, str, int], Evaluation] = OrderedDict()


def evaluation_of(
    session: Session, run: StoredRun, track: str = RAW, *, blobs: bool = True
) -> Evaluation | None:
    """The errors of all frames of a track (the search's own: the finished ones); None without a truth or before the
    first frame.

    blobs : as `ResultsReader.damaged`.

    Raises TruthError, BodyError, NotFoundError for an unknown track.
    """
    path = session.truth_path
    if path is None:
        return None
    stamp = path.stat().st_mtime_ns
    frames, poses = _poses_of(run, track, blobs)
    if not len(frames):
        return None
    key = (run.folder, len(frames), path, stamp, track, track_stamp(run, track))
    # A run's page asks for it three times at once: one measures, the others wait for that.
    with _lock:
        if key in _evaluations:
            return _evaluations[key]
        measured = evaluate(poses, frames, run.body(), _truth(path, stamp), run.record.fps)
        _evaluations[key] = measured
        if len(_evaluations) > KEPT:
            _evaluations.popitem(last=False)
    return measured


def measure_or_say_why(
    session: Session, run: StoredRun, track: str = RAW, *, blobs: bool = True
) -> tuple[Evaluation | None, str]:
    """The errors as of `evaluation_of`, None where there are none; and why the truth cannot be used, "" if it can.

    Raises NotFoundError for an unknown track.
    """
    try:
        return evaluation_of(session, run, track, blobs=blobs), ""
    except NotFoundError:
        raise
    except StudioError as error:
        return None, str(error)


def measured(session: Session, run: StoredRun) -> Evaluation:
    """The errors of all finished frames of a run. Raises NotFoundError without a truth or before the first frame."""
    errors = evaluation_of(session, run)
    if errors is None:
        raise NotFoundError(
            f"There is nothing to measure run '{run.name}' against, or no frame yet.",
            "Import the session with a truth/*.trc, and track it.",
        )
    return errors


def _poses_of(run: StoredRun, track: str, blobs: bool) -> tuple[Indices, Array]:
    """The frames (K,) of a track and its poses (K, D)."""
    if track != RAW:
        poses = read_track(run, track)
        return poses.frames, poses.poses
    with run.results() as results:
        return results.poses(blobs=blobs)


@lru_cache(maxsize=8)
def _truth(path: Path, _stamp: int) -> MarkerMotion:
    """The motion in a TRC, read again when the file's time of change differs."""
    return read_trc(path)
