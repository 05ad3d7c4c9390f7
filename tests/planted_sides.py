"""The bundled walk's true poses as a finished run, with the legs exchanged in some frames."""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from store_records import layer_of, result_of

from studio.body.inverse_kinematics import pose_from_markers
from studio.body.motion_files.trc import read_trc
from studio.results.evaluation.errors import rows_of_frames
from studio.runs.new_run import prepare_run
from studio.search.trackers.side_exchange import kinds_of
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

LAST, EXCHANGED = 36, range(12, 28)


def true_poses(session: Session) -> NDArray[np.float64]:
    """(36, D) of the first frames."""
    assert session.truth_path is not None
    motion, body = read_trc(session.truth_path), session.body()
    rows, names = rows_of_frames(motion, session.manifest.fps), tuple(marker.name for marker in body.markers)
    columns = [motion.names.index(name) for name in names]
    poses, pose = [], session.start_pose(body)
    for frame in range(LAST):
        assert pose is not None
        pose, _ = pose_from_markers(body, names, motion.positions[rows[frame]][columns], pose)
        poses.append(pose)
    return np.array(poses)


def planted(session: Session, truth: NDArray[np.float64]) -> StoredRun:
    """A finished run whose legs are exchanged in the frames EXCHANGED."""
    poses = truth.copy()
    legs = next(kind for kind in kinds_of(session.body()) if "leg" in kind.what)
    for frame in EXCHANGED:
        poses[frame] = legs.offered(truth[frame])
    return stored(session, poses)


def stored(session: Session, poses: NDArray[np.float64], run: StoredRun | None = None) -> StoredRun:
    """A finished run that found these poses."""
    run = run or prepare_run(session, last=LAST, fit_shape=False)
    writer = ResultsWriter(run.folder)
    for frame, pose in enumerate(poses):
        result = result_of(frame, size=len(pose))
        estimate = dataclasses.replace(result.estimate, pose=pose)
        writer.write_frame(
            dataclasses.replace(result, estimate=estimate), [layer_of(frame, 0, size=len(pose))], False
        )
    writer.close()
    return run
