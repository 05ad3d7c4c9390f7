"""A small tracked run of a person drawn as masks, with the half widths of its joints."""

import shutil
from pathlib import Path

import pytest
from drawn_people import ring_of_cameras
from planted_runs import drawn_session, person_poses
from tracked_runs import finish

from studio.foundations.progress import no_progress
from studio.results.inspection.reading import InspectedRun
from studio.results.uncertainty.half_widths import measure_uncertainty
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session

FRAMES = 10


@pytest.fixture(scope="session")
def measured(tmp_path_factory: pytest.TempPathFactory) -> InspectedRun:
    """Ten frames of a walk; tests do not change it."""
    poses = person_poses("walk", 30, FRAMES, 2)
    session = drawn_session(tmp_path_factory.mktemp("twins") / "drawn", poses, ring_of_cameras(4))
    knobs = {"refine_frames": False, "particles": 40, "layers": 4, "start_repeats": 1}
    run = prepare_run(session, knobs=knobs, seed=4, fit_shape=False, allow_inconsistent=True, name="small")
    finish(session, run)
    opened = InspectedRun(session, run)
    measure_uncertainty(opened, no_progress)
    return opened


@pytest.fixture
def own(measured: InspectedRun, tmp_path: Path) -> InspectedRun:
    """A copy of the small run, which may change."""
    folder = tmp_path / "drawn"
    shutil.copytree(measured.session.path, folder)
    session = Session(folder)
    return InspectedRun(session, session.run(measured.run.name))
