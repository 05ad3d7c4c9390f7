"""A mouse that a tracked clip turns half round for some frames points ahead again."""

import dataclasses
from collections.abc import Mapping
from functools import cache

import numpy as np
from drawn_people import drawn_evidence, ring_of_cameras

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.evidence.distance_maps import SilhouetteDistances, silhouettes_by_camera
from studio.foundations.arrays import Array, Indices
from studio.search.trackers.limb_resampling import turned_pose
from studio.search.trackers.turning_back import Turn, stretches, with_facing_right

CAMERAS = tuple(
    dataclasses.replace(camera, translation=camera.translation / 10.0)
    for camera in ring_of_cameras(3, 320, 240)
)
MOUSE = load_body("mouse31")
NAMES = [entry.name for entry in MOUSE.parameters]
FPS, FRAMES = 60.0, np.arange(100, 108)


def walk() -> Array:
    """(8, D) a mouse that walks and bends to a side, its tail aside."""
    poses = np.repeat(MOUSE.neutral[None], len(FRAMES), axis=0)
    poses[:, NAMES.index("pelvis_x")] = np.linspace(-20.0, 20.0, len(FRAMES))
    poses[:, NAMES.index("heading")] = np.linspace(0.3, 0.5, len(FRAMES))
    poses[:, NAMES.index("tail_wag")] = 0.5
    return poses


WALK = walk()


@cache
def seen(frame: int) -> Mapping[str, SilhouetteDistances]:
    return silhouettes_by_camera(drawn_evidence(MOUSE, WALK[frame - FRAMES[0]], CAMERAS), 150)


def turned_in(*rows: int) -> Array:
    """The walk, turned half round in some frames."""
    poses = WALK.copy()
    for row in rows:
        turned = turned_pose(MOUSE, WALK[row])
        assert turned is not None
        poses[row] = turned
    return poses


def right(poses: Array, frames: Indices = FRAMES, fps: float = FPS) -> tuple[Array, tuple[Turn, ...]]:
    return with_facing_right(MOUSE, CAMERAS, frames, poses, fps, seen)


def off(poses: Array) -> Array:
    """(K,) largest distance of a marker from where it is, mm."""
    away = marker_points(MOUSE, poses) - marker_points(MOUSE, WALK)
    return np.asarray(np.linalg.norm(away, axis=2).max(axis=1))


def test_a_mouse_that_is_turned_round_for_some_frames_is_turned_back() -> None:
    planted = turned_in(2, 5, 6)
    assert (off(planted)[[2, 5, 6]] > 100.0).all()
    found, turns = right(planted)
    assert [(turn.first, turn.last) for turn in turns] == [(102, 102), (105, 106)]
    assert off(found).max() < 15.0
    kept = [0, 1, 3, 4, 7]
    np.testing.assert_array_equal(found[kept], planted[kept])
    assert turns[1].words == "frames 105 to 106: turned round, as the frames before and after point"


def test_a_clip_in_which_it_never_turns_is_unchanged() -> None:
    found, turns = right(WALK)
    assert turns == ()
    np.testing.assert_array_equal(found, WALK)


def test_a_turn_that_nothing_turns_back_is_carried_to_the_end_of_the_clip() -> None:
    planted = turned_in(5, 6, 7)
    found, turns = right(planted)
    assert [(turn.first, turn.last, turn.like) for turn in turns] == [(105, 107, "before")]
    assert off(found).max() < 15.0
    np.testing.assert_array_equal(found[:5], planted[:5])
    assert turns[0].words == "frames 105 to 107: turned round, as the frames before point"


def test_a_body_that_drifts_off_and_turns_in_one_frame_is_carried_back_to_where_it_was_lost() -> None:
    """It goes about in four frames; the search follows with a part of that to the wrong side, until it turns."""
    drifted, heading = WALK.copy(), NAMES.index("heading")
    drifted[2:6, heading] += np.radians([45.0, 80.0, 110.0, 130.0])
    assert len(stretches(MOUSE, drifted, FPS)) == 2
    found, turns = right(drifted)
    assert [turn.like for turn in turns] == ["after"]
    assert 102 <= turns[0].first <= 104
    assert turns[0].last == 105
    assert off(found)[3:].max() < 15.0


def test_a_clip_that_was_started_the_wrong_way_and_turns_soon_is_right_from_its_first_frame() -> None:
    found, turns = right(turned_in(0, 1))
    assert [(turn.first, turn.last, turn.like) for turn in turns] == [(100, 101, "after")]
    assert off(found).max() < 15.0


def test_a_gap_may_hide_a_turn() -> None:
    apart = FRAMES + np.array([0, 0, 0, 5, 5, 9, 9, 9])
    found, turns = right(turned_in(3, 4), apart)
    assert turns == ()
    np.testing.assert_array_equal(found, turned_in(3, 4))


def test_a_turn_that_the_pictures_show_stays() -> None:
    really = turned_in(*range(3, 8))

    def shown(frame: int) -> Mapping[str, SilhouetteDistances]:
        return silhouettes_by_camera(drawn_evidence(MOUSE, really[frame - FRAMES[0]], CAMERAS), 150)

    found, turns = with_facing_right(MOUSE, CAMERAS, FRAMES, really, FPS, shown)
    assert turns == ()
    np.testing.assert_array_equal(found, really)


def test_a_body_turns_as_fast_as_its_file_says() -> None:
    headings = np.radians([0.0, 85.0, 180.0, 340.0])
    poses = np.repeat(MOUSE.neutral[None], 4, axis=0)
    poses[:, NAMES.index("heading")] = headings
    # 400 degrees a second: 13 in a sixtieth, 200 in half a second.
    assert [part.tolist() for part in stretches(MOUSE, poses, 60.0)] == [[0, 1], [2], [3]]
    assert [part.tolist() for part in stretches(MOUSE, poses, 2.0)] == [[0, 1, 2, 3]]


def test_a_reared_mouse_that_turns_about_itself_is_noticed() -> None:
    poses = np.repeat(MOUSE.neutral[None], 2, axis=0)
    poses[:, NAMES.index("pitch")] = np.radians(-90.0)
    poses[1, NAMES.index("heading")] = np.pi
    assert len(stretches(MOUSE, poses, 60.0)) == 2


def test_people_are_not_looked_at() -> None:
    person = load_body("human29")
    poses = np.repeat(person.neutral[None], 3, axis=0)
    poses[1, [entry.name for entry in person.parameters].index("heading")] = np.pi

    def nothing(_: int) -> Mapping[str, SilhouetteDistances]:
        raise AssertionError

    found, turns = with_facing_right(person, CAMERAS, np.arange(3), poses, FPS, nothing)
    assert turns == ()
    np.testing.assert_array_equal(found, poses)
