"""A small tracked run of a person drawn as masks, for all tests of the views; nobody changes it."""

import pytest
from drawn_people import ring_of_cameras
from planted_runs import FRAMES, LAYERS, PARTICLES, drawn_session, person_poses
from tracked_runs import finish

from studio.inspection.reading import InspectedFrame, InspectedRun
from studio.runs.new_run import prepare_run


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> InspectedRun:
    """Five frames of a walk, four layers of forty particles, nothing refined."""
    poses = person_poses("walk", 30, FRAMES, 2)
    session = drawn_session(tmp_path_factory.mktemp("views") / "drawn", poses, ring_of_cameras(4))
    knobs = {"refine_frames": False, "particles": PARTICLES, "layers": LAYERS, "start_repeats": 1}
    made = prepare_run(session, knobs=knobs, seed=4, fit_shape=False, allow_inconsistent=True, name="small")
    finish(session, made)
    return InspectedRun(session, made)


@pytest.fixture
def frame(run: InspectedRun) -> InspectedFrame:
    """Its fourth frame."""
    return run.frame(3)
