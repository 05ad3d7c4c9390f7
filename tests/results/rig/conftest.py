"""Small tracked runs of a person drawn as masks, and what is asked of their rigs."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from drawn_people import ring_of_cameras
from planted_runs import drawn_session, person_poses
from tracked_runs import finish

from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import no_progress
from studio.results.inspection.reading import InspectedRun
from studio.results.rig.study import RigRequest, study_rig
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session

FRAMES = 10


def tracked_by(folder: Path, cameras: tuple[Camera, ...], **knobs: object) -> InspectedRun:
    """Ten frames of a walk, as these cameras saw it."""
    session = drawn_session(folder, person_poses("walk", 30, FRAMES, 2), cameras)
    few = {"refine_frames": False, "particles": 40, "layers": 4, "start_repeats": 1}
    run = prepare_run(
        session, knobs={**few, **knobs}, seed=4, fit_shape=False, allow_inconsistent=True, name="small"
    )
    finish(session, run)
    return InspectedRun(session, run)


@pytest.fixture(scope="session")
def measured(tmp_path_factory: pytest.TempPathFactory) -> InspectedRun:
    """Four cameras around the person, whose twin is tracked; tests do not change it."""
    opened = tracked_by(tmp_path_factory.mktemp("rigs") / "drawn", ring_of_cameras(4))
    study_rig(opened, RigRequest(), no_progress)
    return opened


@pytest.fixture
def own(measured: InspectedRun, tmp_path: Path) -> InspectedRun:
    """A copy of the small run, which may change."""
    folder = tmp_path / "drawn"
    shutil.copytree(measured.session.path, folder)
    session = Session(folder)
    return InspectedRun(session, session.run(measured.run.name))


@pytest.fixture
def track(tmp_path: Path) -> Callable[..., InspectedRun]:
    """Tracks a walk as some cameras see it."""
    return lambda cameras, **knobs: tracked_by(tmp_path / "own", cameras, **knobs)
