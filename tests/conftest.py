"""Fixtures that every room's tests share."""

import os
from pathlib import Path

import pytest
from toy_session import make_session

from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real footage (STUDIO_REAL_DATA, default ../shared/data beside the project)."""
    folder = Path(os.environ.get("STUDIO_REAL_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("real data is not here: set STUDIO_REAL_DATA")
    return folder


@pytest.fixture(autouse=True)
def _own_workspace(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """No test ever touches the user's own workspace."""
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path_factory.mktemp("workspace")))


@pytest.fixture
def session_on_disk(_own_workspace: None) -> Session:
    """A small session of a planar arm, named "toy", in this test's own workspace."""
    workspace = Workspace()
    return make_session(workspace.place_for("toy"))
