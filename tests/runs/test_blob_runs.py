"""Runs weighed by blobs, whose memory goes from frame to frame: stopped, killed, resumed and annealed again."""

import numpy as np
import pytest
from toy_session import true_poses
from tracked_runs import abandon, finish, opened

from studio.results.overlay_pictures import compose_view
from studio.runs.drawing.overlay_drawing import OVERLAYS
from studio.runs.new_run import prepare_run
from studio.runs.reannealing import Reannealing
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

Array = np.ndarray
CHANGES = {"particles": 40, "layers": 4, "start_repeats": 2, "blob_learning": 3, "hull_depth": 6}


def new_run(session: Session, name: str) -> StoredRun:
    start = true_poses()[0] + 0.02
    return prepare_run(session, name=name, weighting="blobs", seed=7, start_pose=start, last=6, knobs=CHANGES)


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
    finish(session_on_disk, run)
    poses, memories = outcome(run)
    assert [int(memory["blob_frames"][0]) for memory in memories[:2]] == [1, 2]
    assert [sorted(memory) for memory in memories[2:]] == [
        ["blobs", "hidden front", "moved ends", "moved jumps"]
    ] * 4
    assert np.abs(poses - true_poses()[:6]).max() < 0.3


@pytest.mark.parametrize("stops", [(1,), (6, 3), (9, 1, 1), (13, 9)])
def test_stopped_anywhere_and_gone_on_with_elsewhere(
    session_on_disk: Session, stops: tuple[int, ...]
) -> None:
    whole, broken = new_run(session_on_disk, "whole"), new_run(session_on_disk, "broken")
    finish(session_on_disk, whole)
    for layers in stops:
        finish(session_on_disk, broken, layers)
    finish(session_on_disk, broken)
    assert_same(broken, whole)


def test_a_killed_process_leaves_whole_frames_from_which_the_rest_follows(session_on_disk: Session) -> None:
    whole, killed = new_run(session_on_disk, "whole"), new_run(session_on_disk, "killed")
    finish(session_on_disk, whole)
    with opened(session_on_disk, killed) as tracking:
        for _ in range(4 * 2 + 4 + 2):
            tracking.step_layer()
        abandon(tracking)
    finish(session_on_disk, killed)
    assert_same(killed, whole)


@pytest.mark.parametrize("frame", [0, 2, 4])
def test_a_frame_annealed_again_with_nothing_changed_is_the_same(
    session_on_disk: Session, frame: int
) -> None:
    run = new_run(session_on_disk, "whole")
    finish(session_on_disk, run)
    with opened(session_on_disk, run) as tracking:
        again = Reannealing(tracking, frame, *tracking.latest_settings())
        while not again.finished:
            again.step_layer()
        found = again.result()
    with run.results() as results:
        stored = results.result(frame)
    np.testing.assert_array_equal(found.estimate.pose, stored.estimate.pose)
    for name, values in stored.carried.memory.items():
        np.testing.assert_array_equal(found.carried.memory[name], values)


def test_its_pictures_can_be_drawn_on(session_on_disk: Session) -> None:
    run = new_run(session_on_disk, "whole")
    finish(session_on_disk, run)
    camera = session_on_disk.cameras()[0]
    picture = compose_view(
        session_on_disk, run, 2, camera.name, tuple(OVERLAYS), height=camera.height, turned=False
    )
    assert picture.shape == (camera.height, camera.width, 3)
