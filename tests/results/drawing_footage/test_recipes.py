"""From recipe to session: small renderings, read back by the studio."""

from pathlib import Path

import numpy as np
import pytest
from small_recipes import small

from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import read_trc
from studio.footage.capture.calibration_files import read_calibration, write_calibration
from studio.foundations.errors import SessionError, StudioError
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.recipe_file import read_recipe, recipe_cameras
from studio.results.drawing_footage.recipes import people_beside, synthesize
from studio.results.evaluation.errors import evaluate
from studio.sessions.session import Session


@pytest.mark.slow
@pytest.mark.parametrize("name", ["walk", "run", "box", "handstand"])
def test_a_rendered_motion_becomes_a_session_whose_start_pose_meets_the_truth(
    tmp_path: Path, name: str
) -> None:
    steps: list[tuple[str, int, int]] = []
    made = synthesize(small(tmp_path, name), tmp_path / "made", lambda *step: steps.append(step))
    session = Session(made)
    assert session.manifest.frame_count == 4
    assert session.manifest.fps == 60.0
    assert session.manifest.body == "human31"
    assert len(session.cameras()) == 4
    assert session.manifest.warnings == ()
    assert session.truth_path is not None
    truth = read_trc(session.truth_path)
    body, pose = session.body(), session.start_pose()
    found = evaluate(pose[None], np.array([0]), body, truth, 60.0)
    assert found.mean_mm < 8.0
    assert found.unmatched_markers == ()
    assert ("rendering", 4, 4) in steps
    assert (made / "recipe.toml").read_bytes() == (tmp_path / f"{name}.toml").read_bytes()
    footage = session.footage()
    try:
        seen = project(session.cameras()[0], truth.positions[0])[0]
        assert np.all((seen > 0.0) & (seen < [160.0, 120.0]))
        assert footage.pictures(3).pictures[0].shape == (120, 160, 3)
    finally:
        footage.close()


def test_masks_and_pictures_on_wish_and_the_same_bytes_again(tmp_path: Path) -> None:
    entries = {
        "include__masks": True,
        "include__background": "picture",
        "include__start_pose": False,
        "frames": 2,
    }
    recipe = small(tmp_path, "stand", **entries)
    one, two = synthesize(recipe, tmp_path / "one"), synthesize(recipe, tmp_path / "two")
    session = Session(one)
    assert session.start_pose() is None
    assert session.manifest.footage.cameras[0].background.endswith(".png")
    footage = session.footage()
    try:
        mask = footage.mask("cam1", 1)
    finally:
        footage.close()
    assert mask is not None
    assert set(np.unique(mask)) == {0, 255}
    assert np.count_nonzero(mask) > 200
    for path in sorted(one.rglob("*.mp4")):
        assert path.read_bytes() == (two / path.relative_to(one)).read_bytes(), path.name


def test_a_session_has_what_its_recipe_includes_and_the_start_pose_its_error(tmp_path: Path) -> None:
    bare = {"include__truth": False, "include__subject": False, "include__start_pose": False}
    without = Session(synthesize(small(tmp_path, "stand", frames=1, **bare), tmp_path / "bare"))
    assert (without.truth_path, without.start_pose()) == (None, None)
    assert not (without.path / "subject.toml").exists()
    errors = []
    for noise in (0.0, 40.0):
        recipe = small(tmp_path, "stand", frames=1, title="One", include__start_pose_noise_mm=noise)
        made = Session(synthesize(recipe, tmp_path / f"{noise}"))
        assert (made.manifest.title, made.manifest.imported_from) == ("One", "recipe stand.toml")
        assert made.subject().lengths_mm
        body, pose = made.body(), made.start_pose()
        assert made.truth_path is not None
        truth = read_trc(made.truth_path)
        errors.append(evaluate(pose[None], np.array([0]), body, truth, made.manifest.fps).mean_mm)
    assert errors[0] < 6.0 < 15.0 < errors[1] < 80.0


def test_only_people_of_as_many_frames_stand_beside(tmp_path: Path) -> None:
    recipe = read_recipe(small(tmp_path, "stand", beside=["other.toml"]))
    changes: list[dict[str, object]] = [{}, {"frames": 5}, {"fps": 7}]
    for changed in changes:
        small(tmp_path, "walk", **changed).rename(tmp_path / "other.toml")
        if changed:
            with pytest.raises(StudioError, match=r"'other\.toml' cannot be beside"):
                people_beside(recipe, tmp_path)
        else:
            ((person, motion),) = people_beside(recipe, tmp_path, frames=2)
            assert (person.motion, motion.frame_count) == ("walk", 2)
    small(tmp_path, "planar_arm").rename(tmp_path / "other.toml")
    with pytest.raises(StudioError, match=r"'other\.toml' cannot be beside"):
        people_beside(recipe, tmp_path)


def test_cameras_of_a_calibration_file_are_used(tmp_path: Path) -> None:
    walk = read_recipe(small(tmp_path, "walk"))
    cameras = recipe_cameras(walk, np.random.default_rng(9))[:2]
    write_calibration(cameras, tmp_path / "mine_calibration.toml")
    recipe = small(tmp_path, "stand", frames=1, cameras={"calibration": "mine_calibration.toml"})
    made = Session(synthesize(recipe, tmp_path / "made"))
    wanted = read_calibration(tmp_path / "mine_calibration.toml").cameras
    assert [camera.name for camera in made.cameras()] == [camera.name for camera in wanted]
    for camera, other in zip(made.cameras(), wanted, strict=True):
        np.testing.assert_allclose(camera.centre, other.centre)


@pytest.mark.parametrize("name", ["planar_arm", "branched_arms"])
def test_arms_are_their_own_body_with_exact_masks(tmp_path: Path, name: str) -> None:
    session = Session(synthesize(small(tmp_path, name), tmp_path / "made"))
    assert session.manifest.weighting == "template"
    assert session.start_pose() is None
    body = session.body()
    assert body.name == session.manifest.body
    truth = read_trc(session.truth_path) if session.truth_path else None
    assert set(truth.names) == {marker.name for marker in body.markers}
    camera = session.cameras()[0]
    footage = session.footage()
    try:
        for frame in range(4):
            mask = footage.mask(camera.name, frame)
            pixels = np.rint(project(camera, truth.positions[frame])[0]).astype(int)
            for at, other in [(0, 1), (1, 2), (2, 3)]:
                middle = (pixels[at] + pixels[other]) // 2
                assert mask[middle[1], middle[0]] == 255
            assert np.count_nonzero(mask) < 0.1 * mask.size
    finally:
        footage.close()
    links = np.linalg.norm(np.diff(truth.positions[:, :4], axis=1), axis=2)
    resting = np.linalg.norm(np.diff(marker_points(body, body.neutral)[0, :4], axis=0), axis=1)
    np.testing.assert_allclose(links, np.broadcast_to(resting, links.shape), atol=1e-3)


def test_an_existing_session_is_unchanged(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / "mine.txt").write_text("mine")
    with pytest.raises(SessionError, match="exists already"):
        synthesize("stand", kept)
    assert [path.name for path in kept.iterdir()] == ["mine.txt"]


def test_failing_leaves_nothing(tmp_path: Path) -> None:
    recipe = small(tmp_path, "stand", frames=3)

    def stop(step: str, done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        synthesize(recipe, tmp_path / "made", stop)
    assert not (tmp_path / "made").exists()
