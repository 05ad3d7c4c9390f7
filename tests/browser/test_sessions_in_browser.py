"""Sessions and runs in the page: the empty workspace, importing, new runs, names, copies, the trash, a studio
that is gone.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator
from scene_wire import until
from studio_page import StudioPage
from studio_server import StudioServer
from toy_source import FRAMES_PER_SECOND, make_source

pytestmark = pytest.mark.browser

FRAMES = 6


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a source in it."""
    folder = tmp_path_factory.mktemp("footage")
    make_source(folder / "arm", FRAMES)
    return folder


@pytest.fixture(scope="module")
def window(browser: Browser, studio: StudioServer) -> Iterator[StudioPage]:
    """One window for all tests of this file."""
    opened = StudioPage(browser, studio)
    # Sessions are renamed and thrown away here: scene or panel may ask for one just when its folder moves.
    opened.watch.allow(404, "/api/scene/show")
    opened.watch.allow(422, "/frames/2/views/why")
    yield opened
    opened.close()


def fill(window: StudioPage, action: str, **values: str) -> Locator:
    """Fill the open form and send it."""
    form = window.page.locator("dialog form")
    for name, value in values.items():
        form.locator(f"[name={name}]").fill(value)
    form.get_by_role("button", name=action, exact=True).click()
    return form


def session_head(window: StudioPage, name: str) -> Locator:
    return window.page.locator(f'.session > .head[data-key="{name}"]')


def session_menu(window: StudioPage, name: str, entry: str) -> None:
    session_head(window, name).hover()
    window.choose(session_head(window, name).locator(".more"), entry)


@pytest.fixture
def imported(window: StudioPage, footage: Path) -> StudioPage:
    """The window with the session "arm" open."""
    if not session_head(window, "arm").count():
        window.page.get_by_role("button", name="+ Import", exact=True).click()
        fill(window, "Import", source=str(footage / "arm"), name="arm", fps=str(FRAMES_PER_SECOND))
    session_head(window, "arm").wait_for()
    window.page.locator("dialog[open]").wait_for(state="detached")
    session_head(window, "arm").click()
    window.until("get('session') === 'arm'")
    return window


def test_an_empty_workspace_offers_the_sample(window: StudioPage, artefacts: Path) -> None:
    card = window.page.locator("#curtain .card")
    card.get_by_role("heading", name="Nothing here yet").wait_for()
    card.get_by_role("button", name="Import footage", exact=True).wait_for()
    window.shoot(artefacts / "page-empty-dark-1280x800.png")
    card.get_by_role("button", name="Open the sample", exact=True).click()
    window.until("get('session') === 'walk' && get('run') === null")
    window.page.locator("#invitation").get_by_role("button", name="New run", exact=True).wait_for()
    loaded = (
        "() => [...document.querySelectorAll('.session > .head img')].some((image) => image.naturalWidth > 0)"
    )
    window.page.wait_for_function(loaded)


def test_a_wrong_folder_is_reported_in_the_form(window: StudioPage, footage: Path, artefacts: Path) -> None:
    window.watch.allow(404, "/api/imports")
    window.page.get_by_role("button", name="+ Import", exact=True).click()
    form = fill(window, "Import", source=str(footage / "nowhere"), name="gone")
    form.locator(".wrong", has_text=f"There is no folder '{footage / 'nowhere'}'.").wait_for()
    form.get_by_text("Check the path.").wait_for()
    window.shoot(artefacts / "page-import-refused-dark-1280x800.png")
    # A folder without footage is refused while it is read, in the same place.
    (footage / "nothing").mkdir()
    fill(window, "Import", source=str(footage / "nothing"), name="gone")
    until(
        window.page,
        lambda: "nowhere" not in form.locator(".wrong").inner_text() and form.locator(".wrong").inner_text(),
    )
    form.get_by_role("button", name="Cancel", exact=True).click()
    assert [entry["name"] for entry in window.studio.get("/api/sessions")["sessions"]] == ["walk"]


