"""Step Background asks whether the cameras agree: a nudged one is found, turned, and turned back."""

import re
from pathlib import Path

import pytest
from nudged_camera import make_nudged_session
from playwright.sync_api import Page, expect
from studio_server import StudioServer

from studio.sessions.session import CAMERAS_PATH
from studio.sessions.workspace import Workspace

pytestmark = pytest.mark.browser

PATIENCE = 60_000


@pytest.fixture(scope="module")
def workspace(workspace: Path) -> Path:
    """With the session of a camera that was nudged."""
    make_nudged_session(Workspace(workspace).place_for("nudged"))
    return workspace


@pytest.mark.slow
def test_a_nudged_camera_is_turned_and_turned_back(page: Page, studio: StudioServer, artefacts: Path) -> None:
    place = studio.workspace / "nudged" / CAMERAS_PATH
    before = place.read_bytes()
    page.goto(f"{studio.origin}/way?session=nudged&step=background")
    page.get_by_role("button", name="Measure whether the cameras agree").click()
    row = page.get_by_role("row", name=re.compile("^cam2 "))
    expect(row).to_contain_text(re.compile(r"\d\.\d px"))
    turn = page.get_by_role("button", name="Turn the cameras")
    calibration = page.locator("#stepper [data-step=calibration]")
    expect(calibration).to_contain_text("The silhouettes miss by up to")
    turn.scroll_into_view_if_needed()
    artefacts.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=artefacts / "setup-cameras-agree.png")
    assert place.read_bytes() == before
    turn.click()
    back = page.get_by_role("button", name="Turn them back")
    expect(back).to_be_enabled()
    expect(page.get_by_text("The session uses the turned cameras.")).to_be_visible()
    expect(calibration).to_contain_text("aligned by silhouettes")
    expect(calibration).not_to_contain_text("miss by")
    assert place.read_bytes() != before
    # What was measured with the cameras before is measured again: nothing waits for a person any more.
    expect(page.locator("#stepper [data-step=background]")).to_have_attribute("data-state", "done")
    page.reload()
    back.click()
    expect(turn).to_be_enabled()
    assert place.read_bytes() == before
