"""The guided set-up's Background and Subject steps as a person uses them, on a rendered person seen by four cameras."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page, expect
from sized_sessions import make_sized_session
from studio_server import StudioServer

from studio.sessions.workspace import Workspace

pytestmark = [pytest.mark.browser, pytest.mark.slow]

PATIENCE = 240_000


@pytest.fixture(scope="module")
def workspace(workspace: Path) -> Path:
    """With one person in it."""
    make_sized_session(Workspace(workspace).place_for("person"), 21)
    return workspace


def step(page: Page, studio: StudioServer, name: str) -> None:
    page.goto(f"{studio.origin}/way?session=person&step={name}")


def shoot(page: Page, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    page.wait_for_timeout(300)
    page.screenshot(path=path)


def all_masks_are_there(page: Page) -> None:
    page.wait_for_function(
        "() => { const all = [...document.querySelectorAll('.masks .picture')];"
        " return all.length === 4 && all.every((box) => !box.classList.contains('waiting')"
        " && box.querySelector('img').naturalWidth > 0); }"
    )


def test_masks_follow_a_slider_and_are_kept(page: Page, studio: StudioServer, artefacts: Path) -> None:
    step(page, studio, "background")
    all_masks_are_there(page)
    shoot(page, artefacts / "setup-background-begin.png")
    page.get_by_text("Fine adjustment").click()
    slider = page.get_by_role("slider", name="mask threshold")
    with page.expect_request(lambda request: "mask_threshold" in request.url):
        slider.fill("12")
    all_masks_are_there(page)
    assert studio.get("/api/sessions/person/evidence")["knobs"] == {}
    page.get_by_role("button", name="Keep", exact=True).click()
    expect(page.locator(".knob.changed")).to_have_count(0)
    assert studio.get("/api/sessions/person/evidence")["knobs"] == {"mask_threshold": 12}
    studio.put("/api/sessions/person/evidence", {})


def test_the_background_is_set_up_and_the_views_agree(
    page: Page, studio: StudioServer, artefacts: Path
) -> None:
    step(page, studio, "background")
    page.get_by_role("radio", name="Picture A picture of").check()
    page.get_by_label("tune the knobs for the best agreement of the views").uncheck()
    page.get_by_role("button", name="Set up the background").click()
    page.get_by_role("button", name="Cancel").wait_for()
    expect(page.locator(".agree li")).to_have_count(4)
    response = studio.get("/api/sessions/person/background")
    assert response["source"] == "plate"
    assert response["job"]["state"] == "done"
    assert all(line["agreement"] > 0.8 for line in response["job"]["quality"]["cameras"])
    all_masks_are_there(page)
    shoot(page, artefacts / "setup-background-dark.png")
    page.locator("#theme").click()
    shoot(page, artefacts / "setup-background-light.png")
    page.locator("#theme").click()


def test_a_thing_in_front_is_painted_and_seen_in_the_masks(
    page: Page, studio: StudioServer, artefacts: Path
) -> None:
    step(page, studio, "background")
    camera = studio.get("/api/sessions/person/background")["cameras"][0]
    expect(page.get_by_label("look for things that stand in front of the subject")).to_be_checked()
    button = page.get_by_role("button", name=f"Paint things in front in {camera['name']}", exact=True)
    button.click()
    canvas = page.locator(".brush-canvas")
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 0.2 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 0.7 * box["height"], steps=4)
    page.mouse.up()
    shoot(page, artefacts / "setup-in-front-brush.png")
    page.get_by_role("button", name="Keep", exact=True).first.click()
    expect(page.get_by_text("in front: painted")).to_be_visible()
    all_masks_are_there(page)
    shoot(page, artefacts / "setup-in-front.png")
    kept = studio.workspace / "person" / "in_front" / f"{camera['name']}.png"
    painted = cv2.imread(str(kept), cv2.IMREAD_GRAYSCALE)
    assert painted[round(0.5 * camera["height"]), round(0.7 * camera["width"])] == 255
    button.click()
    page.locator(".brush-canvas").wait_for()
    page.get_by_role("button", name="Clear all").click()
    page.get_by_role("button", name="Keep", exact=True).first.click()
    page.locator(".masks .picture").first.wait_for()
    expect(page.get_by_text("in front: painted")).to_be_hidden()
    assert not kept.exists()


def test_a_region_is_painted_by_mouse_and_keyboard(page: Page, studio: StudioServer, artefacts: Path) -> None:
    step(page, studio, "background")
    camera = studio.get("/api/sessions/person/background")["cameras"][0]
    page.get_by_role("button", name=f"Exclude regions of {camera['name']}", exact=True).click()
    canvas = page.locator(".brush-canvas")
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 0.1 * box["width"], box["y"] + 0.1 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.1 * box["height"], steps=4)
    page.mouse.up()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.up()
    page.get_by_role("button", name="Undo").click()
    shoot(page, artefacts / "setup-brush.png")
    canvas.focus()
    page.keyboard.press("Enter")
    page.locator(".masks .picture").first.wait_for()
    kept = studio.workspace / "person" / "exclusions" / f"{camera['name']}.png"
    painted = cv2.imread(str(kept), cv2.IMREAD_GRAYSCALE)
    height, width = camera["height"], camera["width"]
    assert painted.shape == (height, width)
    assert painted[round(0.1 * height), round(0.2 * width)] == 255
    assert painted[round(0.5 * height), round(0.6 * width)] == 0
    before = np.count_nonzero(painted)
    page.get_by_role("button", name=f"Exclude regions of {camera['name']}", exact=True).click()
    page.locator(".brush-canvas").wait_for()
    assert page.evaluate(
        "() => { const c = document.querySelector('.brush-canvas');"
        " return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v); }"
    ), "what was kept is there before the first stroke"
    page.locator(".brush-canvas").focus()
    page.keyboard.down(" ")
    for _ in range(4):
        page.keyboard.press("ArrowDown")
    page.keyboard.up(" ")
    page.keyboard.press("Enter")
    page.locator(".masks .picture").first.wait_for()
    assert np.count_nonzero(cv2.imread(str(kept), cv2.IMREAD_GRAYSCALE)) > before
    page.get_by_role("button", name=f"Exclude regions of {camera['name']}", exact=True).click()
    page.locator(".brush-canvas").wait_for()
    page.get_by_role("button", name="Clear all").click()
    page.get_by_role("button", name="Keep", exact=True).first.click()
    page.locator(".masks .picture").first.wait_for()
    assert not kept.exists()


def test_a_height_becomes_a_body_and_the_body_is_fitted(
    page: Page, studio: StudioServer, artefacts: Path
) -> None:
    step(page, studio, "subject")
    height = page.get_by_label("Height in centimetres")
    for typed in ("178", "1.78", "1780"):
        height.fill(typed)
        height.press("Tab")
        expect(height).to_have_value("178")
    expect(page.locator(".stature")).to_contain_text("436 mm")
    page.get_by_role("button", name="Set the height").click()
    begin = page.get_by_role("button", name="Fit the subject")
    expect(begin).to_be_enabled()
    assert studio.get("/api/sessions/person/subject")["height_mm"] == 1780
    shoot(page, artefacts / "setup-subject-height.png")
    page.get_by_label("or these frames").fill("1")
    page.get_by_label("or these frames").press("Tab")
    begin.click()
    page.get_by_role("button", name="Cancel").wait_for()
    save = page.get_by_role("button", name="Save as the subject")
    save.wait_for()
    page.wait_for_function("() => document.querySelector('.fitted img').naturalWidth > 0")
    shoot(page, artefacts / "setup-subject-fitted.png")
    save.click()
    expect(page.get_by_text("The old subject is kept")).to_be_visible()
    response = studio.get("/api/sessions/person/subject")
    assert response["fitted"]
    rows = page.locator(".sizes tr").filter(has_text="thigh")
    assert f"{response['dimensions']['left_thigh_length']:.0f}" in rows.first.inner_text()
    page.locator("#theme").click()
    shoot(page, artefacts / "setup-subject-light.png")
