"""Fixtures that every room's tests share."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Playwright, expect, sync_playwright
from toy_session import make_session
from waiting import EXPECTED_MILLISECONDS

from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# The pages are drawn by the processor itself and the scene's WebGL alone by SwiftShader. With "swiftshader" whatever
# moves on any page goes through it as well, at several times the cost.
ARGUMENTS = [
    "--no-sandbox",
    "--use-angle=swiftshader-webgl",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
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


def chromium(playwright: Playwright) -> str:
    """The system's Chromium, else the one that Playwright downloaded; without either the tests fail."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    own = playwright.chromium.executable_path
    if found is None and not Path(own).is_file():
        pytest.fail("No Chromium is installed: run 'make browser' first.", pytrace=False)
    return found or own


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Chromium, drawing in software: one for all files, as a thread has room for one Playwright; each
    window in a context of its own.
    """
    expect.set_options(timeout=EXPECTED_MILLISECONDS)
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(
            executable_path=chromium(playwright), headless=True, args=ARGUMENTS
        )
        yield launched
        launched.close()
