"""Start poses from nothing but the body's dimensions: the Lee walk's own frames, and its twin in random moments."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from random_people import people_session, random_moments
from scipy import ndimage

from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.reading import read_recording
from studio.body.motion_files.trc import read_trc
from studio.body.person import PersonMotion
from studio.body.retargeting import on_skeleton
from studio.evidence.frame_evidence import FrameEvidence
from studio.footage.capture.calibration_files import read_calibration
from studio.results.drawing_footage.person import with_hands_and_feet
from studio.results.drawing_footage.recipe_file import Recipe, find_recipe, read_recipe
from studio.results.drawing_footage.recipes import recipe_motion, recipe_person
from studio.runs.problem_source import ProblemSource
from studio.runs.setup.initialising import WEIGHTING, initialise
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.silhouette_areas import Silhouettes
from studio.search.settings import default_settings
from studio.sessions.importers.importing import import_source
from studio.sessions.session import Session

pytestmark = pytest.mark.real_data

MIDDLE = (450.0, 450.0)
"""mm: where all four cameras see a person whole."""
DANCES = ("05_02", "05_03", "05_06", "05_09", "05_10", "05_11")


@pytest.fixture(scope="module")
def lee(real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Session:
    place = tmp_path_factory.mktemp("lee") / "lee-walk"
    import_source(real_data / "lee-walk", place)
    return Session(place)


def largest_regions(session: Session, frame: int) -> FrameEvidence:
    """The frame with nothing but the largest region in each mask."""
    problems = ProblemSource(session, session.body())
    evidence = problems.evidence(frame, default_settings("annealed", WEIGHTING))
    problems.close()
    views = []
    for view in evidence.views:
        regions = np.asarray(ndimage.label(view.mask > 0)[0])  # pyright: ignore[reportIndexIssue]
        sizes = np.bincount(regions.ravel())
        sizes[0] = 0
        kept = np.where(regions == int(np.argmax(sizes)), 255, 0).astype(np.uint8)
        views.append(dataclasses.replace(view, mask=kept))
    return FrameEvidence(frame, tuple(views))


@pytest.mark.slow
@pytest.mark.parametrize("frame", range(4))
@pytest.mark.parametrize("name", ["human31", "human25"])
def test_the_lee_walks_subject_is_found_left_and_right_as_given(lee: Session, name: str, frame: int) -> None:
    body, given_body = lee.body(name), lee.body()
    pose = initialise(lee, frame, body=body, seed=0).pose
    silhouettes = Silhouettes(largest_regions(lee, frame), "full")
    areas = silhouettes.areas(OutlineProjector.of_body(body, lee.cameras()).blocks(pose[None]), 1)
    assert (areas.both[0] / areas.projected[0]).min() >= 0.85
    given = lee.start_pose(given_body)
    assert given is not None
    wanted = dict(
        zip([one.name for one in given_body.markers], marker_points(given_body, given)[0], strict=True)
    )
    found = dict(zip([one.name for one in body.markers], marker_points(body, pose)[0], strict=True))
    for part in ("Hip", "Knee", "Ankle", "Shoulder"):
        for side, other in ("LR", "RL"):
            own = np.linalg.norm(found[side + part] - wanted[side + part])
            swapped = np.linalg.norm(found[side + part] - wanted[other + part])
            assert own < swapped, (side + part, own, swapped)


def twin_in_random_moments(real_data: Path, place: Path, count: int) -> Session:
    """The Lee walk's twin, every other frame walking, the others dancing, in random headings and places."""
    path = find_recipe("lee-walk-twin")
    recipe: Recipe = read_recipe(path)
    skeleton, shape = recipe_person(recipe, path.parent, np.random.default_rng(3))
    assert shape is not None
    walk: PersonMotion = recipe_motion(recipe, path.parent, skeleton)
    clips = [
        on_skeleton(read_recording(real_data / "cmu-motion" / f"{name}.amc"), skeleton) for name in DANCES
    ]
    motions = [motion for clip in clips for motion in (walk, clip)]
    motion = random_moments(motions, count, np.random.default_rng(2), MIDDLE)
    cameras = read_calibration(real_data / "lee-walk" / "CALIB").cameras
    return people_session(place, motion, with_hands_and_feet(shape, skeleton), cameras, recipe)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", ["human31", "human25"])
def test_the_twin_is_found_in_18_of_20_random_moments(
    real_data: Path, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", str(real_data))
    session = twin_in_random_moments(real_data, tmp_path / "people", 20)
    body = session.body(name)
    assert session.truth_path is not None
    truth = read_trc(session.truth_path)
    order = [truth.names.index(marker.name) for marker in body.markers]
    errors = []
    for frame in range(20):
        found = marker_points(body, initialise(session, frame, body=body, seed=0).pose)[0]
        errors.append(float(np.linalg.norm(found - truth.positions[frame, order], axis=1).mean()))
    assert sum(error <= 80.0 for error in errors) >= 18, [round(error) for error in errors]
