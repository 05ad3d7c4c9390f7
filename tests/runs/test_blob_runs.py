"""Runs weighed by blobs, whose memory goes from frame to frame: stopped, killed, resumed and annealed again."""

import numpy as np
import pytest
from toy_session import true_poses

from studio.runs.new_run import RunRequest, prepare_run
from studio.runs.overlay_drawing import OVERLAYS
from studio.runs.overlay_pictures import compose_view
from studio.runs.problem_source import ProblemSource
from studio.runs.reannealing import Reannealing
from studio.runs.tracking_run import TrackingRun
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

Array = np.ndarray
CHANGES = {"particles": 40, "layers": 4, "start_repeats": 2, "blob_learning": 3, "hull_depth": 6}


def new_run(session: Session, name: str) -> StoredRun:
    start = tuple(true_poses()[0] + 0.02)
    request = RunRequest(name=name, weighting="blobs", seed=7, start_pose=start, last=6, changes=CHANGES)
    return prepare_run(session, request)


def opened(session: Session, run: StoredRun) -> TrackingRun:
    return TrackingRun(run, ProblemSource(session, run.body(), run.cameras()))


def finished(tracking: TrackingRun, layers: int | None = None) -> None:
    """Track so many layers, or all that are left, and close."""
    done = 0
    while not tracking.finished and done != layers:
        tracking.step_layer()
        done += 1
    tracking.close()
    tracking.problems.close()


def outcome(run: StoredRun) -> tuple[Array, list[dict[str, Array]]]:
    with run.results() as results:
        memories = [dict(results.result(frame).carried.memory) for frame in results.frames()]
        return results.poses()[1], memories


def assert_same(run: StoredRun, other: StoredRun) -> None:
    (poses, memories), (other_poses, other_memories) = outcome(run), outcome(other)
    np.testing.assert_array_equal(poses, other_poses)
    for memory, wanted in zip(memories, other_memories, strict=True):
        assert sorted(memory) == sorted(wanted)
        for name, values in wanted.items():
            np.testing.assert_array_equal(memory[name], values)


def test_the_store_keeps_what_was_learnt(session_on_disk: Session) -> None:
    run = new_run(session_on_disk, "whole")
    finished(opened(session_on_disk, run))
    poses, memories = outcome(run)
    assert [int(memory["blob_frames"][0]) for memory in memories[:2]] == [1, 2]
    assert [sorted(memory) for memory in memories[2:]] == [["blobs"]] * 4
    assert np.abs(poses - true_poses()[:6]).max() < 0.3


@pytest.mark.parametrize("stops", [(1,), (6, 3), (9, 1, 1), (13, 9)])
def test_stopped_anywhere_and_gone_on_with_elsewhere(
    session_on_disk: Session, stops: tuple[int, ...]
) -> None:
    whole, broken = new_run(session_on_disk, "whole"), new_run(session_on_disk, "broken")
    finished(opened(session_on_disk, whole))
    for layers in stops:
        finished(opened(session_on_disk, broken), layers)
    finished(opened(session_on_disk, broken))
    assert_same(broken, whole)


def test_a_killed_process_leaves_whole_frames_from_which_the_rest_follows(session_on_disk: Session) -> None:
    whole, killed = new_run(session_on_disk, "whole"), new_run(session_on_disk, "killed")
    finished(opened(session_on_disk, whole))
    tracking = opened(session_on_disk, killed)
    for _ in range(4 * 2 + 4 + 2):
        tracking.step_layer()
    # As when the process is gone: nothing of the frame at hand is saved.
    tracking._writer.close()
    tracking._reader.close()
    finished(opened(session_on_disk, killed))
    assert_same(killed, whole)


@pytest.mark.parametrize("frame", [0, 2, 4])
def test_a_frame_annealed_again_with_nothing_changed_is_the_same(
    session_on_disk: Session, frame: int
) -> None:
    run = new_run(session_on_disk, "whole")
    finished(opened(session_on_disk, run))
    tracking = opened(session_on_disk, run)
    version, settings = tracking.latest_settings()
    again = Reannealing(tracking, frame, version, settings)
    while not again.finished:
        again.step_layer()
    found = again.result()
    tracking.close()
    with run.results() as results:
        stored = results.result(frame)
    np.testing.assert_array_equal(found.estimate.pose, stored.estimate.pose)
    for name, values in stored.carried.memory.items():
        np.testing.assert_array_equal(found.carried.memory[name], values)


def test_its_pictures_can_be_drawn_on(session_on_disk: Session) -> None:
    run = new_run(session_on_disk, "whole")
    finished(opened(session_on_disk, run))
    camera = session_on_disk.cameras()[0]
    picture = compose_view(
        session_on_disk, run, 2, camera.name, tuple(OVERLAYS), height=camera.height, turned=False
    )
    assert picture.shape == (camera.height, camera.width, 3)
