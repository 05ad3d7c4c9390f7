"""Damage of a recipe is in the stored session: blurred pictures, a turned calibration, objects in front of
the person, a camera without footage.
"""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import tomli_w

from studio.body.person import PersonMotion, joint_points
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.tracked import TrackingTrial, track
from studio.results.drawing_footage.damage import clutter_in_front
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import Proportions, proportioned, skeleton_of_height
from studio.results.drawing_footage.recipe_file import read_recipe, recipe_cameras
from studio.results.drawing_footage.recipes import synthesize
from studio.results.drawing_footage.renderer import Renderer
from studio.results.drawing_footage.rooms import is_room, room_called
from studio.sessions.session import Session

RUN = {"radius_mm": 1000.0, "speed_mm_s": 2200.0}
ENTRIES = {
    "title": "Crouching in a drawn room",
    "motion": "crouch",
    "frames": 4,
    "fps": 20,
    "seed": 5,
    "room": "drawn-3",
    "picture": {"width": 160, "height": 120, "samples": 1, "empty_frames": 4},
    "cameras": {"rig": "corners"},
}


def made(folder: Path, **changes: object) -> Session:
    path = folder / "mine.toml"
    path.write_text(tomli_w.dumps(ENTRIES | changes))
    return Session(synthesize(path, folder / "made"))


def running(frames: int = 12) -> PersonMotion:
    return make_motion("run", skeleton_of_height(1760.0, np.random.default_rng(1)), frames, 30.0, RUN)


def rig(folder: Path) -> tuple[Camera, ...]:
    path = folder / "rig.toml"
    path.write_text(tomli_w.dumps(ENTRIES))
    recipe = read_recipe(path)
    return recipe_cameras(recipe, np.random.default_rng(recipe.seed))


@pytest.mark.slow
def test_a_stored_calibration_is_off_by_the_given_pixels(tmp_path: Path) -> None:
    for folder, pixels in (("none", 0.0), ("two", 2.0)):
        (tmp_path / folder).mkdir()
        session = made(tmp_path / folder, damage={"calibration_px": pixels}, motion="stand")
        recipe = read_recipe(session.path / "recipe.toml")
        rng = np.random.default_rng(recipe.seed)
        skeleton_of_height(recipe.height_mm, rng)
        for stored, rendered in zip(session.cameras(), recipe_cameras(recipe, rng), strict=True):
            ahead = (rendered.centre + rendered.rotation.T @ np.array([0.0, 0.0, 3000.0]))[None]
            moved = project(stored, ahead)[0] - project(rendered, ahead)[0]
            assert np.linalg.norm(moved) == pytest.approx(pixels, abs=0.02)
            np.testing.assert_allclose(stored.centre, rendered.centre, atol=0.01)


@pytest.mark.slow
def test_a_missing_camera_has_no_footage(tmp_path: Path) -> None:
    session = made(tmp_path, damage={"missing": ["cam3"]})
    assert [camera.name for camera in session.cameras()] == ["cam1", "cam2", "cam4"]
    assert not (session.path / "videos" / "cam3.mp4").exists()
    assert "cam3" in session.manifest.warnings[0]


def test_an_exposed_picture_is_less_sharp_where_the_person_moves(tmp_path: Path) -> None:
    motion, cameras = running(), rig(tmp_path)[:1]
    cameras = tuple(replace(camera, distortion=np.zeros(5)) for camera in cameras)
    sharpness, coverage = {}, {}
    for shutter in (0.0, 0.9):
        renderer = Renderer(
            room_called("furnished"), cameras, motion, noise=0.0, samples=1, seed=3, shutter=shutter
        )
        picture, mask = renderer.picture(0, 6, renderer.shadow(6))
        grey = cv2.Laplacian(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), cv2.CV_64F)
        around = cv2.dilate(mask, np.ones((5, 5), np.uint8)) > 0
        sharpness[shutter], coverage[shutter] = float(np.abs(grey[around]).mean()), mask > 0
    assert sharpness[0.9] < 0.9 * sharpness[0.0]
    both, either = coverage[0.0] & coverage[0.9], coverage[0.0] | coverage[0.9]
    assert 0.7 < both.sum() / either.sum() < 1.0


