"""A real browser before a real studio."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from guided_setup import PATIENCE, GuidedSetup
from playwright.sync_api import Browser, Page, expect
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import make_session
from waiting import EXPECTED_MILLISECONDS

ROOT = Path(__file__).resolve().parent.parent.parent


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StudioServer]:
    """`studio demo` on a workspace of its own."""
    with StudioServer("demo", tmp_path_factory.mktemp("demo") / "workspace") as studio:
        yield studio


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The workspace of a file's studio, into which a fixture of this name in the file may put something."""
    return tmp_path_factory.mktemp("serve") / "workspace"


@pytest.fixture(scope="module")
def footage() -> Path | None:
    """The folder that a file's studio may read."""
    return None


@pytest.fixture(scope="module")
def studio(workspace: Path, footage: Path | None) -> Iterator[StudioServer]:
    """`studio serve` for all tests of a file."""
    with StudioServer("serve", workspace, footage) as studio:
        yield studio


@pytest.fixture
def toy_studio(tmp_path: Path) -> Iterator[StudioServer]:
    """`studio serve` on the toy arm."""
    make_session(tmp_path / "workspace" / "toy")
    with StudioServer("serve", tmp_path / "workspace") as studio:
        yield studio


@pytest.fixture(scope="module")
def window(browser: Browser, studio: StudioServer) -> Iterator[StudioPage]:
    """One window, its scene left blank, for all tests of a file; they go on from one another."""
    opened = StudioPage(browser, studio, with_scene=False)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def page(window: StudioPage, request: pytest.FixtureRequest) -> Iterator[Page]:
    """The page of that window, waited for with the file's PATIENCE where it has one."""
    patience = getattr(request.module, "PATIENCE", EXPECTED_MILLISECONDS)
    window.context.set_default_timeout(patience)
    expect.set_options(timeout=patience)
    yield window.page
    expect.set_options(timeout=EXPECTED_MILLISECONDS)


@pytest.fixture(scope="module")
def guided(window: StudioPage, artefacts: Path, request: pytest.FixtureRequest) -> Iterator[GuidedSetup]:
    """The guided set-up, for all tests of a file, which names the folder of its `PICTURES`."""
    expect.set_options(timeout=PATIENCE)
    yield GuidedSetup(window, artefacts / request.module.PICTURES)
    expect.set_options(timeout=EXPECTED_MILLISECONDS)


@pytest.fixture(scope="session")
def artefacts() -> Path:
    """Where screenshots are kept to be looked at (STUDIO_ARTEFACTS, default artefacts/)."""
    return Path(os.environ.get("STUDIO_ARTEFACTS", ROOT / "artefacts"))
