"""The true pose of a frame: the body laid on the footage's true markers."""

import numpy as np
from numpy.typing import NDArray

from studio.body.inverse_kinematics import known_markers, pose_from_markers
from studio.body.model import BodyModel
from studio.errors import TruthError
from studio.evaluation.errors import rows_of_frames
from studio.motion_files.trc import read_trc
from studio.sessions.session import Session

Array = NDArray[np.float64]


def true_poses(session: Session, body: BodyModel, frames: list[int]) -> Array:
    """(K, D) poses of frames that follow from each other, each sought from the one before.

    Raises TruthError where the session has no truth, or none of a frame.
    """
    if session.truth_path is None:
        raise TruthError(f"Session '{session.name}' has no truth.", "Take one made by 'studio synthesize'.")
    truth = read_trc(session.truth_path)
    rows = rows_of_frames(truth, session.manifest.fps)
    missing = [frame for frame in frames if frame not in rows]
    if missing:
        raise TruthError(f"The truth has no row for frame {missing[0]}.", "Take frames that it has.")
    kept, names = known_markers(body, truth.names)
    own = session.start_pose(body) if body.name == session.manifest.body else None
    pose, found = body.neutral if own is None else own, []
    # From the start onwards, so that a heading that has turned far is followed.
    for frame in range(max(frames) + 1):
        if frame in rows and (frame in frames or frame % 4 == 0):
            pose = pose_from_markers(body, names, truth.positions[rows[frame], kept], pose)[0]
        if frame in frames:
            found.append(pose)
    return np.array(found)
