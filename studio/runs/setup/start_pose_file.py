"""Reads a start pose from a file: a CSV row of parameters, or a TRC whose markers are fitted by inverse kinematics; and
stores it in the session.
"""

from pathlib import Path

import numpy as np

from studio.body.inverse_kinematics import known_markers, pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.trc import read_trc
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError, RunError, TruthError
from studio.foundations.geometry.reach import within_reach
from studio.runs.search_space import parameter_names
from studio.sessions.atomic_files import keep_before
from studio.sessions.named_rows import check_radians, pose_frame, read_pose, write_pose
from studio.sessions.provenance import note, origin_of
from studio.sessions.session import START_POSE_NAME, Session
from studio.sessions.work_under_way import one_at_a_time

FEWEST_MARKERS = 4


def keep_start_pose(session: Session, body: BodyModel, pose: Array, frame: int | None = None) -> Path:
    """Make a pose (D,) the session's start pose; returns the file. The old one is kept beside it as
    start_pose-before.csv, numbered if there are more. The pose that it has already is confirmed so: it is no longer
    in doubt, whatever its confidence.

    frame : of the pose; None: that of the old one. Raises RunError for a pose of another body than the session's, or
    a frame outside the footage.
    """
    given = np.asarray(pose, dtype=np.float64)
    if body.name != session.manifest.body or given.shape != (len(body.parameters),):
        raise RunError(
            f"A pose of body '{body.name}' is no start pose of session '{session.name}'.",
            f"Its body is '{session.manifest.body}'; keep the pose with a run of the other one.",
        )
    if not within_reach(given):
        raise RunError("The pose holds numbers that are not finite.", "Give radians and mm.")
    of = session.start_pose_frame() if frame is None else frame
    if not 0 <= of < max(1, session.manifest.frame_count):
        raise RunError(
            f"The footage of session '{session.name}' has no frame {of}.",
            f"It has frames 0 to {session.manifest.frame_count - 1}.",
        )
    own = session.path / START_POSE_NAME
    with one_at_a_time(session.path):
        known = origin_of(session, "start-pose") if _is_kept(session, body, given, of) else None
        if known is None:
            keep_before(own)
            write_pose(own, parameter_names(body), given, of)
        words = f"set by hand in frame {of}" if known is None else known.words
        note(session, "start-pose", words if known is None or known.good else f"{words}, confirmed")
    return own


def _is_kept(session: Session, body: BodyModel, pose: Array, frame: int) -> bool:
    """Whether a pose (D,) is the session's start pose already. False where that cannot be read."""
    try:
        known = session.start_pose(body)
        return known is not None and np.array_equal(known, pose) and session.start_pose_frame() == frame
    except BodyError:
        return False


def frame_of_file(path: Path) -> int:
    """The frame of a file's start pose: from a CSV, else 0. Raises BodyError."""
    known = pose_frame(path) if path.is_file() and path.suffix.lower() != ".trc" else None
    return known or 0


def start_pose_from_file(path: Path, body: BodyModel, frame: int, fps: float) -> tuple[Array, str]:
    """The pose (D,), radians and mm, that a file gives for a frame, and its origin as text.

    A CSV has one row, its header the body's parameters. Of a TRC the row whose `Time` × fps is the frame is
    taken and the body is fitted to the markers that both have. Raises RunError,
    BodyError, TruthError naming the file.
    """
    if not path.is_file():
        raise RunError(
            f"There is no start pose file '{path}'.", "Give a CSV with one row of parameters, or a TRC."
        )
    if path.suffix.lower() != ".trc":
        pose = read_pose(path, parameter_names(body), frame)
        check_radians(path, body, pose)
        return pose, f"file {path.name}"
    motion = read_trc(path)
    rows = np.rint(motion.times * fps).astype(int)
    matching = np.flatnonzero(rows == frame)
    if not matching.size:
        raise TruthError(
            f"'{path.name}' has no row for frame {frame} at {fps:g} frames per second.",
            f"Its rows are frames {rows.min()} to {rows.max()}.",
        )
    points = motion.positions[matching[0]]
    kept = [at for at in known_markers(body, motion.names)[0] if np.isfinite(points[at]).all()]
    if len(kept) < FEWEST_MARKERS:
        known = ", ".join(sorted(marker.name for marker in body.markers)) or "the body has no markers"
        raise TruthError(
            f"'{path.name}' has {len(kept)} markers of body '{body.name}' in frame {frame}.",
            f"Name at least {FEWEST_MARKERS} of: {known}.",
        )
    names = tuple(motion.names[at] for at in kept)
    pose, error = pose_from_markers(body, names, points[kept], body.neutral)
    return pose, f"{len(kept)} markers of {path.name}, fitted to {error:.0f} mm"