def test_a_folder_is_imported_and_tracked(imported: StudioPage, artefacts: Path) -> None:
    page = imported.page
    assert imported.studio.get("/api/sessions/arm")["frame_count"] == FRAMES
    page.locator(".session.open .new-run").click()
    page.locator("dialog form [name=seed]").fill("4")
    imported.shoot(artefacts / "page-new-run-dark-1280x800.png")
    fill(imported, "Track", last="2", name="short")
    imported.until("get('run') === 'short' && get('work')?.state === 'finished'")
    imported.until("get('summary')?.frames.length === 3 && get('detail')?.frame === get('frame')")
    made = imported.studio.get("/api/sessions/arm/runs/short")["run"]
    assert (made["seed"], made["first"], made["last"], made["done"]) == (4, 0, 3, 3)
    page.locator("#state-text", has_text="finished").wait_for()
    imported.see_scene()
    until(page, lambda: len(imported.wire.layers()) == imported.get("layerCount"))


@pytest.mark.slow
def test_names_copies_and_the_trash(imported: StudioPage, artefacts: Path) -> None:
    page = imported.page
    session_menu(imported, "arm", "Rename…")
    fill(imported, "Rename", name="limb")
    imported.until("get('session') === 'limb'")
    session_head(imported, "limb").wait_for()
    assert not session_head(imported, "arm").count()

    session_menu(imported, "limb", "Duplicate")
    page.locator(".toast", has_text="limb is copied as").wait_for()
    until(page, lambda: page.locator(".session > .head").count() == 3)
    copy = next(
        entry["name"]
        for entry in imported.studio.get("/api/sessions")["sessions"]
        if entry["name"] not in ("limb", "walk")
    )
    session_menu(imported, copy, "Delete…")
    imported.shoot(artefacts / "page-delete-dark-1280x800.png")
    fill(imported, "Delete")
    session_head(imported, copy).wait_for(state="detached")
    line = page.locator("#trash-line")
    line.get_by_text("1 in the trash").wait_for()
    imported.choose(line.get_by_role("button", name="Restore…", exact=True), f"{copy} (session)")
    session_head(imported, copy).wait_for()
    imported.until(f"get('session') === '{copy}'")
    line.wait_for(state="hidden")
    session_menu(imported, "limb", "Rename…")
    fill(imported, "Rename", name="arm")
    session_head(imported, "arm").wait_for()


def test_a_run_is_renamed_and_deleted(imported: StudioPage) -> None:
    page, studio = imported.page, imported.studio
    studio.post("/api/sessions/arm/runs", {"name": "spare", "last": 2})
    row = page.locator('.run[data-key="arm/spare"]')
    assert row.locator(".figure").inner_text() == "0 of 2"
    row.click()
    imported.until("get('run') === 'spare'")
    row.hover()
    imported.choose(row.locator(".more"), "Rename…")
    fill(imported, "Rename", name="other")
    row = page.locator('.run[data-key="arm/other"]')
    row.wait_for()
    imported.until("get('run') === 'other'")
    row.hover()
    imported.choose(row.locator(".more"), "Delete…")
    fill(imported, "Delete")
    row.wait_for(state="detached")
    imported.until("get('run') !== 'other'")


@pytest.mark.slow
def test_a_studio_that_is_gone_is_said_and_the_last_state_stays(
    browser: Browser, tmp_path: Path, footage: Path, artefacts: Path
) -> None:
    studio = StudioServer("serve", tmp_path / "workspace", footage)
    studio.post("/api/samples", {"name": "walk"})
    window = StudioPage(browser, studio, with_scene=False)
    window.until("get('connected') === true && get('session') === 'walk'")
    # What it still answers while it stops may be cut off (500).
    window.page.wait_for_load_state("networkidle")
    studio.stop()
    window.until("get('connected') === false")
    window.page.locator("#curtain.banner", has_text="Disconnected").wait_for()
    assert "disconnected" in window.page.locator("#state-text").inner_text()
    assert session_head(window, "walk").is_visible()
    assert window.page.locator("#track-toggle").is_disabled()
    window.shoot(artefacts / "page-disconnected-dark-1280x800.png")
    # The server went away in the middle of whatever the page was asking for.
    window.watch.allowed += ["net::ERR_", "WebSocket", "/api/scene/show"]

    window.close()
