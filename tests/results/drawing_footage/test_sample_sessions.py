"""The committed samples: complete, small, made from their recipes, and fit to be tracked."""

from pathlib import Path

import numpy as np
import pytest

from studio.body.motion_files.trc import read_trc
from studio.body.person import marker_motion
from studio.evidence.background import gaussian_from_frames
from studio.evidence.masks import cleaned
from studio.evidence.settings import EvidenceSettings
from studio.footage.capture.video import VideoReader
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import skeleton_of_height
from studio.results.drawing_footage.recipe_file import find_recipe, read_recipe, recipe_cameras
from studio.results.drawing_footage.renderer import Renderer
from studio.results.drawing_footage.rooms import room_called
from studio.results.evaluation.errors import evaluate
from studio.sessions.session import Session

SAMPLES = Path(__file__).resolve().parents[3] / "sample_sessions"


def test_the_samples_are_a_few_megabytes() -> None:
    files = [path for path in SAMPLES.rglob("*") if path.is_file() and "runs" not in path.parts]
    assert sum(path.stat().st_size for path in files) < 6_000_000


@pytest.mark.parametrize("name", ["walk", "planar_arm", "branched_arms"])
def test_a_sample_is_a_complete_session_of_its_recipe(name: str) -> None:
    session = Session(SAMPLES / name)
    recipe = read_recipe(SAMPLES / name / "recipe.toml")
    assert (SAMPLES / name / "recipe.toml").read_bytes() == find_recipe(name).read_bytes()
    assert session.manifest.name == name
    assert session.manifest.title == recipe.title
    assert session.manifest.frame_count == recipe.frames
    assert session.manifest.weighting == recipe.weighting
    footage = session.footage()
    try:
        last = footage.pictures(recipe.frames - 1)
        assert all(
            picture.shape == (camera.height, camera.width, 3)
            for picture, camera in zip(last.pictures, session.cameras(), strict=True)
        )
    finally:
        footage.close()
    assert session.truth_path is not None
    assert len(read_trc(session.truth_path).times) == recipe.frames


def test_the_walk_is_as_long_and_seen_as_it_should_be() -> None:
    session = Session(SAMPLES / "walk")
    assert session.manifest.frame_count >= 150
    assert session.manifest.fps == 60.0
    assert session.truth_path is not None
    truth = read_trc(session.truth_path)
    assert len(session.cameras()) == 4
    for camera in session.cameras():
        assert (camera.width, camera.height) == (640, 480)
        pixels, _ = project(camera, truth.positions)
        assert np.all((pixels > 8.0) & (pixels < [632.0, 472.0]))
        tall = np.ptp(pixels[:, :, 1], axis=1)
        assert tall.min() > 100.0
    body, pose = session.body(), session.start_pose()
    start = evaluate(pose[None], np.array([0]), body, truth, 60.0)
    assert 0.1 < start.mean_mm < 6.0


def test_the_recipe_still_gives_the_committed_truth() -> None:
    recipe = read_recipe(find_recipe("walk"))
    skeleton = skeleton_of_height(recipe.height_mm, np.random.default_rng(recipe.seed))
    markers = marker_motion(make_motion(recipe.motion, skeleton, recipe.frames, recipe.fps, recipe.options))
    truth = read_trc(SAMPLES / "walk" / "truth" / "walk.trc")
    assert truth.names == markers.names
    np.testing.assert_allclose(truth.positions, markers.positions, atol=1e-3)


@pytest.mark.slow
def test_background_subtraction_finds_the_person_nearly_whole() -> None:
    """Against the exact masks, from the committed footage and empty clips."""
    session, recipe = Session(SAMPLES / "walk"), read_recipe(find_recipe("walk"))
    rng = np.random.default_rng(recipe.seed)
    skeleton = skeleton_of_height(recipe.height_mm, rng)
    cameras = recipe_cameras(recipe, rng)
    motion = make_motion(recipe.motion, skeleton, recipe.frames, recipe.fps, recipe.options)
    settings = EvidenceSettings()
    footage = session.footage()
    shares = []
    try:
        for index in (0, 3):
            renderer = Renderer(
                room_called("furnished"), cameras[index : index + 1], motion, noise=0.0, samples=1, seed=1
            )
            name = cameras[index].name
            background = footage.background_path(name)
            assert background is not None
            reader = VideoReader(background, recipe.picture.empty_frames)
            model = gaussian_from_frames([reader.read(at) for at in range(recipe.picture.empty_frames)])
            reader.close()
            for frame in (20, 110):
                _, exact = renderer.picture(0, frame, renderer.shadow(frame))
                found = cleaned(model.foreground(footage.picture(name, frame), settings).mask, settings)
                both = np.count_nonzero((found > 0) & (exact > 0))
                shares.append(both / np.count_nonzero((found > 0) | (exact > 0)))
    finally:
        footage.close()
    assert min(shares) > 0.85