@pytest.mark.slow
def test_clutter_hides_parts_of_the_person_and_stays_clear_of_them(tmp_path: Path) -> None:
    motion, cameras = running(), rig(tmp_path)
    things = clutter_in_front(6, cameras, motion, seed=2)
    assert things == clutter_in_front(6, cameras, motion, seed=2)
    assert len(things) == 6
    points = np.stack(list(joint_points(motion).values()), axis=1)
    for thing in things:
        away = np.linalg.norm(points[..., :2] - np.array(thing.centre[:2]), axis=-1)
        assert away.min() > 250.0
    room, hidden = room_called("furnished"), 0
    for index in range(len(cameras)):
        seen = []
        for blocks in (room.blocks, room.blocks + things):
            renderer = Renderer(replace(room, blocks=blocks), cameras, motion, noise=0.0, samples=1, seed=3)
            seen.append(int((renderer.picture(index, 0, renderer.shadow(0))[1] > 0).sum()))
        hidden += seen[1] < 0.97 * seen[0]
    assert hidden >= 3


def test_clutter_without_room_for_it_is_refused(tmp_path: Path) -> None:
    motion = running(2)
    places = np.array([(x, y, 0.0) for x in range(-2800, 2801, 400) for y in range(-2400, 2401, 400)])
    everywhere = PersonMotion(
        motion.skeleton,
        motion.fps,
        motion.root[:1] * [0.0, 0.0, 1.0] + places,
        {name: np.repeat(turn[:1], len(places), axis=0) for name, turn in motion.turns.items()},
    )
    with pytest.raises(StudioError, match="no room for 3 things"):
        clutter_in_front(3, rig(tmp_path), everywhere, seed=1)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"damage": {"shutter": 1.5}}, "damage.shutter is 1.5"),
        ({"damage": {"calibration_px": -1.0}}, "damage.calibration_px is -1"),
        ({"damage": {"clutter": 99}}, "damage.clutter is 99"),
        ({"damage": {"fog": 1}}, "fog"),
        ({"damage": {"missing": ["cam9"]}}, "cam9"),
        ({"damage": {"missing": ["cam1", "cam2", "cam3", "cam4"]}}, "no camera"),
        ({"room": "drawn-x"}, "drawn-x"),
        ({"colours": {"scarf": [0.1, 0.2, 0.3]}}, "scarf"),
        ({"colours": {"shirt": [0.1, 0.2, 3.0]}}, "from 0 to 1"),
        ({"proportions": {"trunk": 3.0}}, "factors from 0.7"),
    ],
)
def test_wrong_entries_are_named(tmp_path: Path, changes: dict[str, object], words: str) -> None:
    with pytest.raises(StudioError, match=words):
        made(tmp_path, **changes)


def test_other_proportions_leave_the_height() -> None:
    usual = skeleton_of_height(1700.0, np.random.default_rng(2))
    longer = proportioned(usual, Proportions(thighs=1.1, trunk=0.95, hips=1.05))
    assert longer.thigh[0] / longer.shin[0] == pytest.approx(1.1 * usual.thigh[0] / usual.shin[0])

    def tall(bones: object) -> float:
        motion = make_motion("stand", bones, 2, 60.0, {})  # type: ignore[arg-type]
        points = joint_points(motion)
        straight = motion.skeleton
        return (
            straight.ankle_height
            + float(np.mean(straight.thigh) + np.mean(straight.shin))
            + straight.trunk
            + float(np.linalg.norm(points["head_top"] - points["head"], axis=1)[0])
        )

    assert tall(longer) == pytest.approx(tall(usual))
    assert proportioned(usual, Proportions()) is usual


def test_drawn_rooms_differ_and_are_the_same_every_time() -> None:
    assert is_room("drawn-12")
    assert is_room("office")
    assert not is_room("drawn-")
    one, again, other = room_called("drawn-12"), room_called("drawn-12"), room_called("drawn-13")
    assert one.blocks == again.blocks
    np.testing.assert_array_equal(one.lights, again.lights)
    assert one.half != other.half


@pytest.mark.slow
def test_a_damaged_take_can_be_tracked_from_the_height_alone(tmp_path: Path) -> None:
    session = made(
        tmp_path,
        damage={"calibration_px": 1.0, "clutter": 1, "missing": ["cam2"]},
        fps=60,
        room="furnished",
        colours={part: [0.8, 0.05, 0.05] for part in ("shirt", "stripes", "trousers")},
        picture={"width": 320, "height": 240, "samples": 1, "empty_frames": 6},
    )
    shelf = FootageCache(tmp_path)
    try:
        attempt = TrackingTrial(
            str(session.path),
            "annealed",
            "edge-region-silhouette",
            0,
            {"particles": 100, "layers": 5},
            subject="subject_height.toml",
        )
        found = track(attempt, shelf)
    finally:
        shelf.close()
    assert found.frames == [0, 1, 2, 3]
    assert found.mean_mm < 100.0
