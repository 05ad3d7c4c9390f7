"""Footage of any body moved through keys: exact poses, its own size, and trackers that follow it."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import tomli_w
from drawn_people import drawn_mask
from tracked_runs import finish

import studio
from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.body.motion_files.trc import read_trc
from studio.foundations.errors import StudioError
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.body_footage import TRUE_POSES, body_motion, key_poses, recipe_body
from studio.results.drawing_footage.recipe_file import RECIPES, Key, find_recipe, read_recipe
from studio.results.drawing_footage.recipes import synthesize
from studio.runs.new_run import prepare_run
from studio.runs.tracks import read_track
from studio.sessions.session import Session

THIN_AND_CLEAN = {
    "mask_threshold": 10.0,
    "mask_opening": 0,
    "mask_closing": 0,
    "mask_fill_holes": 0,
    "refine_frame_points": 1000,
}
CLOSE = {"refinement_pull": 1.0, "refinement_scale": 15.0, "refinement_acceleration": 10.0}


def like(folder: Path, name: str, **changes: object) -> Path:
    """A recipe like a bundled one. Keys of tables are written table__key."""
    entries: dict[str, object] = {"like": name}
    for key, value in changes.items():
        table, _, entry = key.rpartition("__")
        (entries.setdefault(table, {}) if table else entries)[entry] = value
    path = folder / f"small-{name}.toml"
    path.write_text(tomli_w.dumps(entries))
    return path


def smaller(folder: Path, name: str, share: float, **changes: object) -> Path:
    """The recipe with pictures of a share of their size."""
    recipe = read_recipe(find_recipe(name))
    placed = [
        {"name": c.name, "position": c.position, "look_at": c.look_at, "focal_px": share * c.focal_px}
        for c in recipe.cameras.placed
    ]
    width, height = (2 * round(share * side / 2) for side in (recipe.picture.width, recipe.picture.height))
    body = RECIPES / recipe.body
    own = {"body": str(body)} if body.is_file() else {}
    sizes = {"picture__width": width, "picture__height": height, "picture__empty_frames": 6}
    return like(folder, name, **{"cameras__placed": placed, **sizes, **own, **changes})


def true_poses(session: Session) -> np.ndarray:
    table = np.genfromtxt(session.path / TRUE_POSES, delimiter=",", names=True)
    return np.stack([np.atleast_1d(table[e.name]) for e in session.body().parameters], axis=1)


def degrees_off(session: Session, poses: np.ndarray) -> np.ndarray:
    """(F, angles) degrees between poses and the true ones of the first frames."""
    angles = [entry.kind == "angle" for entry in session.body().parameters]
    off = (poses - true_poses(session)[: len(poses)])[:, angles]
    return np.degrees(np.abs((off + np.pi) % (2.0 * np.pi) - np.pi))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["robot-arm", "hand-grasp"])
def test_masks_and_markers_are_where_the_true_poses_put_the_body(tmp_path: Path, name: str) -> None:
    recipe = smaller(tmp_path, name, 0.3, frames=2, include__masks=True, damage__clutter=0)
    session = Session(synthesize(recipe, tmp_path / "made"))
    body, poses = session.body(), true_poses(session)
    parsed = read_recipe(recipe)
    np.testing.assert_allclose(poses, body_motion(parsed, body, np.arange(2) / parsed.fps), atol=1e-6)
    assert session.truth_path is not None
    truth = read_trc(session.truth_path)
    order = [[marker.name for marker in body.markers].index(one) for one in truth.names]
    np.testing.assert_allclose(truth.positions, marker_points(body, poses)[:, order], atol=0.01)
    start = session.start_pose()
    assert 0.0 < degrees_off(session, start[None]).max() < 8.0
    footage, ends = session.footage(), limb_ends(body, poses)
    try:
        for camera in session.cameras():
            mask = footage.mask(camera.name, 1)
            assert mask is not None
            middles = project(camera, ends[1].mean(axis=1))[0].round().astype(int)
            reached = cv2.dilate(mask, np.ones((3, 3), np.uint8))
            assert all(reached[row, column] > 0 for column, row in middles)
            # And no larger than the body: within its widest limb of the line through some limb.
            lines = np.zeros_like(mask)
            widest = max(
                max(limb.radius_start, limb.radius_end) * max(limb.scale_x, limb.scale_y, 1.0)
                for limb in body.drawn
            )
            scale = camera.matrix[0, 0] / project(camera, ends[1, :, 0])[1].min()
            for one, two in project(camera, ends[1].reshape(-1, 3))[0].reshape(-1, 2, 2).round().astype(int):
                cv2.line(lines, one.tolist(), two.tolist(), 255, int(2.0 * 1.3 * widest * scale) + 3)
            assert not np.any((mask > 0) & (lines == 0))
    finally:
        footage.close()


def test_the_session_of_a_robot_has_its_body_and_needs_no_other_reader(tmp_path: Path) -> None:
    recipe = smaller(tmp_path, "robot-arm", 0.2, frames=1, include__background="none")
    session = Session(synthesize(recipe, tmp_path / "made"))
    assert (session.path / "bodies" / "robot_arm.toml").is_file()
    assert session.manifest.body == "robot_arm"
    own = load_body(str(RECIPES / "robot_arm.urdf"))
    np.testing.assert_allclose(limb_ends(session.body(), own.neutral), limb_ends(own, own.neutral), atol=1e-6)


@pytest.mark.slow
def test_flat_ends_are_those_of_the_tree(tmp_path: Path) -> None:
    """Rendered with edges, the mask is the outline that the tracker projects, to the pixels of its border."""
    recipe = smaller(tmp_path, "robot-arm", 0.5, frames=1, include__masks=True, damage__clutter=0)
    session = Session(synthesize(recipe, tmp_path / "made"))
    footage, pose = session.footage(), true_poses(session)[0]
    try:
        for camera in session.cameras():
            mask, drawn = footage.mask(camera.name, 0), drawn_mask(session.body(), pose, camera)
            wrong = cv2.morphologyEx(mask ^ drawn, cv2.MORPH_OPEN, np.ones((4, 4), np.uint8))
            assert not wrong.any()
    finally:
        footage.close()


@pytest.mark.slow
def test_a_robot_arm_is_followed(tmp_path: Path) -> None:
    recipe = smaller(tmp_path, "robot-arm", 0.75, frames=3)
    session = Session(synthesize(recipe, tmp_path / "made"))
    run = prepare_run(session, name="arm", seed=1, knobs=THIN_AND_CLEAN)
    finish(session, run)
    with run.results() as results:
        off = degrees_off(session, results.poses()[1])
    assert off.mean() < 2.0


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_whole_take_of_the_arm_is_followed_within_two_degrees(tmp_path: Path) -> None:
    session = Session(synthesize("robot-arm-3", tmp_path / "made"))
    run = studio.track(session, name="arm", knobs=THIN_AND_CLEAN, progress=False)
    studio.refine(run, knobs=CLOSE, progress=False)
    off = degrees_off(session, read_track(run.run, "refined").poses)
    assert len(off) == 75
    assert off.mean(axis=0).max() < 2.0
    assert np.quantile(off, 0.95) < 2.0


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_whole_take_of_the_hand_is_followed(tmp_path: Path) -> None:
    session = Session(synthesize("hand-grasp", tmp_path / "made"))
    run = studio.track(session, name="hand", progress=False)
    poses = read_track(run.run, "raw").poses
    body = run.run.body()
    assert len(poses) == 60
    off = np.linalg.norm(marker_points(body, poses) - marker_points(body, true_poses(session)), axis=-1)
    assert off.mean() < 2.5
    assert degrees_off(session, poses).mean() < 4.0


def test_keys_hold_limits_and_follow_the_seed() -> None:
    recipe = read_recipe(find_recipe("robot-arm"))
    body = recipe_body(recipe, RECIPES)
    poses = key_poses(body, recipe.keys, 15.0, np.random.default_rng(1))
    exact = key_poses(body, recipe.keys, 0.0, np.random.default_rng(1))
    moved = np.degrees(np.abs(poses - exact))
    assert 0.0 < moved.max() <= 15.0
    np.testing.assert_allclose(np.degrees(exact[0, :2]), [-60.0, 20.0])
    others = key_poses(body, recipe.keys, 15.0, np.random.default_rng(2))
    assert np.abs(others - poses).max() > 0.01
    far = key_poses(body, [Key(0.0, {"axis_2": 500.0})], 0.0, np.random.default_rng(1))
    assert far[0, 1] == body.parameters[1].upper
    with pytest.raises(StudioError, match="no parameter 'elbow'"):
        key_poses(body, [Key(0.0, {"elbow": 1.0})], 0.0, np.random.default_rng(1))
    times = np.array([recipe.keys[1].at_s, 99.0])
    still = body_motion(recipe, body, times)
    np.testing.assert_allclose(still[1], body_motion(recipe, body, np.array([recipe.keys[-1].at_s]))[0])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"motion": "walk"}, "belong together"),
        ({"keys": [{"at_s": 1.0}, {"at_s": 1.0}]}, "order of their moments"),
        ({"shape": "a.txt"}, "belong to a person"),
        ({"magnify": 0.0}, "magnify is 0"),
        ({"keys": []}, "belong together"),
        ({"edge_mm": -1.0}, "edge_mm is -1"),
        ({"beside": ["walk"]}, "nobody is beside motion 'keys'"),
    ],
)
def test_keys_that_make_no_motion_are_refused(tmp_path: Path, changes: dict[str, object], words: str) -> None:
    with pytest.raises(StudioError, match=words):
        read_recipe(like(tmp_path, "robot-arm", **changes))
