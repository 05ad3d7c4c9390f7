"""Limbs that a search loses for some frames are put where the frames before and after lead."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.evidence.distance_maps import SilhouetteDistances, silhouettes_by_camera
from studio.foundations.progress import Progress, no_progress
from studio.search.trackers.limb_bridging import Bridge, with_limbs_bridged

CAMERAS = ring_of_cameras(4, 320, 240)
BODY = load_body("human29")
FPS, FRAMES = 30.0, np.arange(20)
LOST = slice(8, 12)
NAMES = [entry.name for entry in BODY.parameters]
Shown = Callable[[int], Mapping[str, SilhouetteDistances]]


@pytest.fixture(scope="module")
def waving() -> np.ndarray:
    """(20, D) a left arm that is raised slowly."""
    poses = np.repeat(BODY.neutral[None], len(FRAMES), axis=0)
    poses[:, NAMES.index("left_shoulder_swing")] = np.radians(np.linspace(20.0, 60.0, len(FRAMES)))
    poses[:, NAMES.index("left_elbow")] = np.radians(40.0)
    return poses


@pytest.fixture(scope="module")
def shown(waving: np.ndarray) -> Shown:
    @cache
    def silhouettes_of(frame: int) -> Mapping[str, SilhouetteDistances]:
        return silhouettes_by_camera(drawn_evidence(BODY, waving[frame], CAMERAS), 150)

    return silhouettes_of


def bridged(
    poses: np.ndarray,
    shown: Shown,
    named: Sequence[Sequence[str]] | None = None,
    progress: Progress = no_progress,
) -> tuple[np.ndarray, tuple[Bridge, ...]]:
    lost_limbs = named or [()] * len(poses)
    return with_limbs_bridged(BODY, CAMERAS, FRAMES, poses, lost_limbs, FPS, shown, progress=progress)


def off(poses: np.ndarray, truth: np.ndarray) -> float:
    """Largest distance of a marker, mm."""
    return float(np.linalg.norm(marker_points(BODY, poses) - marker_points(BODY, truth), axis=2).max())


def lost(waving: np.ndarray) -> np.ndarray:
    planted = waving.copy()
    planted[LOST, NAMES.index("left_shoulder_swing")] = np.radians(-60.0)
    return planted


def test_a_sound_clip_is_unchanged(waving: np.ndarray, shown: Shown) -> None:
    found, bridges = bridged(waving, shown)
    assert bridges == ()
    assert np.array_equal(found, waving)


def test_an_arm_that_jumps_away_and_back_is_bridged(waving: np.ndarray, shown: Shown) -> None:
    planted = lost(waving)
    assert off(planted, waving) > 300.0
    said: list[tuple[str, int, int]] = []
    found, (bridge,) = bridged(planted, shown, progress=lambda *words: said.append(words))
    assert {step for step, _, _ in said} == {"looking again for the left arm"}
    total = said[0][2]
    assert [done for _, done, _ in said] == list(range(1, total + 1))
    assert off(found, waving) < 40.0
    assert bridge.limb == "left arm"
    assert bridge.first == LOST.start
    assert bridge.last == LOST.stop - 1
    assert bridge.words == "frames 8 to 11: left arm put where the frames before and after lead"
    outside = np.ones(len(FRAMES), np.bool_)
    outside[LOST] = False
    assert np.array_equal(found[outside], planted[outside])


def test_a_limb_that_drifts_away_is_bridged_where_the_tracker_names_it(
    waving: np.ndarray, shown: Shown
) -> None:
    """It does not jump, but comes back from where it went."""
    planted, swing = waving.copy(), NAMES.index("left_shoulder_swing")
    planted[4:14, swing] -= np.radians((4.0, 8.0, 12.0, 16.0, 20.0, 20.0, 16.0, 12.0, 8.0, 4.0))
    assert bridged(planted, shown)[1] == ()
    named = [("left arm",) if 5 <= frame < 13 else () for frame in FRAMES]
    found, bridges = bridged(planted, shown, named)
    assert [bridge.limb for bridge in bridges] == ["left arm"]
    assert off(found, waving) < 0.5 * off(planted, waving)


def test_what_the_pictures_show_is_not_bridged(waving: np.ndarray) -> None:
    """The arm really moved: no other place explains the silhouettes."""
    moved = lost(waving)

    @cache
    def silhouettes_of(frame: int) -> Mapping[str, SilhouetteDistances]:
        return silhouettes_by_camera(drawn_evidence(BODY, moved[frame], CAMERAS), 150)

    found, bridges = bridged(moved, silhouettes_of)
    assert bridges == ()
    assert np.array_equal(found, moved)


def test_a_limb_that_is_lost_to_the_end_stays(waving: np.ndarray, shown: Shown) -> None:
    """Nothing behind it says where it went."""
    planted = waving.copy()
    planted[15:, NAMES.index("left_shoulder_swing")] = np.radians(-60.0)
    named = [("left arm",) if frame >= 15 else () for frame in FRAMES]
    assert bridged(planted, shown, named)[1] == ()


def test_a_clip_without_silhouettes_is_unchanged(waving: np.ndarray) -> None:
    empty = silhouettes_by_camera(drawn_evidence(BODY, None, CAMERAS), 150)
    planted = lost(waving)
    planted[:] = planted[:1]
    found, bridges = bridged(planted, lambda _frame: empty)
    assert bridges == ()
    assert np.array_equal(found, planted)
