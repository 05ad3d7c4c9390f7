"""A real browser before a real studio."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from guided_setup import PATIENCE, GuidedSetup
from playwright.sync_api import Browser, expect
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import make_session

ROOT = Path(__file__).resolve().parent.parent.parent


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StudioServer]:
    """`studio demo` on a workspace of its own."""
    studio = StudioServer("demo", tmp_path_factory.mktemp("demo") / "workspace")
    yield studio
    studio.stop()


@pytest.fixture
def toy_studio(tmp_path: Path) -> Iterator[StudioServer]:
    """`studio serve` on the toy arm."""
    make_session(tmp_path / "workspace" / "toy")
    made = StudioServer("serve", tmp_path / "workspace")
    yield made
    made.stop()


@pytest.fixture(scope="module")
def window(browser: Browser, studio: StudioServer) -> Iterator[StudioPage]:
    """One window, its scene left blank, for all tests of a file that has a `studio`; they go on from one another."""
    opened = StudioPage(browser, studio, with_scene=False)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def way(
    browser: Browser,
    tmp_path_factory: pytest.TempPathFactory,
    artefacts: Path,
    request: pytest.FixtureRequest,
) -> Iterator[GuidedSetup]:
    """The guided set-up of a studio with an empty workspace that may read no folder, for all tests of a file, which
    names the folder of its `PICTURES`; the scene is left blank.
    """
    studio = StudioServer("serve", tmp_path_factory.mktemp("way") / "workspace")
    expect.set_options(timeout=PATIENCE)
    try:
        opened = StudioPage(browser, studio, with_scene=False)
        yield GuidedSetup(opened, artefacts / request.module.PICTURES)
        opened.close()
    finally:
        expect.set_options(timeout=5_000)  # Playwright's own
        studio.stop()


@pytest.fixture(scope="session")
def artefacts() -> Path:
    """Where screenshots are kept to be looked at (STUDIO_ARTEFACTS, default artefacts/)."""
    return Path(os.environ.get("STUDIO_ARTEFACTS", ROOT / "artefacts"))
