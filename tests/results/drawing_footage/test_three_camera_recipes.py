"""Recipes of footage as in Deutscher & Reid 2005, and of recorded motion for users."""

import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from studio.body.catalogue import load_body
from studio.body.motion_files.trc import read_trc
from studio.body.person import SIDES, PersonMotion, joint_points, marker_motion
from studio.body.retargeting import lowest_of_sole
from studio.foundations.errors import StudioError
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.person import skeleton_of_height
from studio.results.drawing_footage.recipe_file import find_recipe, read_recipe, recipe_cameras
from studio.results.drawing_footage.recipes import recipe_motion, synthesize
from studio.results.evaluation.errors import evaluate
from studio.runs.search_space import default_sigma
from studio.sessions.session import Session

FIGURES = {
    "circle-three-cameras": 4.0,  # seconds that the paper names (Figs. 9 and 10), or ours
    "box-and-turn": 5.0,
    "walk-with-turns": 4.0,
    "run-three-cameras": 2.5,
    "handstand-three-cameras": 3.0,
}
RECORDED = ("run-three-cameras", "dance", "jumps")
ALL = [
    pytest.param(name, marks=pytest.mark.real_data if name in RECORDED else ())
    for name in (*FIGURES, "dance", "jumps")
]


@pytest.fixture
def _data(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Recipes find the recorded clips from wherever the tests run; without them these are skipped."""
    if request.node.get_closest_marker("real_data"):
        monkeypatch.setenv("STUDIO_REAL_DATA", str(request.getfixturevalue("real_data").resolve()))


def made(name: str) -> PersonMotion:
    path = find_recipe(name)
    recipe = read_recipe(path)
    skeleton = skeleton_of_height(recipe.height_mm, np.random.default_rng(recipe.seed))
    return recipe_motion(recipe, path.parent, skeleton)


@pytest.mark.parametrize("name", FIGURES)
def test_three_evenly_spaced_cameras_see_the_papers_bodies(name: str) -> None:
    recipe = read_recipe(find_recipe(name))
    assert recipe.frames / recipe.fps == pytest.approx(FIGURES[name])
    # Section 4.1 and Figs. 9 and 10: 29 parameters; up to 34 in all (introduction), used in section 6.3.
    section_five = name in ("circle-three-cameras", "box-and-turn")
    assert len(load_body(recipe.body).parameters) == (29 if section_five else 34)
    cameras = recipe_cameras(recipe, np.random.default_rng(0))
    assert [(camera.width, camera.height) for camera in cameras] == [(640, 480)] * 3
    bearings = np.sort([np.degrees(np.arctan2(camera.centre[1], camera.centre[0])) for camera in cameras])
    np.testing.assert_allclose(np.diff([*bearings, bearings[0] + 360.0]), 120.0, atol=1.0)
    assert np.ptp([camera.centre[2] for camera in cameras]) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.usefixtures("_data")
@pytest.mark.parametrize("name", ALL)
def test_the_whole_person_is_in_all_pictures_of_all_frames(name: str) -> None:
    recipe = read_recipe(find_recipe(name))
    motion = made(name)
    assert motion.frame_count == recipe.frames
    points = np.stack(list(joint_points(motion).values()), axis=1)
    for camera in recipe_cameras(recipe, np.random.default_rng(recipe.seed)):
        pixels, depth = project(camera, points)
        assert depth.min() > 1000.0
        assert pixels.min() > 12.0, camera.name
        assert np.all(pixels < [camera.width - 13.0, camera.height - 13.0]), camera.name
        assert np.ptp(pixels[..., 1], axis=1).max() > 150.0


@pytest.mark.usefixtures("_data")
@pytest.mark.parametrize("name", ALL)
def test_they_move_as_people_do(name: str) -> None:
    """No joint faster than a sprinter's foot, no jump, feet neither in the floor nor always above it."""
    motion = made(name)
    positions = marker_motion(motion).positions
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=2) * motion.fps / 1000.0
    acceleration = np.linalg.norm(np.diff(positions, 2, axis=0), axis=2) * motion.fps**2 / 9810.0
    assert speed.max() < 7.0
    assert acceleration.max() < 20.0
    lowest = np.min([lowest_of_sole(motion, side) for side in SIDES], axis=0)
    assert lowest.min() > -10.0
    if not name.startswith("handstand"):
        assert np.quantile(lowest, 0.2) < 30.0
    for side in SIDES:
        for upper, lower, sign in (("thigh", "shin", 1.0), ("upper_arm", "forearm", -1.0)):
            bend = np.swapaxes(motion.turns[f"{side}_{upper}"], 1, 2) @ motion.turns[f"{side}_{lower}"]
            assert (sign * np.arctan2(bend[:, 0, 2], bend[:, 2, 2])).min() > -0.1


