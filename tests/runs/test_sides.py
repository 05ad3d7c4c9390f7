"""The bundled walk with its legs exchanged for a while: put right in a track of its own, and said."""

import dataclasses
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from sample_walk import copy_of_walk
from store_records import layer_of, result_of

from studio.body.forward_kinematics import marker_points
from studio.body.inverse_kinematics import pose_from_markers
from studio.capture.trc import read_trc
from studio.evaluation.errors import rows_of_frames
from studio.runs.new_run import RunRequest, prepare_run
from studio.runs.problem_source import ProblemSource
from studio.runs.refining import smooth_run
from studio.runs.sides import notes_of, put_sides_right
from studio.runs.tracks import best_track, read_track, track_names
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.tracking.side_exchange import kinds_of

LAST, EXCHANGED = 36, range(12, 28)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return copy_of_walk(tmp_path_factory.mktemp("sides") / "walk")


@pytest.fixture(scope="module")
def truth(session: Session) -> np.ndarray:
    """(36, D) the true poses."""
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


def stored(session: Session, poses: np.ndarray, run: StoredRun | None = None) -> StoredRun:
    """A finished run that found these poses."""
    run = run or prepare_run(session, RunRequest(last=LAST, fit_shape=False))
    writer = ResultsWriter(run.folder)
    for frame, pose in enumerate(poses):
        result = result_of(frame, size=len(pose))
        estimate = dataclasses.replace(result.estimate, pose=pose)
        writer.write_frame(
            dataclasses.replace(result, estimate=estimate), [layer_of(frame, 0, size=len(pose))], False
        )
    writer.close()
    return run


@pytest.fixture(scope="module")
def run(session: Session, truth: np.ndarray) -> StoredRun:
    poses = truth.copy()
    legs = next(kind for kind in kinds_of(session.body()) if "leg" in kind.what)
    for frame in EXCHANGED:
        poses[frame] = legs.offered(truth[frame])
    return stored(session, poses)


@pytest.fixture
def problems(session: Session, run: StoredRun) -> Iterator[ProblemSource]:
    with closing(ProblemSource(session, run.body(), run.cameras())) as source:
        yield source


def test_legs_are_put_right_once_and_what_was_tracked_stays(
    session: Session, run: StoredRun, truth: np.ndarray, problems: ProblemSource
) -> None:
    raw, read = read_track(run), list[int]()
    assert notes_of(run) == run.record.notes
    words = put_sides_right(run, problems, read.append)
    assert words == ("frames 12 to 27: left and right leg exchanged",)
    assert np.array_equal(read_track(run).poses, raw.poses)
    track, body = read_track(run, "best"), run.body()
    assert track.name == "sides"
    away = np.linalg.norm(marker_points(body, track.poses) - marker_points(body, truth), axis=2).mean(axis=1)
    planted = np.linalg.norm(marker_points(body, raw.poses) - marker_points(body, truth), axis=2).mean(axis=1)
    assert planted[EXCHANGED].mean() > 50.0
    assert away[EXCHANGED].mean() < 25.0
    kept = np.setdiff1d(np.arange(LAST), EXCHANGED)
    assert np.array_equal(track.poses[kept], raw.poses[kept])
    assert (track.confidence[list(EXCHANGED)] > 0.7).all()
    assert notes_of(run)[-1].startswith("Sides were put right in track 'sides': frames 12 to 27: left")
    looked = len(read)
    assert put_sides_right(run, problems, read.append) == words
    assert len(read) == looked
    assert smooth_run(run).track.made_by["from"] == "sides"


def test_a_run_that_is_sound_has_no_such_track(
    session: Session, run: StoredRun, truth: np.ndarray, problems: ProblemSource
) -> None:
    other = stored(session, truth)
    assert put_sides_right(other, problems) == ()
    assert track_names(other) == ("raw",)
    # The same run, tracked again and better: what was made of it before is dropped.
    put_sides_right(run, problems)
    again = stored(session, truth, run)
    assert best_track(again, ("sides",)).outdated == ("sides",)
    assert notes_of(again) == again.record.notes
    assert put_sides_right(again, problems) == ()
    assert "sides" not in track_names(again)
