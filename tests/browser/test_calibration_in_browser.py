"""The calibration step as a person uses it: from a board, the floor by clicks, a file that is wrong, and back again."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from board_takes import CAMERAS, FLOOR_FRAME, FLOOR_PLACE, render_takes, session_of_takes
from playwright.sync_api import Browser, Page
from studio_page import StudioPage
from studio_server import StudioServer

from studio.footage.capture.calibration_files import export_calibration
from studio.foundations.geometry.projection import project
from studio.sessions.workspace import Workspace

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Board footage of two cameras."""
    return render_takes(tmp_path_factory.mktemp("boards"))


@pytest.fixture(scope="module")
def workspace(workspace: Path, takes: Path) -> Path:
    """With a session that is not calibrated."""
    session_of_takes(Workspace(workspace).place_for("fresh"), takes)
    return workspace


@pytest.fixture(scope="module")
def footage(takes: Path) -> Path:
    """The takes may be read."""
    return takes


@pytest.fixture(scope="module")
def window(browser: Browser, studio: StudioServer) -> Iterator[StudioPage]:
    """One window on the calibration step."""
    opened = StudioPage(browser, studio, with_scene=False)
    opened.page.goto(f"{studio.origin}/way?session=fresh&step=calibration")
    opened.page.get_by_role("tab", name="From a board").wait_for()
    yield opened
    opened.close()


def pictures_loaded(page: Page) -> None:
    """Wait until every picture at the right is there."""
    for image in page.locator(".aside img:not([hidden])").all():
        image.evaluate("image => image.decode()")


def use(page: Page) -> None:
    page.get_by_role("button", name="Use this calibration").click()
    page.get_by_role("button", name="Use this calibration").wait_for(state="detached")
    page.get_by_role("tab", name="In use", selected=True).wait_for()


def test_cameras_from_a_board(window: StudioPage, studio: StudioServer, takes: Path, artefacts: Path) -> None:
    page = window.page
    page.get_by_role("tab", name="From a board").click()
    for label, value in (("Columns", 6), ("Rows", 5), ("Square mm", 120), ("Marker mm", 90)):
        page.get_by_label(label).fill(str(value))
    page.get_by_label("or on this computer").fill(str(takes))
    page.get_by_label("Board on the floor in frame").fill(str(FLOOR_FRAME))
    page.get_by_text("More", exact=True).click()
    page.get_by_role("button", name="Add a measured distance").click()
    apart = float(np.linalg.norm(CAMERAS[0].centre - CAMERAS[1].centre))
    page.get_by_label("Millimetres between their lenses").fill(f"{apart:.0f}")
    page.get_by_label("let the lenses move a little").check()
    with page.expect_request(lambda request: request.url.endswith("/calibration/solve")) as asked:
        page.get_by_role("button", name="Calibrate", exact=True).click()
    sent = asked.value.post_data_json
    names = [camera.name for camera in CAMERAS]
    assert sent["distances"] == [{"first": names[0], "second": names[1], "mm": round(apart)}]
    assert sent["refine_lenses"] is True
    page.get_by_role("button", name="Use this calibration").wait_for()
    assert page.locator(".rig polygon").count() == 2
    assert page.locator(".residuals rect").count() >= 20
    pictures_loaded(page)
    window.shoot(artefacts / "calibration-proposed-dark.png")
    use(page)
    for camera, found in zip(CAMERAS, studio_cameras(studio), strict=True):
        np.testing.assert_allclose(found["position"], camera.centre - [*FLOOR_PLACE, 0.0], atol=25.0)
    assert page.locator('.stepper [data-step="calibration"]').count() == 1


def studio_cameras(studio: StudioServer) -> list[dict]:
    return studio.get("/api/sessions/fresh/calibration")["present"]["cameras"]


def test_the_floor_is_clicked(window: StudioPage, studio: StudioServer, artefacts: Path) -> None:
    """Four points of a table 400 mm high are clicked: the cameras then stand that much lower."""
    page = window.page
    before = {camera["name"]: camera["position"][2] for camera in studio_cameras(studio)}
    page.get_by_role("button", name="Set the floor by clicks").click()
    corner = np.array([*FLOOR_PLACE, 400.0])
    table = corner + np.array([[0.0, 0.0, 0.0], [900.0, 0.0, 0.0], [900.0, 800.0, 0.0], [0.0, 800.0, 0.0]])
    for number, point in enumerate(table):
        page.locator(".point-list button").nth(number).click()
        for index, camera in enumerate(CAMERAS):
            image = page.locator(".clickable img").nth(index)
            image.evaluate("image => image.decode()")  # before it is there it has no size to click in
            image.scroll_into_view_if_needed()
            box = image.bounding_box()
            pixel = (project(camera, point[None])[0][0] + 0.5) / [camera.width, camera.height]
            image.click(position={"x": pixel[0] * box["width"], "y": pixel[1] * box["height"]}, force=True)
    window.shoot(artefacts / "calibration-clicks-dark.png")
    page.get_by_role("button", name="Set the floor", exact=True).click()
    page.get_by_role("button", name="Use this calibration").wait_for()
    pictures_loaded(page)
    window.shoot(artefacts / "calibration-floor-dark.png")
    use(page)
    for camera in studio_cameras(studio):
        assert before[camera["name"]] - camera["position"][2] == pytest.approx(400.0, abs=30.0)
    assert len(studio.get("/api/sessions/fresh/calibration")["earlier"]) == 1


def test_a_file_that_is_wrong_is_said_and_put_right(
    window: StudioPage, studio: StudioServer, tmp_path: Path, artefacts: Path
) -> None:
    page = window.page
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    place = tmp_path / "Calib_y_up.toml"
    export_calibration(
        tuple(dataclasses.replace(camera, rotation=camera.rotation @ turn.T) for camera in CAMERAS),
        place,
        "pose2sim",
    )
    page.get_by_role("tab", name="From a file").click()
    page.get_by_label("Upload").set_input_files(place)
    page.get_by_role("button", name="Read the file").click()
    wrong = page.locator('.findings [data-code="up-axis"]')
    wrong.wait_for()
    assert "Y axis points up" in wrong.inner_text()
    assert page.get_by_role("button", name="Use this calibration").is_disabled()
    page.locator("#theme").click()
    page.locator('html[data-theme="light"]').wait_for()
    window.shoot(artefacts / "calibration-wrong-light.png")
    page.get_by_label("Points up").select_option("y")
    wrong.wait_for(state="detached")
    use(page)
    for camera, found in zip(CAMERAS, studio_cameras(studio), strict=True):
        np.testing.assert_allclose(found["position"], camera.centre, atol=0.01)
    pictures_loaded(page)
    window.shoot(artefacts / "calibration-used-light.png")


def test_what_was_used_before_comes_back_and_goes_out(window: StudioPage, tmp_path: Path) -> None:
    page = window.page
    page.get_by_role("button", name="Preview").click()
    page.get_by_role("button", name="Use this calibration").wait_for()
    page.get_by_role("button", name="Discard").click()
    with page.expect_download() as caught:
        page.get_by_role("button", name="Download", exact=True).click()
    caught.value.save_as(tmp_path / "got.toml")
    assert caught.value.suggested_filename == "Calib_fresh.toml"
    assert "[metadata]" in (tmp_path / "got.toml").read_text()