def test_the_box_is_stepped_over_turned_behind_and_stepped_over_again() -> None:
    motion = made("box-and-turn")
    points, bones = joint_points(motion), motion.skeleton
    along = motion.root[:, 0]
    assert along[0] < -800.0
    assert along.max() > 700.0
    assert along[-1] < -500.0
    heading = np.unwrap(np.arctan2(motion.turns["pelvis"][:, 1, 0], motion.turns["pelvis"][:, 0, 0]))
    assert abs(heading[-1] - heading[0]) == pytest.approx(np.pi, abs=0.2)
    turning = (along > 700.0) & (np.abs(np.gradient(heading) * motion.fps) > 0.8)
    assert 40 < turning.sum() < 150
    assert np.ptp(along[turning]) < 250.0
    for side in SIDES:
        for part in ("foot", "toes"):
            place = points[f"{side}_{part}"]
            sole = place[:, 2] - (bones.ankle_height if part == "foot" else 0.0)
            over = np.abs(place[:, 0]) < 60.0
            assert np.count_nonzero(np.diff(np.flatnonzero(over)) > 1) == 1
            assert sole[over].min() > 125.0


def test_walking_with_turns_turns_rapidly_on_the_spot_both_ways() -> None:
    motion = made("walk-with-turns")
    heading = np.unwrap(np.arctan2(motion.turns["pelvis"][:, 1, 0], motion.turns["pelvis"][:, 0, 0]))
    rate = np.degrees(np.gradient(heading) * motion.fps)
    pace = np.linalg.norm(np.gradient(motion.root[:, :2], axis=0), axis=1) * motion.fps
    assert rate.max() > 100.0
    assert rate.min() < -100.0
    assert pace[np.abs(rate) > 100.0].mean() < 0.5 * pace[np.abs(rate) < 40.0].mean()


@pytest.mark.real_data
@pytest.mark.usefixtures("_data")
def test_the_run_is_a_run_round_a_bend() -> None:
    motion = made("run-three-cameras")
    lowest = np.min([lowest_of_sole(motion, side) for side in SIDES], axis=0)
    assert np.count_nonzero(lowest > 40.0) > 20
    pace = np.linalg.norm(np.diff(motion.root[:, :2], axis=0), axis=1).mean() * motion.fps
    assert 2000.0 < pace < 3500.0
    heading = np.unwrap(np.arctan2(motion.turns["pelvis"][:, 1, 0], motion.turns["pelvis"][:, 0, 0]))
    assert abs(heading[-1] - heading[0]) > np.pi


@pytest.mark.slow
@pytest.mark.usefixtures("_data")
@pytest.mark.parametrize("name", [param for param in ALL if param.values[0] != "walk-with-turns"])
def test_a_few_small_frames_become_a_session(tmp_path: Path, name: str) -> None:
    entries = tomllib.loads(find_recipe(name).read_text())
    entries |= {"frames": 2}
    entries["picture"] |= {"width": 160, "height": 120, "samples": 1, "empty_frames": 3}
    for camera in entries["cameras"].get("placed", []):
        camera["focal_px"] *= 0.25
    if "sigma" in entries:
        shutil.copy(find_recipe(name).with_name(entries["sigma"]), tmp_path)
    path = tmp_path / f"{name}.toml"
    path.write_text(tomli_w.dumps(entries))
    session = Session(synthesize(path, tmp_path / "made"))
    assert session.manifest.frame_count == 2
    assert session.manifest.body == entries.get("body", "human31")
    assert session.truth_path is not None
    body, pose = session.body(), session.start_pose()
    found = evaluate(pose[None], np.array([0]), body, read_trc(session.truth_path), 60.0)
    assert found.mean_mm < 12.0
    sigma = session.sigma()
    assert (sigma is None) == ("sigma" not in entries)
    if sigma is not None:
        # Half of what a runner may move in a sixtieth of a second (running_sigma.txt), 4 m/s on the floor.
        assert sigma[body.parameters.index(next(p for p in body.parameters if p.name == "pelvis_x"))] == (
            pytest.approx(0.5 * 4000.0 / 60.0, rel=1e-3)
        )
        assert np.all(sigma >= default_sigma(body, 60.0) - 1e-4)


def test_without_the_real_data_a_recorded_recipe_names_the_missing_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", str(tmp_path / "nothing"))
    with pytest.raises(StudioError, match=r"amp_humanoid_run\.npz") as refusal:
        made("run-three-cameras")
    assert "STUDIO_REAL_DATA" in refusal.value.hint


@pytest.mark.parametrize(
    ("motion", "entry"), [("recorded", ""), ("walk", 'motion_file = "data:cmu-motion/05_01.amc"')]
)
def test_a_motion_file_belongs_to_recorded_motion_alone(tmp_path: Path, motion: str, entry: str) -> None:
    path = tmp_path / "odd.toml"
    path.write_text(f'title = "Odd"\nmotion = "{motion}"\n{entry}\nframes = 5\n[cameras]\nrig = "corners"\n')
    with pytest.raises(StudioError, match="motion_file"):
        read_recipe(path)
