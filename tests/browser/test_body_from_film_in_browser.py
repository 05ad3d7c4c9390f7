"""Landmarks are clicked in the guided set-up, kept as they are clicked; a body is made of them, and a run."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from filmed_bodies import cameras_around, clicks_on, varied_poses, write_session
from playwright.sync_api import Page, expect
from studio_page import StudioPage
from studio_server import StudioServer

from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions

pytestmark = pytest.mark.browser

BODY = with_dimensions(load_body("planar_arm4"), {"link_2_length": 380.0})
JOINTS = ("Root", "Joint1", "Joint2", "Joint3", "Tip")
CAMERAS, POSES = cameras_around(2500.0, 900.0, 600.0, 2), varied_poses(BODY, 3)
CLICKS = clicks_on(BODY, JOINTS, POSES, CAMERAS, 0.0)
PATH = "/api/sessions/arm/landmarks"


@pytest.fixture(scope="module")
def workspace(workspace: Path) -> Path:
    """With an arm whose second link is longer than the body's."""
    write_session(workspace / "arm", BODY, POSES, CAMERAS, masks=True)
    return workspace


def click(page: Page, landmark: str, camera: str) -> None:
    """Click a landmark of frame 0 where it is."""
    page.locator(".point-list button").nth(JOINTS.index(landmark)).click()
    [where] = [one for one in CLICKS if (one.frame, one.camera, one.landmark) == (0, camera, landmark)]
    image = page.get_by_alt_text(f"Picture of {camera}")
    image.evaluate("image => image.decode()")
    image.scroll_into_view_if_needed()
    box = image.bounding_box()
    assert box is not None
    place = (np.array([where.x, where.y]) + 0.5) / [640, 480] * [box["width"], box["height"]]
    image.click(position={"x": place[0], "y": place[1]}, force=True)


def test_a_body_is_made_of_clicks_that_a_reload_finds(
    window: StudioPage, studio: StudioServer, artefacts: Path
) -> None:
    page = window.page
    studio.put(PATH, {"clicks": [asdict(one) for one in CLICKS if one.frame]})
    page.goto(f"{studio.origin}/way?session=arm&step=subject")
    page.get_by_text("20 clicks in 2 frames").wait_for()
    page.get_by_role("button", name="Click landmarks").click()
    for landmark in JOINTS:
        for camera in CAMERAS:
            click(page, landmark, camera.name)
    page.get_by_text("30 clicks in 3 frames").wait_for()
    page.get_by_role("button", name="Remove Tip").click()
    page.get_by_text("28 clicks in 3 frames").wait_for()
    for camera in CAMERAS:
        click(page, "Tip", camera.name)
    expect(page.locator(".mark")).to_have_count(10)
    page.locator(".point-list button").first.scroll_into_view_if_needed()
    window.shoot(artefacts / "landmarks-clicked-dark.png")
    page.get_by_label("Frame to click in").fill("2")
    expect(page.locator("output", has_text="frame 2")).to_be_visible()
    expect(page.locator(".mark")).to_have_count(10)
    page.get_by_label("View to click in").select_option("cam2")
    expect(page.locator(".mark")).to_have_count(5)
    page.reload()
    page.get_by_text("30 clicks in 3 frames").wait_for()
    kept = studio.get(PATH)["clicks"]
    where = {(one["frame"], one["camera"], one["landmark"]): (one["x"], one["y"]) for one in kept}
    for one in CLICKS:
        assert where[one.frame, one.camera, one.landmark] == pytest.approx((one.x, one.y), abs=1.5)
    page.get_by_label("Name of the body").fill("long-arm")
    page.get_by_role("button", name="Make the body").click()
    page.get_by_role("link", name="long-arm").wait_for()
    row = page.locator("table.sizes tr", has_text="link 2 length")
    assert float(row.locator("td").nth(1).inner_text()) == 250.0
    assert float(row.locator("td").nth(2).inner_text()) == pytest.approx(380.0, rel=0.03)
    row.scroll_into_view_if_needed()
    window.shoot(artefacts / "body-from-film-dark.png")
    page.get_by_role("button", name="Make a run of the clicks").click()
    page.get_by_role("link", name="run-1").wait_for()
    record = studio.get("/api/sessions/arm/runs/run-1")
    assert (record["run"]["body"], record["run"]["done"]) == ("long-arm", 3)
    window.shoot(artefacts / "run-of-clicks-dark.png")
    page.reload()
    page.get_by_role("link", name="run-1").wait_for()
    page.get_by_role("link", name="long-arm").click()
    page.get_by_role("heading", name="long-arm").wait_for()
