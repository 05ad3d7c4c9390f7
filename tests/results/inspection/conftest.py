"""A small tracked run of a person drawn as masks, for all tests of the views, which do not change it."""

from collections.abc import Iterator

import pytest
from drawings import Drawings
from drawn_people import ring_of_cameras
from planted_runs import (
    FEWER_PARTICLES,
    FRAME,
    FRAMES,
    LAYERS,
    MORE_LAYERS,
    PARTICLES,
    drawn_session,
    person_poses,
)
from playwright.sync_api import Browser
from tracked_runs import finish, opened

from studio.results.inspection.reading import InspectedFrame, InspectedRun, TriedFrame
from studio.runs.new_run import prepare_run
from studio.runs.reannealing import Reannealing
from studio.search.settings import changed_settings


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
    return run.frame(FRAME)


@pytest.fixture(scope="session")
def search(run: InspectedRun) -> Reannealing:
    """The fourth frame annealed again: more layers, fewer particles, more survivors."""
    with opened(run.session, run.run) as tracking:
        changes = {"survival": 0.7, "layers": MORE_LAYERS, "particles": FEWER_PARTICLES}
        again = Reannealing(tracking, FRAME, 5, changed_settings(run.settings(FRAME), changes))
        while not again.finished:
            again.step_layer()
        again.result()
        return again


@pytest.fixture(scope="session")
def tried(search: Reannealing, run: InspectedRun) -> InspectedRun:
    """The run with that in the place of its frame."""
    trial = TriedFrame("3-a", FRAME, search.settings, tuple(search.layers), search.result())
    return InspectedRun(run.session, run.run, trial)


@pytest.fixture(scope="session")
def drawings(browser: Browser) -> Iterator[Drawings]:
    """The pages' drawings of the views."""
    opened = Drawings(browser)
    yield opened
    opened.close()
