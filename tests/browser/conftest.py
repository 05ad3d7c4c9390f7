"""A real browser before a real studio."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Playwright, sync_playwright
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import make_session

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
ROOT = Path(__file__).resolve().parent.parent.parent


def chromium(playwright: Playwright) -> str:
    """The system's Chromium, else the one that Playwright downloaded; without either the tests fail."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    own = playwright.chromium.executable_path
    if found is None and not Path(own).is_file():
        pytest.fail("No Chromium is installed: run 'make browser' first.", pytrace=False)
    return found or own


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Chromium, drawing in software: one for all files, each window in a context of its own."""
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(
            executable_path=chromium(playwright), headless=True, args=ARGUMENTS
        )
        yield launched
        launched.close()


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


@pytest.fixture(scope="session")
def artefacts() -> Path:
    """Where screenshots are kept to be looked at (STUDIO_ARTEFACTS, default artefacts/)."""
    return Path(os.environ.get("STUDIO_ARTEFACTS", ROOT / "artefacts"))
