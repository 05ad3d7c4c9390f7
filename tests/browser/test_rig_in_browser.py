"""Where cameras should stand, as a person asks: measured, left out, moved with keys and the mouse, the best places of a
grid, found again after a reload, and all of it told to those who do not see it.
"""

from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect
from scene_wire import until
from studio_page import StudioPage
from studio_server import StudioServer

pytestmark = pytest.mark.browser

RUN = "/api/sessions/walk/runs/seen"
PAGE = "/rig?session=walk&run=seen"
FRAMES = 8
LONG = 300_000
"""Milliseconds for a run to be drawn and tracked again."""
SETTINGS = {"layers": 4, "particles": 50, "recovery": "off"}
SET = "async (changes) => (await import('/assets/js/state.js')).set(changes)"
USE_THEME = "async (name) => (await import('/assets/js/theme.js')).useTheme(name)"


@pytest.fixture(scope="module")
def studio(studio: StudioServer) -> StudioServer:
    """With the sample, tracked over some frames."""
    studio.post("/api/samples", {"name": "walk"})
    studio.track("walk", "seen", last=FRAMES, settings=SETTINGS)
    return studio


def done(studio: StudioServer) -> None:
    """The newest job has ended well."""
    job = studio.get("/api/jobs?kind=rig")["jobs"][-1]
    assert job["state"] == "done", job


def test_without_a_run_one_is_chosen(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.goto(f"{studio.origin}/rig")
    page.get_by_role("heading", name="Where should the cameras stand?").wait_for()
    page.get_by_label("Run", exact=True).select_option("walk/seen")
    page.get_by_role("button", name="Measure this rig").wait_for()
    assert "run=seen" in page.url


def test_the_rig_is_measured_and_the_job_found_again(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.goto(f"{studio.origin}/?session=walk&run=seen&frame=2")
    window.until(f"get('summary')?.frames.length === {FRAMES}")
    page.evaluate(SET, {"panel": "views", "view": "uncertainty"})
    page.get_by_role("link", name="Where should cameras stand?").click()
    page.get_by_role("button", name="Measure this rig").click()
    page.get_by_role("button", name="Cancel", exact=True).wait_for()
    page.reload()
    page.get_by_role("button", name="Cancel", exact=True).wait_for()
    page.get_by_role("heading", name="Other rigs").wait_for(timeout=LONG)
    done(studio)
    study = studio.get(f"{RUN}/rig")["study"]
    assert len(study["rigs"]) == 1
    row = page.locator("tr:has(input[name=rig])")
    assert row.count() == 1
    expect(row).to_contain_text(f"{study['rigs'][0]['tracked']:.1f}")
    assert page.locator(".rig-camera").count() == 4
    assert page.locator(".rig-body circle").count() == len(study["points"])


def test_each_camera_is_left_out(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.get_by_role("button", name="Leave each out").click()
    until(page, lambda: page.locator("input[name=rig]").count() == 5)
    expect(page.get_by_label("without cam4", exact=True)).to_be_checked()
    assert page.locator(".rig-camera.left-out").count() == 1
    page.get_by_label("without cam2", exact=True).check()
    page.get_by_role("heading", name="Expected error by joint, without cam2").wait_for()
    page.get_by_label("as it is", exact=True).check()


def test_a_camera_is_moved_with_keys_and_the_mouse_and_one_is_added(
    window: StudioPage, studio: StudioServer
) -> None:
    page = window.page
    x, y, _ = studio.get(f"{RUN}/rig")["study"]["rigs"][0]["cameras"][0]["place"]
    camera = page.get_by_role("button", name="cam1: x", exact=False)
    camera.focus()
    camera.press("ArrowRight")
    field = page.get_by_label("cam1: x, m", exact=True)
    expect(field).to_have_value(f"{(x + 100) / 1000:.2f}")
    moved = page.locator(".rig-camera.moved")
    moved.focus()
    moved.press("Shift+ArrowUp")
    expect(page.get_by_label("cam1: y, m", exact=True)).to_have_value(f"{(y + 500) / 1000:.2f}")
    # Where it stays once the page has scrolled to it.
    moved.locator("circle").hover()
    box = moved.locator("circle").bounding_box()
    assert box is not None
    before = field.input_value()
    page.mouse.down()
    page.mouse.move(box["x"] - 60, box["y"] + 10, steps=4)
    page.mouse.up()
    assert float(field.input_value()) < float(before) - 0.2
    page.get_by_role("button", name="Add a camera", exact=True).click()
    page.get_by_label("new 1: height, m", exact=True).fill("1.2")
    page.get_by_label("new 1: height, m", exact=True).press("Tab")
    page.get_by_role("button", name="Try this rig").click()
    until(page, lambda: page.locator("input[name=rig]").count() == 6)
    rig = studio.get(f"{RUN}/rig")["study"]["rigs"][-1]
    assert [one["name"] for one in rig["cameras"]] == ["cam1-moved", "cam2", "cam3", "cam4", "new1"]
    assert rig["cameras"][-1]["place"][2] == pytest.approx(1200.0)
    page.get_by_label("Put cam1 back").click()
    page.get_by_label("Put new 1 back").click()
    expect(page.get_by_role("button", name="Try this rig")).to_be_disabled()


def test_the_best_places_of_a_grid_are_shown_and_what_is_wrong_is_said(
    window: StudioPage, studio: StudioServer, artefacts: Path
) -> None:
    page = window.page
    heights = page.get_by_label("Heights, m")
    heights.fill("high")
    page.get_by_role("button", name="Find them").click()
    expect(page.locator(".wrong")).to_contain_text("A height is no number")
    heights.fill("1.2 2.4")
    page.get_by_label("Cameras", exact=True).fill("2")
    page.get_by_role("button", name="Find them").click()
    page.get_by_label("best 2 places beside the present cameras", exact=True).wait_for()
    until(page, lambda: page.locator(".rig-spot").count() > 10)
    study = studio.get(f"{RUN}/rig")["study"]
    height = float(page.get_by_label("Height of the places").input_value())
    shown = [one for one in study["places"] if one["place"][2] == height]
    assert page.locator(".rig-spot").count() == len(shown)
    chosen = [one["order"] for one in shown if one["order"]]
    assert sorted(page.locator(".rig-spot text").all_text_contents()) == sorted(map(str, chosen))
    page.evaluate(USE_THEME, "dark")
    page.screenshot(path=artefacts / "rig.png")
    page.locator(".pair").screenshot(path=artefacts / "rig-room.png")
    for theme in ("dark", "light"):
        page.evaluate(USE_THEME, theme)
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        grave = [one["help"] for one in found if one["impact"] in ("serious", "critical")]
        assert not grave, (theme, grave, [node["html"][:200] for one in found for node in one["nodes"]])
    page.set_viewport_size({"width": 390, "height": 800})
    page.wait_for_timeout(100)
    page.screenshot(path=artefacts / "rig-390.png")
    assert page.evaluate("document.querySelector('#content').scrollWidth <= innerWidth")
    page.set_viewport_size({"width": 1280, "height": 800})
    page.reload()
    page.get_by_label("as it is", exact=True).wait_for()
    assert page.locator("input[name=rig]").count() == len(study["rigs"])
