"""The arena's page: a race begun, watched to its end, and who is where."""

from pathlib import Path

import pytest
from studio_page import StudioPage
from studio_server import StudioServer

pytestmark = pytest.mark.browser


def test_a_race_is_begun_and_drawn(window: StudioPage, studio: StudioServer, artefacts: Path) -> None:
    page = window.page
    page.get_by_role("link", name="Arena", exact=True).click()
    page.get_by_text("No race yet").wait_for()
    for name in ("CMA-ES", "Random search"):
        page.get_by_label(name, exact=True).check()
    page.get_by_label("planar-arm", exact=False).check()
    page.get_by_label("Evaluations a problem").fill("300")
    page.get_by_label("Seeds").fill("2")
    page.get_by_role("button", name="Race", exact=True).click()
    page.get_by_text("4 trials run, 0 kept from before").wait_for()
    page.get_by_role("heading", name="Who is where").wait_for()
    standing = page.locator(".race-standing li")
    assert standing.count() == 2
    assert page.locator(".race-pose").count() == 2
    slider = page.get_by_label("Evaluations", exact=True)
    slider.fill("0")
    page.get_by_text("After 10 evaluations").wait_for()
    page.get_by_role("button", name="random-search").first.click()
    assert page.locator(".race-pose").count() == 1
    page.get_by_label("Seen", exact=True).select_option("space")
    canvas = page.locator("canvas.race-space")
    assert canvas.get_attribute("aria-label") == "Poses of cma-es after 10 evaluations"
    before = canvas.screenshot()
    canvas.press("ArrowRight")
    assert canvas.screenshot() != before
    assert page.locator(".findings-experiment").count() == 1
    window.page.screenshot(path=artefacts / "arena.png", full_page=True)
    page.reload()
    page.get_by_role("heading", name="Who is where").wait_for()
    assert studio.get("/api/arena")["job"]["state"] == "done"
