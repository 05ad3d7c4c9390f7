"""Clips joined to one motion: no jumps, continuous headings and places, bends, performances; the dance exercises."""

from pathlib import Path

import numpy as np
import pytest
from made_up_humanoid import humanoid, turned

from studio.body.motion_files.recorded_motion import RecordedMotion
from studio.body.person import joint_points, marker_motion
from studio.foundations.errors import StudioError
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rotations import axis_turn
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import skeleton_of_height
from studio.results.drawing_footage.recipe_file import find_recipe, read_recipe, recipe_cameras
from studio.results.drawing_footage.recipes import recipe_motion, recipe_person
from studio.results.drawing_footage.recorded_clips import Clip, joined_person, wound

BONES = skeleton_of_height(1760.0, np.random.default_rng(1))
FPS = 60.0


def gliding(frames: int, speed: float, heading: float, swing: float) -> RecordedMotion:
    """Gliding along `heading` with an arm held at `swing`."""
    recorded = humanoid(frames, {})
    for part in ("upper_arm", "lower_arm", "hand"):
        recorded.rotations[:, recorded.index(f"left_{part}")] = axis_turn(1, np.full(frames, swing))
    recorded.positions[:, :, 0] += speed * np.arange(frames)[:, None] / FPS
    return turned(recorded, heading, FPS, f"at {heading:g}")


SLOW, FAST = gliding(121, 400.0, 0.4, -0.3), gliding(121, 1200.0, -2.0, -0.9)
CLIPS = [(Clip(file="slow"), SLOW), (Clip(file="fast", blend_s=0.5), FAST)]


def test_the_second_clip_continues_where_the_first_ends_without_a_jump() -> None:
    motion = joined_person(CLIPS, BONES, 105, 30.0, {})
    assert (motion.frame_count, motion.fps) == (105, 30.0)
    way = np.diff(motion.root[:, :2], axis=0)
    heading = np.arctan2(way[:, 1], way[:, 0])
    np.testing.assert_allclose(heading, 0.4, atol=1e-3)
    speed = np.linalg.norm(way, axis=1) * 30.0
    legs = (sum(BONES.thigh) + sum(BONES.shin)) / (2.0 * 830.0)
    np.testing.assert_allclose(speed[:42], 400.0 * legs, rtol=1e-2)
    np.testing.assert_allclose(speed[-42:], 1200.0 * legs, rtol=1e-2)
    assert np.all(np.diff(speed) > -1.0)
    points = joint_points(motion)
    for name in ("left_hand", "right_toes", "head_top"):
        jumps = np.linalg.norm(np.diff(points[name], 2, axis=0), axis=1)
        assert jumps.max() < 15.0, name
    facing = np.arctan2(motion.turns["pelvis"][:, 1, 0], motion.turns["pelvis"][:, 0, 0])
    np.testing.assert_allclose(facing, 0.4, atol=1e-6)


def test_options_place_and_turn_the_whole() -> None:
    here = joined_person(CLIPS, BONES, 60, 30.0, {"turn_degrees": 90.0, "at_x_mm": 100.0, "at_y_mm": -50.0})
    middle = 0.5 * (here.root.max(axis=0) + here.root.min(axis=0))
    np.testing.assert_allclose(middle[:2], [100.0, -50.0], atol=1e-6)
    way = here.root[-1] - here.root[0]
    assert np.arctan2(way[1], way[0]) == pytest.approx(0.4 + np.pi / 2, abs=1e-3)


def test_a_path_is_bent_evenly_and_keeps_its_length() -> None:
    walk = make_motion("walk", BONES, 240, 60.0, {"radius_mm": 100_000.0, "sway_mm": 0.0})
    bent = wound(walk, np.radians(120.0))
    lengths = [np.linalg.norm(np.diff(motion.root, axis=0), axis=1).sum() for motion in (walk, bent)]
    assert lengths[1] == pytest.approx(lengths[0], rel=1e-3)
    turned = np.swapaxes(walk.turns["head"], 1, 2) @ bent.turns["head"]
    angle = np.degrees(np.unwrap(np.arctan2(turned[:, 1, 0], turned[:, 0, 0])))
    np.testing.assert_allclose(angle, np.linspace(0.0, 120.0, 240), atol=4.0)
    # A chord of a circle of that arc.
    chord = np.linalg.norm(bent.root[-1, :2] - bent.root[0, :2])
    arc = np.radians(120.0)
    assert chord == pytest.approx(lengths[0] * 2.0 * np.sin(arc / 2.0) / arc, rel=0.03)


def test_a_performance_shows_the_whole_in_the_given_frames() -> None:
    one, other = (joined_person(CLIPS, BONES, 90, 30.0, {"performance": number}) for number in (1.0, 2.0))
    whole = joined_person(CLIPS, BONES, 105, 30.0, {})
    ways = [np.linalg.norm(motion.root[-1, :2] - motion.root[0, :2]) for motion in (one, other, whole)]
    np.testing.assert_allclose(ways, ways[2], rtol=0.12)
    apart = np.linalg.norm(marker_motion(one).positions - marker_motion(other).positions, axis=2)
    assert apart.mean() > 15.0


def test_impossible_joins_are_refused() -> None:
    wrong = [
        (CLIPS, 200, {}, "last 3.51 s together"),
        (CLIPS, 60, {"tempo": 1.0}, "no option 'tempo'"),
        (CLIPS, 60, {"performance": 1.5}, "performance is 1.5"),
        (CLIPS, 60, {"angle_change_degrees": 90.0}, "angle_change_degrees"),
        ([CLIPS[0], (Clip(file="fast", blend_s=3.0), FAST)], 60, {}, "'fast': a blend of 3 s"),
        ([(Clip(file="slow", start_s=5.0), SLOW)], 60, {}, "'slow' lasts 2.00 s"),
        ([(Clip(file="slow", seconds=9.0), SLOW)], 60, {}, "'slow' lasts 2.00 s"),
    ]
    for clips, frames, options, words in wrong:
        with pytest.raises(StudioError, match=words) as refusal:
            joined_person(clips, BONES, frames, 30.0, options)
        assert refusal.value.hint


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.parametrize(
    "name", ["dance-exercise-1", "dance-exercise-2", "dance-test-1", "dance-test-2", "dance-unseen"]
)
def test_the_dance_is_smooth_stands_on_the_floor_and_is_seen_by_all(
    real_data: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", str(real_data))
    path = find_recipe(name)
    recipe = read_recipe(path)
    rng = np.random.default_rng(recipe.seed)
    skeleton, _ = recipe_person(recipe, path.parent, rng)
    cameras = recipe_cameras(recipe, rng)
    assert len(cameras) == 5
    assert (recipe.fps, recipe.body) == (30.0, "human25")
    assert name == "dance-unseen" or 400 <= recipe.frames <= 500
    motion = recipe_motion(recipe, path.parent, skeleton)
    points = joint_points(motion)
    places = np.stack(list(points.values()), axis=1)
    assert places[..., 2].min() > -1.0
    for camera in cameras:
        pixels, _ = project(camera, places.reshape(-1, 3))
        assert np.all((pixels >= 0.0) & (pixels <= [camera.width - 1, camera.height - 1])), camera.name
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2)
    assert steps.max() < 500.0
    assert np.quantile(np.linalg.norm(np.diff(motion.root, 2, axis=0), axis=1), 0.99) < 60.0
