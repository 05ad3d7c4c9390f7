"""How far a run's poses are from the session's truth, measured again only when there is more to measure."""

import threading
from collections import OrderedDict
from functools import lru_cache
from pathlib import Path

from studio.evaluation.errors import Evaluation, evaluate
from studio.motion_files.trc import MarkerMotion, read_trc
from studio.runs.tracks import RAW, read_track, track_stamp
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

KEPT = 64

_lock = threading.Lock()
_evaluations: OrderedDict[tuple[Path, int, int, str, int], Evaluation] = OrderedDict()


def evaluation_of(session: Session, run: StoredRun, track: str = RAW) -> Evaluation | None:
    """The errors of all frames of a track (the search's own: the finished ones); None without a truth or before the
    first frame.

    Raises TruthError, BodyError, NotFoundError where there is no such track.
    """
    path = session.truth_path
    if path is None:
        return None
    stamp = path.stat().st_mtime_ns
    found = read_track(run, track)
    frames, poses = found.frames, found.poses
    if not len(frames):
        return None
    key = (run.folder, len(frames), stamp, track, track_stamp(run, track))
    with _lock:
        if key in _evaluations:
            return _evaluations[key]
    measured = evaluate(poses, frames, run.body(), _truth(path, stamp), run.record.fps)
    with _lock:
        _evaluations[key] = measured
        if len(_evaluations) > KEPT:
            _evaluations.popitem(last=False)
    return measured


def mean_error(session: Session, run: StoredRun, done: int) -> float | None:
    """The mean marker error in mm; None where there is nothing to measure."""
    measured = evaluation_of(session, run) if done else None
    return None if measured is None else measured.mean_mm


@lru_cache(maxsize=8)
def _truth(path: Path, _stamp: int) -> MarkerMotion:
    """The motion in a TRC; its time of change is part of the question, so that a new file is read."""
    return read_trc(path)
