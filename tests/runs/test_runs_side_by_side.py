"""Runs tracked side by side: each is stored as the run that is tracked alone, on a card and by the processor."""

import dataclasses
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simulated_together as made
from simulated_card import run_simulated
from toy_session import make_session, true_poses
from tracked_runs import finish

from studio.foundations.progress import no_progress
from studio.operations.jobs.batch import track_to_end, track_together
from studio.runs.new_run import prepare_run
from studio.search.trackers.tracker import LayerRecord
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

TIMES = {"milliseconds"}


def prepared(session: Session, prefix: str) -> list[StoredRun]:
    return [
        prepare_run(
            session,
            name=f"{prefix}-{number}",
            seed=number,
            start_pose=true_poses()[0],
            last=made.FRAMES,
            knobs={**made.SHARED, **own},
            fit_shape=False,
        )
        for number, own in enumerate(made.OWN)
    ]


def assert_same(one: StoredRun, other: StoredRun) -> None:
    """All layers, what is carried on, and results, bit for bit."""
    with one.results() as found, other.results() as expected:
        assert found.frames() == expected.frames() == list(range(made.FRAMES))
        for frame in found.frames():
            layers = found.layers(frame), expected.layers(frame)
            for record, wanted in zip(*layers, strict=True):
                for field in dataclasses.fields(LayerRecord):
                    if field.name not in TIMES:
                        np.testing.assert_array_equal(
                            getattr(record, field.name), getattr(wanted, field.name)
                        )
            result, wanted = found.result(frame), expected.result(frame)
            np.testing.assert_array_equal(result.estimate.pose, wanted.estimate.pose)
            np.testing.assert_array_equal(result.carried.particles.poses, wanted.carried.particles.poses)
            assert (result.evaluations, result.notes) == (wanted.evaluations, wanted.notes)
    assert one.summary().status == other.summary().status == "finished"


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, dict[str, list[int]]]:
    """A session whose runs a simulated card has tracked, and how many kernels it launched."""
    place = tmp_path_factory.mktemp("card")
    session = make_session(place / made.PLACE)
    for prefix in ("beside", made.LONE):
        prepared(session, prefix)
    found = run_simulated(Path(made.__file__), place / "found.pickle")
    return session, pickle.loads(found.read_bytes())


@pytest.mark.parametrize("number", range(len(made.OWN)))
def test_a_run_beside_others_on_a_card_is_stored_as_the_run_alone(
    simulated: tuple[Session, Any], number: int
) -> None:
    """They differ by seed and knobs; one is taken up again inside its second frame, one searches its first twice."""
    session, _ = simulated
    assert_same(session.run(f"beside-{number}"), session.run(f"{made.LONE}-{number}"))


def test_runs_side_by_side_share_launches(simulated: tuple[Session, Any]) -> None:
    """Thirteen layers in place of 39: three for most in each frame, three that one run searches its first frame again,
    and one that is left of the frame that was begun.
    """
    _, launches = simulated
    (together,) = launches["together"]
    assert 12 * min(launches["alone"]) / 9 < together < 15 * max(launches["alone"][1:]) / 9


def test_runs_whose_frames_are_shared_are_stored_as_alone_by_the_processor(
    session_on_disk: Session,
) -> None:
    beside, alone = prepared(session_on_disk, "beside"), prepared(session_on_disk, made.LONE)
    finish(session_on_disk, beside[1], layers=4)
    reported: list[tuple[int, int]] = []
    track_together(session_on_disk, beside, lambda _, done, total: reported.append((done, total)))
    for one, other in zip(beside, alone, strict=True):
        track_to_end(session_on_disk, other, no_progress)
        assert_same(one, other)
    assert reported[0] == (1, 12)
    assert reported[-1] == (12, 12)
    assert not any(run.being_tracked() for run in beside)
