"""Strokes painted on a camera's picture in Chromium: the mask follows, undo, another frame, kept, all masks made."""

import re
from pathlib import Path

import numpy as np
import pytest
from patched_ball import SIZE, PatchedBall, patched_ball
from playwright.sync_api import Page, Route, expect
from rendered_people import overlap
from scene_wire import until
from studio_server import StudioServer

from studio.sessions.session import Session
from studio.sessions.stroke_files import read_strokes
from studio.sessions.workspace import Workspace

pytestmark = [pytest.mark.browser, pytest.mark.slow]

PATIENCE = 240_000


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> PatchedBall:
    return patched_ball(Workspace(tmp_path_factory.mktemp("strokes") / "workspace").place_for("ball"))


@pytest.fixture(scope="module")
def workspace(ball: PatchedBall) -> Path:
    """Where the ball is."""
    return ball.session.path.parent


def paint(page: Page, points: tuple[tuple[float, float], ...]) -> None:
    """A stroke with the mouse, points in pixels of the picture."""
    box = page.locator(".strokes-canvas").bounding_box()
    scale = box["width"] / SIZE[0]
    places = [(box["x"] + scale * (x + 0.5), box["y"] + scale * (y + 0.5)) for x, y in points]
    page.mouse.move(*places[0])
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(*place, steps=3)
    page.mouse.up()


def shown_mask(page: Page) -> np.ndarray:
    """(H, W) bool: the mask that lies over the picture."""
    expect(page.locator(".strokes-mask")).to_be_visible()
    expect(page.locator(".brush-sheet.waiting")).to_have_count(0)
    opacity = page.evaluate(
        "async () => { const shown = document.querySelector('.strokes-mask'); await shown.decode();"
        " const canvas = document.createElement('canvas');"
        " [canvas.width, canvas.height] = [shown.naturalWidth, shown.naturalHeight];"
        " const context = canvas.getContext('2d'); context.drawImage(shown, 0, 0);"
        " const { data } = context.getImageData(0, 0, canvas.width, canvas.height);"
        " return [...data].filter((_, index) => index % 4 === 3); }"
    )
    return np.array(opacity).reshape(SIZE[::-1]) > 0


def test_strokes_are_painted_and_all_masks_are_made(
    page: Page, studio: StudioServer, ball: PatchedBall, artefacts: Path
) -> None:
    page.goto(f"{studio.origin}/way?session=ball&step=background")
    page.get_by_role("radio", name="Strokes Anything").check()
    make = page.get_by_role("button", name="Set up the background")
    expect(make).to_be_disabled()
    for name in ("cam0", "cam1", "cam2"):
        page.get_by_role("button", name=f"Paint on {name}").click()
        page.locator(".strokes-canvas").wait_for()
        frames = page.locator(".strokes-frames").get_by_role("slider", name="Frame")
        frames.fill("2")
        inside, outside = (stroke.points for stroke in ball.strokes(2, name))
        paint(page, inside)
        first = shown_mask(page)
        assert overlap(first, ball.masks[name, 2]) > 0.3
        page.get_by_role("button", name="Outside").click()
        paint(page, inside)
        page.get_by_role("button", name="Undo").click()
        page.keyboard.press("x")
        page.get_by_role("button", name="Outside").click()
        paint(page, outside)
        assert overlap(shown_mask(page), ball.masks[name, 2]) > 0.9
        if name == "cam1":
            page.screenshot(path=artefacts / "setup-strokes.png")
        page.get_by_role("button", name="Keep", exact=True).first.click()
        page.locator(".masks .picture").first.wait_for()
    expect(page.get_by_text("2 strokes in 1 frame")).to_have_count(3)
    kept = read_strokes(ball.session)
    assert [(one.camera, one.frame, one.kind) for one in kept] == [
        (name, 2, kind) for name in ("cam0", "cam1", "cam2") for kind in ("inside", "outside")
    ]
    np.testing.assert_allclose(kept[0].points[0], ball.strokes(2, "cam0")[0].points[0], atol=1.0)
    make.click()
    page.get_by_role("button", name="Cancel").wait_for()
    expect(page.locator(".agree li")).to_have_count(3)
    expect(page.get_by_text("masks made")).to_have_count(3)
    page.screenshot(path=artefacts / "setup-strokes-made.png")
    footage = Session(ball.session.path).footage()
    for key, true in ball.masks.items():
        mask = footage.mask(*key)
        assert mask is not None
        assert overlap(mask, true) > 0.9
    footage.close()


def test_thresholds_follow_their_sliders(page: Page, studio: StudioServer) -> None:
    page.goto(f"{studio.origin}/way?session=ball&step=background")
    with page.expect_request(lambda request: "threshold" in request.url and "views" in request.url):
        page.get_by_role("radio", name="Brightness and colour").check()
    page.get_by_text("Fine adjustment").click()
    slider = page.get_by_role("slider", name="darkest of the subject")
    with page.expect_request(lambda request: "mask_darkest" in request.url):
        slider.fill("90")
    assert studio.get("/api/sessions/ball/background")["source"] == "strokes"


def test_a_picture_that_is_loaded_says_so(page: Page, studio: StudioServer) -> None:
    page.goto(f"{studio.origin}/way?session=ball&step=background")
    held: list[Route] = []
    page.get_by_role("button", name="Paint strokes of cam0").wait_for()
    page.route(re.compile(r"/footage/cam0/\d+\.jpg\?height=\d+$"), lambda route: held.append(route))
    page.get_by_role("button", name="Paint strokes of cam0").click()
    words = page.locator(".brush-words")
    expect(words).to_have_text("loading the picture…")
    until(page, lambda: bool(held))
    for route in held:
        route.continue_()
    expect(words).to_have_text("")
    assert page.locator(".brush-photo").first.evaluate("image => image.naturalWidth") > 0
    page.unroute_all()
    page.get_by_role("button", name="Leave").click()


def test_the_masks_of_another_source_than_the_chosen_one_are_named(page: Page, studio: StudioServer) -> None:
    page.goto(f"{studio.origin}/way?session=ball&step=background")
    words = page.locator(".masks-in-use")
    known = studio.get("/api/sessions/ball/background")
    used = next(one["label"] for one in known["sources"] if one["name"] == known["source"])
    other = "Combined" if used == "Median" else "Median"
    page.get_by_role("radio", name=used).check()
    expect(words).to_have_count(0)
    page.get_by_role("radio", name=other).check()
    expect(words).to_have_text(
        f"Masks in use: {used}. {other} follows when you press “Set up the background”."
    )
    page.get_by_role("checkbox", name="picture alone").check()
    expect(words).to_have_count(0)
