"""A body of one's own, made on the page: a radius and a length changed, mirrored, undone, saved, and tracked with."""

import pytest
from playwright.sync_api import Page, expect
from scene_wire import until
from studio_page import StudioPage
from studio_server import StudioServer

from studio.sessions.stored_run import StoredRun

pytestmark = pytest.mark.browser

SETTINGS = {"layers": 2, "particles": 30, "recovery": "off", "refine_frames": False}


@pytest.fixture(scope="module")
def studio(studio: StudioServer) -> StudioServer:
    """With the sample."""
    studio.post("/api/samples", {"name": "walk"})
    return studio


def write(page: Page, label: str, value: str) -> None:
    """Type a number into a field, and leave it."""
    field = page.get_by_label(label, exact=True)
    field.fill(value)
    field.press("Tab")


def holds(page: Page, label: str, value: str) -> None:
    expect(page.get_by_label(label, exact=True)).to_have_value(value)


def test_a_body_is_edited_mirrored_undone_saved_and_tracked_with(
    window: StudioPage, studio: StudioServer
) -> None:
    page = window.page
    page.goto(f"{studio.origin}/bodies?session=walk")
    expect(page.get_by_role("heading", level=1)).to_have_text("human31")
    before = page.get_by_label("right thigh, length", exact=True).input_value()

    write(page, "left thigh, length", "450")
    write(page, "left forearm, radius, start", "55.5")
    holds(page, "left thigh, length", "450")
    expect(page.get_by_text("changed, not saved")).to_be_visible()
    holds(page, "right thigh, length", before)
    page.get_by_role("button", name="Left → right").click()
    holds(page, "right thigh, length", "450")
    holds(page, "right forearm, radius, start", "55.5")
    page.get_by_role("button", name="Undo").click()
    holds(page, "right thigh, length", before)
    page.keyboard.press("Control+y")
    holds(page, "right thigh, length", "450")

    # What is wrong is said, and changes nothing.
    window.watch.allow(422, "/api/bodies/human31/edit")
    write(page, "left shin, length", "-7")
    expect(page.get_by_role("alert").filter(has_text="left_shin_length")).to_be_visible()
    write(page, "left shin, length", "430")
    expect(page.locator(".body-form [role=alert]")).to_have_count(0)

    page.get_by_role("tab", name="Limits").click()
    write(page, "left knee, to", "5")
    holds(page, "left knee, to", "5")
    write(page, "left knee, from", "8")
    expect(page.locator(".body-form [role=alert]")).to_contain_text("left_knee_ry")
    page.get_by_role("tab", name="Markers").click()
    page.get_by_label("Name of the new marker").fill("Spot")
    page.get_by_role("button", name="Add a marker").click()
    # What is typed last is saved even where the server has not answered yet.
    page.evaluate("""() => { const now = window.fetch;
        window.fetch = (...all) => new Promise((go) => setTimeout(go, 1500)).then(() => now(...all)); }""")
    write(page, "Spot, z", "12")
    holds(page, "Spot, z", "12")

    page.get_by_role("button", name="Save…").click()
    page.get_by_label("Name", exact=True).fill("walker")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_text("walker is saved, and walk is tracked with it.").wait_for()
    expect(page.locator(".entry[aria-current]")).to_contain_text("walker")

    kept = studio.get("/api/bodies/walker?session=walk")
    sizes = {one["name"]: one for one in kept["limbs"]}
    assert sizes["right thigh"]["length"]["value"] == 450
    assert sizes["right forearm"]["radius_start"]["value"] == 55.5
    assert next(one for one in kept["markers"] if one["name"] == "Spot")["at"] == [0, 0, 12]
    assert studio.get("/api/sessions/walk")["body"]["name"] == "walker"
    studio.post("/api/sessions/walk/runs", {"name": "own", "last": 2, "settings": SETTINGS})
    studio.post("/api/sessions/walk/runs/own/start")
    studio.until(lambda state: state["state"] == "finished" and state["run"] == "own")
    assert StoredRun(studio.workspace / "walk" / "runs" / "own").record.body == "walker"


def test_a_file_of_ones_own_is_opened_and_a_broken_one_is_reported(
    window: StudioPage, studio: StudioServer
) -> None:
    page = window.page
    page.goto(f"{studio.origin}/bodies")
    page.locator(".parts").first.wait_for()
    text = studio.get("/api/bodies/mouse")["text"]
    page.click("#new")
    broken = {"name": "rat.toml", "mimeType": "application/toml", "buffer": b"title = 3"}
    window.watch.allow(422, "/api/bodies/rat/edit")
    page.get_by_label("File").set_input_files([broken])  # pyright: ignore[reportArgumentType]
    page.get_by_role("button", name="Open", exact=True).click()
    expect(page.locator("dialog [role=alert]")).to_contain_text("rat.toml")
    whole = {"name": "rat.toml", "mimeType": "application/toml", "buffer": text.encode()}
    page.get_by_label("File").set_input_files([whole])  # pyright: ignore[reportArgumentType]
    page.get_by_role("button", name="Open", exact=True).click()
    expect(page.get_by_role("heading", level=1)).to_have_text("rat")
    holds(page, "left haunch, length", "20")


def test_the_gallery_opens_a_bundled_session_at_a_click(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.goto(f"{studio.origin}/")
    page.get_by_role("navigation", name="Pages").get_by_role("link", name="Gallery").click()
    mouse = page.locator("[data-card=mouse]")
    expect(mouse).to_contain_text("sleap-anipose")
    mouse.locator("summary").click()
    expect(mouse.locator("pre")).to_contain_text("studio calibrate board")
    arm = page.get_by_role("button", name="Open A planar arm")
    arm.focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/?session=planar_arm*")
    until(page, lambda: any(one["name"] == "planar_arm" for one in studio.get("/api/sessions")["sessions"]))
    page.goto(f"{studio.origin}/gallery")
    page.locator("[data-card=planar_arm][data-state=there]").wait_for()


@pytest.mark.slow
def test_rendering_from_a_card_shows_its_progress_and_can_be_cancelled(
    window: StudioPage, studio: StudioServer
) -> None:
    page = window.page
    page.goto(f"{studio.origin}/gallery")
    card = page.locator("[data-card=box]")
    card.get_by_role("button", name="Render").click()
    card.locator("[role=status]").wait_for()
    card.get_by_role("button", name="Cancel").click()
    card.get_by_role("button", name="Render").wait_for(timeout=180_000)
    assert not (studio.workspace / "box").exists()
