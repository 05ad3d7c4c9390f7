"""A run of any body, whose motion is given, to be exported."""

from collections.abc import Callable
from pathlib import Path

import pytest
from export_runs import MADE, STATES, moving_poses, run_of, track_of

from studio.body.model import BodyModel
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.runs.tracks import Track
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@pytest.fixture
def make_run(tmp_path: Path) -> Callable[..., tuple[Session, StoredRun]]:
    """Builds a session of the toy footage with a run of any body whose track is given."""

    def made(body_name: str, track: Callable[[BodyModel], Track]) -> tuple[Session, StoredRun]:
        return run_of(tmp_path / f"toy-{body_name}", body_name, track)

    return made


@pytest.fixture
def exported(make_run, tmp_path: Path):
    """Exports a run of human29 with fifteen lost frames."""
    session, run = make_run("human29", lambda body: track_of(moving_poses(body), states=STATES))

    def export(name: str, **requested: object) -> Path:
        return export_run(
            session, run, FORMATS[name], {"track": MADE, **requested}, tmp_path / f"walk.{name}"
        ).files[0]

    return export
