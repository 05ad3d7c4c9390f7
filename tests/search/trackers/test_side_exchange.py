"""Sides corrected over a clip: legs exchanged where they crossed, a body that faces backwards, and nothing else."""

from functools import cache

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.evidence.distance_maps import SilhouetteDistances, silhouettes_by_camera
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.side_exchange import (
    CHANGE,
    Exchange,
    Kind,
    _Work,
    best_path,
    kinds_of,
    with_sides_right,
)

CAMERAS = ring_of_cameras(4, 320, 240)
BODY = load_body("human29")
FPS, FRAMES = 30.0, np.arange(24)
CROSSING = slice(7, 23)


@pytest.fixture(scope="module")
def walk() -> np.ndarray:
    """(24, D) legs that swing by 25 degrees and cross in frames 7 and 22, and arms against them."""
    names = [entry.name for entry in BODY.parameters]
    poses = np.repeat(BODY.neutral[None], len(FRAMES), axis=0)
    swing = np.radians(25.0) * np.cos(2.0 * np.pi * (FRAMES - 0.25) / 30.0)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        poses[:, names.index(f"{side}_hip_swing")] = sign * swing
        poses[:, names.index(f"{side}_shoulder_swing")] = -sign * swing
        poses[:, names.index(f"{side}_knee")] = 0.2 + np.maximum(-0.8 * sign * swing, 0.0)
    poses[:, names.index("pelvis_x")] = 30.0 * (FRAMES - 12)
    return poses


@pytest.fixture(scope="module")
def shown(walk: np.ndarray):
    @cache
    def silhouettes_of(frame: int) -> dict[str, SilhouetteDistances]:
        return silhouettes_by_camera(drawn_evidence(BODY, walk[frame], CAMERAS), 150)

    return silhouettes_of


def kind(word: str):
    return next(entry for entry in kinds_of(BODY) if word in entry.what)


def put_right(poses: np.ndarray, shown) -> tuple[np.ndarray, tuple[Exchange, ...]]:
    return with_sides_right(BODY, CAMERAS, FRAMES, poses, FPS, shown)


def off(poses: np.ndarray, truth: np.ndarray) -> float:
    """Mean distance of the markers, mm."""
    return float(np.linalg.norm(marker_points(BODY, poses) - marker_points(BODY, truth), axis=2).mean())


def test_a_sound_clip_is_unchanged(walk: np.ndarray, shown) -> None:
    said: list[tuple[str, int, int]] = []
    found, changes = with_sides_right(
        BODY, CAMERAS, FRAMES, walk, FPS, shown, progress=lambda *words: said.append(words)
    )
    assert changes == ()
    assert np.array_equal(found, walk)
    counted = [(done, total) for step, done, total in said if step == "comparing left and right"]
    assert counted == [(done, len(counted)) for done in range(1, len(counted) + 1)]
    assert counted


@pytest.mark.slow
def test_legs_exchanged_where_they_cross_are_corrected(walk: np.ndarray, shown) -> None:
    planted = walk.copy()
    for row in range(*CROSSING.indices(len(walk))):
        planted[row] = kind("leg").offered(walk[row])
    assert off(planted[CROSSING], walk[CROSSING]) > 40.0
    found, changes = put_right(planted, shown)
    assert [change.what for change in changes] == ["left and right leg exchanged"]
    assert abs(changes[0].first - CROSSING.start) <= 1
    assert abs(changes[0].last - (CROSSING.stop - 1)) <= 1
    assert off(found[CROSSING], walk[CROSSING]) < 15.0
    assert np.array_equal(found[: CROSSING.start - 1], planted[: CROSSING.start - 1])


@pytest.mark.slow
def test_a_body_that_faces_backwards_is_turned(walk: np.ndarray, shown) -> None:
    planted = np.array([kind("front").offered(pose) for pose in walk])
    found, changes = put_right(planted, shown)
    assert changes == (Exchange(0, len(walk) - 1, "front and back exchanged"),)
    assert changes[0].words == "frames 0 to 23: front and back exchanged"
    assert off(found, walk) < 15.0 < 150.0 < off(planted, walk)


def test_frames_around_one_that_may_be_exchanged_are_examined_until_it_is_ruled_out(
    walk: np.ndarray, shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The likeliest first, and in each the pose of a neighbour that explains clearly more."""
    gains = [-1.0, -1.0, 0.1, 0.2, 0.3, 0.29, -0.2, -1.0, -1.0]
    work = _Work(BODY, CAMERAS, FRAMES[:9], walk[:9], FPS, shown, RefinementSettings())
    legs, offered = next(one for one in work._kinds if "leg" in one.what), []
    known = work._kinds[legs]

    def examine(_: Kind, row: int) -> None:
        if np.isnan(known.losses[row]):
            known.losses[row], known.wanted[row] = 1.0, walk[:1, :3]

    monkeypatch.setattr(work, "_examine", examine)
    monkeypatch.setattr(work, "_gain", lambda _, row: np.nan if np.isnan(known.losses[row]) else gains[row])
    monkeypatch.setattr(work, "_offer", lambda _, row, pose, beside: offered.append((row, beside)))
    examine(legs, 4)
    work._examine_around(legs, np.zeros(9))
    assert np.flatnonzero(np.isfinite(known.losses)).tolist() == [1, 2, 3, 4, 5, 6]
    assert offered == [(3, 4), (6, 5), (2, 3), (1, 2)]


def test_a_clip_without_silhouettes_is_unchanged(walk: np.ndarray) -> None:
    empty = silhouettes_by_camera(drawn_evidence(BODY, None, CAMERAS), 150)
    still = np.repeat(walk[:1], len(walk), axis=0)
    found, changes = put_right(still, lambda _frame: empty)
    assert changes == ()
    assert np.array_equal(found, still)


def test_kinds_of_exchange_of_every_body() -> None:
    pairs = {name: [entry.what for entry in kinds_of(load_body(name))] for name in ("human31", "dog")}
    assert pairs["human31"] == [
        "front and back exchanged",
        "left and right leg exchanged",
        "left and right arm exchanged",
    ]
    assert pairs["dog"][1:] == ["left and right foreleg exchanged", "left and right hind leg exchanged"]
    assert [entry.what for entry in kinds_of(load_body("branched_arms6"))] == ["left and right arm exchanged"]
    assert kinds_of(load_body("planar_arm4")) == ()


def test_sides_change_where_the_movement_allows_it() -> None:
    still = np.zeros((9, 2, 2))
    gains = np.array([-1.0, -1.0, 0.0, 0.4, 0.4, 0.4, 0.0, -1.0, -1.0, -1.0])
    found, gained = best_path(gains, still)
    assert np.flatnonzero(found).tolist() == [3, 4, 5]
    assert gained == pytest.approx(1.2 - 2.0 * CHANGE)
    # A change between frames 2 and 3 costs more than one between 1 and 2.
    jump = still.copy()
    jump[2, 0, 1] = 0.5
    assert np.flatnonzero(best_path(gains, jump)[0]).tolist() == [2, 3, 4, 5]
    # Too little is gained for two changes, and the other frames were not examined.
    assert not best_path(np.where(gains > 0.0, 0.5 * CHANGE, np.nan), still)[0].any()
