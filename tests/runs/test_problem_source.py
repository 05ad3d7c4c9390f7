"""Frames are made once, ahead of their time where there is a thread for it, and not held longer than
needed."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from toy_session import true_poses

from studio.evidence.pipeline import EvidenceMaker
from studio.foundations.errors import NotFoundError
from studio.runs.problem_source import KEPT_FRAMES, ProblemSource
from studio.search.settings import changed_settings, default_settings
from studio.sessions.session import Session

SETTINGS = default_settings()


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The frames whose evidence was computed, in order."""
    frames: list[int] = []
    original = EvidenceMaker.evidence

    def counted(self: EvidenceMaker, frame: int):
        frames.append(frame)
        return original(self, frame)

    monkeypatch.setattr(EvidenceMaker, "evidence", counted)
    return frames


def test_the_truth_weighs_more_than_poses_beside_it(session_on_disk: Session) -> None:
    source = ProblemSource(session_on_disk, session_on_disk.body())
    truth = true_poses()
    for frame in (0, 5):
        problem = source.problem(frame, SETTINGS)
        beside = truth[frame] + np.array([[0.0] * 4, [0.5] * 4, [-0.5] * 4, [0.5, -0.5, 0.5, -0.5]])
        assert np.argmax(problem.log_likelihood(beside)) == 0
    source.close()


def test_a_frame_is_made_once_whatever_the_trackers_knobs(session_on_disk: Session, made: list[int]) -> None:
    source = ProblemSource(session_on_disk, session_on_disk.body())
    first = source.problem(2, SETTINGS)
    assert source.problem(2, changed_settings(SETTINGS, {"survival": 0.2, "layers": 3})) is first
    assert source.evidence(2, SETTINGS).frame == 2
    assert made == [2]
    source.problem(2, changed_settings(SETTINGS, {"edge_threshold": SETTINGS.evidence.edge_threshold + 1}))
    assert made == [2, 2]
    source.close()


def test_only_the_last_few_are_held(session_on_disk: Session, made: list[int]) -> None:
    source = ProblemSource(session_on_disk, session_on_disk.body())
    for frame in range(8):
        source.problem(frame, SETTINGS)
    assert len(source._problems) == len(source._evidence) == KEPT_FRAMES
    source.problem(7, SETTINGS)
    assert len(made) == 8
    source.problem(0, SETTINGS)
    assert made[-1] == 0
    source.close()
    assert not source._problems
    assert not source._evidence


def test_the_next_frame_is_made_ready_and_is_the_same(session_on_disk: Session, made: list[int]) -> None:
    poses = true_poses()[:3] + 0.1
    plain = ProblemSource(session_on_disk, session_on_disk.body())
    wanted = [plain.problem(frame, SETTINGS).log_likelihood(poses) for frame in range(8)]
    plain.close()
    made.clear()
    with ThreadPoolExecutor(1) as executor:
        source = ProblemSource(session_on_disk, session_on_disk.body(), last=7, executor=executor)
        for frame in range(7):
            assert np.array_equal(source.problem(frame, SETTINGS).log_likelihood(poses), wanted[frame])
        source.close()
    assert sorted(made) == list(range(7))


def test_the_next_frame_is_begun_by_a_later_layer_where_the_thread_was_busy(
    session_on_disk: Session, made: list[int]
) -> None:
    """Frame 1 is still being made when frame 4 is first asked for; the next request finds the thread free."""
    held = threading.Event()
    with ThreadPoolExecutor(1) as executor:
        executor.submit(held.wait, 60.0)
        source = ProblemSource(session_on_disk, session_on_disk.body(), executor=executor)
        source.problem(0, SETTINGS)
        first = source.problem(4, SETTINGS)
        held.set()
        executor.submit(int).result()
        assert source.problem(4, SETTINGS) is first
        executor.submit(int).result()
        source.close()
    assert made == [0, 4, 1, 5]


def test_what_goes_wrong_ahead_comes_up_where_it_is_used(session_on_disk: Session) -> None:
    with ThreadPoolExecutor(1) as executor:
        source = ProblemSource(session_on_disk, session_on_disk.body(), last=12, executor=executor)
        source.problem(7, SETTINGS)
        with pytest.raises(NotFoundError, match="frame 8"):
            source.problem(8, SETTINGS)
        source.close()
