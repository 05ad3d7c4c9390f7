"""A session of which cameras were taken away: what was tracked with all of them, and what is tracked with the rest."""

import shutil
from pathlib import Path

import pytest
from drawn_people import ring_of_cameras
from planted_runs import FRAMES, LAYERS, PARTICLES, drawn_session, person_poses
from tracked_runs import finish, opened

from studio.foundations.errors import RunError
from studio.results.export.exporting import export_run
from studio.results.export.formats import format_of
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.shared_page import shared_page
from studio.runs.checking import check_run
from studio.runs.new_run import prepare_run
from studio.runs.setup.workflow import run_changes
from studio.sessions.importers.importing import ImportOptions, add_footage
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

KNOBS = {"refine_frames": False, "particles": PARTICLES, "layers": LAYERS, "start_repeats": 1}


@pytest.fixture(scope="module")
def two_left(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, tuple[str, ...]]:
    """A tracked session of four cameras of which two are left, and their names."""
    place = tmp_path_factory.mktemp("fewer")
    cameras = ring_of_cameras(4)
    session = drawn_session(place / "drawn", person_poses("walk", 30, FRAMES, 2), cameras)
    finish(session, new_run(session, "with-four"))
    begun = new_run(session, "begun")
    finish(session, begun, layers=LAYERS)
    new_run(session, "prepared")
    names = tuple(camera.name for camera in cameras[:2])
    for name in names:
        for part in ("pictures", "masks"):
            shutil.copytree(session.path / part / name, place / "two" / part / name)
    add_footage(session, place / "two", ImportOptions(fps=60.0, replace=True))
    return Session(session.path), names


def new_run(session: Session, name: str) -> StoredRun:
    return prepare_run(session, knobs=KNOBS, seed=4, fit_shape=False, allow_inconsistent=True, name=name)


def exported(session: Session, run: StoredRun, form: str, folder: Path) -> tuple[Path, ...]:
    return export_run(session, run, format_of(form), {}, folder / f"motion.{form}").files


def test_what_is_left_is_tracked_exported_and_shared(two_left, tmp_path: Path) -> None:
    session, names = two_left
    run = new_run(session, "with-two")
    assert len(finish(session, run)) == FRAMES
    assert tuple(camera.name for camera in run.cameras()) == names
    assert run_changes(session, run) == []
    assert exported(session, run, "bvh", tmp_path)
    assert shared_page(InspectedRun(session, run), 2)


def test_a_run_prepared_before_is_tracked_with_what_is_left(two_left) -> None:
    session, _ = two_left
    assert len(finish(session, session.run("prepared"))) == FRAMES


def test_what_was_tracked_before_is_shown_and_goes_on_only_with_all_of_its_cameras(
    two_left, tmp_path: Path
) -> None:
    session, names = two_left
    run = session.run("with-four")
    assert exported(session, run, "trc", tmp_path)
    assert shared_page(InspectedRun(session, run), 2)
    assert check_run(session, run).cameras == names
    with (
        pytest.raises(RunError, match="cam3, cam4, of which the session has no footage"),
        opened(session, session.run("begun")),
    ):
        pass
