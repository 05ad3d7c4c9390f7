"""The Export panel as a person uses it: choose a format, options, export, download; what fails is said in words."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page
from store_records import store_run
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import make_session

from studio.sessions.workspace import Workspace

pytestmark = pytest.mark.browser

FRAMES = 6


@pytest.fixture(scope="module")
def workspace(workspace: Path) -> Path:
    """With one tracked run."""
    session = make_session(Workspace(workspace).place_for("toy"))
    store_run(session, "first", FRAMES)
    return workspace


@pytest.fixture(scope="module")
def window(browser: Browser, studio: StudioServer) -> Iterator[StudioPage]:
    """One window with the Export panel open."""
    opened = StudioPage(browser, studio, with_scene=False)
    opened.until("get('run') === 'first'")
    opened.page.get_by_role("tab", name="Export").click()
    opened.page.get_by_role("radio", name=".bvh").wait_for()
    yield opened
    opened.close()


def choose(page: Page, ending: str) -> None:
    page.get_by_role("radio", name=f".{ending}").click()


def export(page: Page) -> None:
    page.get_by_role("button", name="Export", exact=True).click()


def test_a_file_is_made_and_downloaded(window: StudioPage, artefacts: Path, tmp_path: Path) -> None:
    page = window.page
    choose(page, "bvh")
    assert "Blender" in page.locator(".export-form > .hint").inner_text()
    page.get_by_label("Unit", exact=True).select_option("cm")
    export(page)
    link = page.get_by_role("link", name="toy-first-cm.bvh")
    link.wait_for()
    assert "read back within" in page.locator(".export-files").inner_text()
    with page.expect_download() as caught:
        link.click()
    caught.value.save_as(tmp_path / "got.bvh")
    text = (tmp_path / "got.bvh").read_text()
    assert text.startswith("HIERARCHY")
    assert f"Frames: {FRAMES}" in text
    window.shoot(artefacts / "export-dark.png")


def test_options_belong_to_the_format(window: StudioPage) -> None:
    page = window.page
    choose(page, "csv")
    assert page.get_by_label("Angles").is_visible()
    choose(page, "glb")
    assert page.get_by_label("Angles").count() == 0
    assert page.get_by_label("Rest pose").is_visible()
    choose(page, "mp4")
    assert page.get_by_label("Camera").locator("option").all_inner_texts() == ["all cameras", "front"]


def test_what_cannot_be_exported_is_said(window: StudioPage) -> None:
    page = window.page
    choose(page, "trc")
    page.get_by_label("From frame").fill("4000")
    page.get_by_label("From frame").press("Tab")
    export(page)
    wrong = page.get_by_role("alert").filter(has_text="no frame from 4000")
    wrong.wait_for()
    assert "Choose frames that were tracked" in wrong.inner_text()
    page.get_by_label("From frame").fill("")
    page.get_by_label("From frame").press("Tab")
    page.get_by_label("Unit", exact=True).select_option("mm")
    export(page)
    page.get_by_role("link", name="toy-first-mm.trc").wait_for()


def test_a_video_and_a_recording_of_the_scene(window: StudioPage, artefacts: Path) -> None:
    page = window.page
    for ending in ("mp4", "viser", "toml"):
        choose(page, ending)
        export(page)
        page.get_by_role("link", name=f"toy-first.{ending}").wait_for()
    page.locator("#theme").click()
    page.wait_for_function("document.documentElement.dataset.theme === 'light'")
    window.shoot(artefacts / "export-light.png")
    page.set_viewport_size({"width": 720, "height": 900})
    window.shoot(artefacts / "export-narrow.png")
    page.set_viewport_size({"width": 1280, "height": 800})


def test_a_file_is_deleted_and_the_run_stays(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    row = page.locator(".export-files li").filter(has_text="toy-first.toml")
    row.get_by_role("button", name="Delete toy-first.toml").click()
    row.wait_for(state="detached")
    names = {entry["file"] for entry in studio.get("/api/sessions/toy/runs/first/exports")["exports"]}
    assert "toy-first.mp4" in names
    assert "toy-first.toml" not in names


def test_the_menu_of_a_run_leads_here(window: StudioPage) -> None:
    page = window.page
    page.get_by_role("tab", name="Log").click()
    row = page.locator('.run[data-key="toy/first"]')
    row.hover()
    window.choose(row.get_by_role("button", name="More for first"), "Export…")
    assert page.get_by_role("tab", name="Export").get_attribute("aria-selected") == "true"


def test_the_scene_page_plays_without_a_studio(window: StudioPage, browser: Browser, tmp_path: Path) -> None:
    """The page is opened from the disk: it asks nobody for anything, says nothing wrong and plays."""
    page = window.page
    choose(page, "html")
    export(page)
    link = page.get_by_role("link", name="toy-first.html")
    link.wait_for()
    with page.expect_download() as caught:
        link.click()
    caught.value.save_as(tmp_path / "scene.html")
    context = browser.new_context(viewport={"width": 420, "height": 300})
    alone = context.new_page()
    wrong: list[str] = []
    asked: list[str] = []
    alone.on("pageerror", lambda error: wrong.append(str(error)))
    alone.on("request", lambda request: asked.append(request.url))
    alone.goto((tmp_path / "scene.html").as_uri())
    alone.locator("canvas").first.wait_for()
    alone.locator("[role=slider]").first.wait_for(state="attached")
    context.close()
    assert wrong == []
    assert [url for url in asked if url.startswith(("http", "ws"))] == []
