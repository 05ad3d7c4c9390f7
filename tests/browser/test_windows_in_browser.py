"""Several windows of one browser, each on a session of its own: what each shows, and whose the keys are."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from scene_wire import until
from stored_clouds import drawn, stored_clouds
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import FRAMES, make_session, true_poses

pytestmark = pytest.mark.browser

QUICK = {"particles": 40, "layers": 4, "start_repeats": 1, "recovery": "off"}
SURVIVAL = {"left": 0.42, "right": 0.66}


@pytest.fixture(scope="module")
def workspace(workspace: Path) -> Path:
    """With two sessions of the toy arm."""
    for name in SURVIVAL:
        make_session(workspace / name)
    return workspace


@pytest.fixture(scope="module")
def studio(studio: StudioServer) -> StudioServer:
    """With a tracked run in each, of another survival rate and seed."""
    for seed, (name, survival) in enumerate(SURVIVAL.items()):
        wanted = {"settings": QUICK | {"survival": survival}, "start_pose": true_poses()[0].tolist()}
        studio.track(name, f"of-{name}", seed=seed, **wanted)
    return studio


def opened(
    browser: Browser, studio: StudioServer, session: str, beside: StudioPage | None = None
) -> StudioPage:
    address = f"{studio.address}&session={session}&run=of-{session}"
    window = StudioPage(browser, studio, open_at=address, beside=beside)
    window.until(f"get('run') === 'of-{session}' && get('summary')?.frames.length === {FRAMES}")
    return window


@pytest.fixture(scope="module")
def windows(browser: Browser, studio: StudioServer) -> Iterator[dict[str, StudioPage]]:
    """Two windows of one browser, both with their scene."""
    left = opened(browser, studio, "left")
    right = opened(browser, studio, "right", left)
    for window in (left, right):
        window.page.bring_to_front()
        window.see_scene()
    yield {"left": left, "right": right}
    right.close()
    left.close()


def shows_frame(window: StudioPage, frame: int) -> None:
    """Wait until page and scene show a frame of the window's own run, as it is stored."""
    window.page.bring_to_front()
    window.until(f"get('frame') === {frame}")
    clouds = stored_clouds(window, frame)
    until(window.page, lambda: drawn(window, clouds))


def shows_its_own(window: StudioPage, session: str) -> None:
    """Page, panel and knobs are of the window's session."""
    window.page.bring_to_front()
    window.scene.get_by_text(f"{session} / of-{session}").wait_for()
    assert (window.get("session"), window.get("run")) == (session, f"of-{session}")
    assert float(window.slider("survival rate").get_attribute("aria-valuenow") or "nan") == SURVIVAL[session]


def test_two_windows_show_two_sessions_at_the_same_time(
    windows: dict[str, StudioPage], artefacts: Path
) -> None:
    left, right = windows["left"], windows["right"]
    assert left.name != right.name
    for _ in range(2):
        for session, window in windows.items():
            shows_its_own(window, session)
            shows_frame(window, FRAMES - 1)
    # One goes to another frame and layer, the other stays where it is.
    left.page.bring_to_front()
    left.key("Home")
    shows_frame(left, 0)
    left.key("Shift+ArrowRight")
    until(left.page, lambda: left.wire.layers().keys() == {0})
    shows_frame(right, FRAMES - 1)
    right.key("ArrowLeft")
    shows_frame(right, FRAMES - 2)
    left.page.bring_to_front()
    assert left.wire.layers().keys() == {0}
    assert left.get("frame") == 0
    left.key("Shift+ArrowLeft")
    shows_frame(left, 0)
    # The themes are their own, too.
    right.page.bring_to_front()
    right.page.click("#theme")
    right.scene.locator("html[data-mantine-color-scheme=light]").wait_for(state="attached")
    for session, window in windows.items():
        shows_its_own(window, session)
        window.shoot(artefacts / f"window-{session}.png")
    left.scene.locator("html[data-mantine-color-scheme=dark]").wait_for(state="attached")
    right.page.bring_to_front()
    right.page.click("#theme")


def test_what_is_annealed_again_in_one_window_leaves_the_frame_of_another(
    browser: Browser, studio: StudioServer, windows: dict[str, StudioPage]
) -> None:
    left = windows["left"]
    other = StudioPage(
        browser, studio, open_at=f"{studio.address}&session=left&run=of-left", with_scene=False, beside=left
    )
    other.until("get('frame') !== null && get('detail')?.frame === get('frame')")
    other.key("End")
    other.until(f"get('frame') === {FRAMES - 1}")
    left.page.bring_to_front()
    left.key("Home")
    shows_frame(left, 0)
    left.key("r")
    left.until("get('whatIf')?.length === get('layerCount') && get('work').state !== 'reannealing'")
    assert left.get("frame") == 0
    other.until("get('work').state !== 'reannealing'")
    assert other.get("frame") == FRAMES - 1
    assert other.get("whatIf") is None
    other.close()
    left.key("ArrowRight")
    left.until("get('whatIf') === null")


def test_what_the_scene_said_before_it_knew_of_a_move_changes_nothing(
    browser: Browser, studio: StudioServer, windows: dict[str, StudioPage]
) -> None:
    left = windows["left"]
    left.context.add_init_script(
        "window.WebSocket = class extends WebSocket { constructor(...a) { super(...a); window.events = this; } };"
    )
    window = StudioPage(browser, studio, open_at=f"{studio.address}&session=left&run=of-left", beside=left)
    window.until(f"get('summary')?.frames.length === {FRAMES} && get('frame') !== null")
    wishes: list[dict[str, object]] = []
    window.page.on(
        "request",
        lambda request: wishes.append(request.post_data_json) if "scene/show" in request.url else None,
    )
    window.key("End")
    window.key("Home")
    until(window.page, lambda: wishes and wishes[-1]["frame"] == 0)
    number = int(str(wishes[-1]["request_number"]))
    said = {"type": "scene", "session": "left", "run": "of-left", "frame": FRAMES - 1, "follow": True}
    said["layers"] = studio.get("/api/scene/play-layers", window=window.name)
    for known, frame in ((number - 1, 0), (number, FRAMES - 1)):
        event = json.dumps(said | {"request_number": known})
        window.page.evaluate("event => window.events.onmessage({ data: event })", event)
        assert window.get("frame") == frame
    window.close()


@pytest.mark.slow
def test_a_window_keeps_its_name_when_it_is_loaded_again_and_a_copy_gets_another(
    browser: Browser, studio: StudioServer, windows: dict[str, StudioPage]
) -> None:
    window = StudioPage(browser, studio, with_scene=False, beside=windows["left"])
    window.watch.allowed.append("WebSocket")  # which may not be open yet when the page is left
    name = window.name
    window.page.reload()
    assert window.name == name
    window.page.goto(f"{studio.origin}/way?session=left")
    assert window.name == name
    window.page.go_back()
    assert window.name == name
    # A window that is opened by a script is given a copy of the opener's store.
    with window.context.expect_page() as coming:
        window.page.evaluate("() => { window.open('/'); }")
    copy = coming.value
    copy.wait_for_load_state()
    copied = copy.evaluate("async () => (await import('/assets/js/window.js')).windowName")
    assert copied != name
    assert window.name == name
    copy.close()
    window.close()


@pytest.mark.slow
def test_the_arrows_are_the_timeline_s_wherever_the_focus_is(windows: dict[str, StudioPage]) -> None:
    window = windows["left"]
    window.page.bring_to_front()
    window.key("Home")
    window.until("get('frame') === 0")
    frame, view = 0, window.wire.viewer
    places = [
        window.page.locator("#scene"),
        window.page.locator("[data-panel=views]"),
        window.page.locator("#theme"),
        window.page.locator("#speed"),
        window.scene.get_by_role("tab", name="Show"),
        window.scene.locator("canvas[data-engine]").first,
    ]
    for place in places:
        box = place.bounding_box()
        if place is places[2] or place is places[3]:
            place.focus()
        else:
            # By the mouse, as the focus comes there; the view is not dragged. The scene's tools are above.
            place.click(position={"x": min(20.0, box["width"] / 2), "y": 0.75 * box["height"]})
        window.page.keyboard.press("ArrowRight")
        frame += 1
        window.until(f"get('frame') === {frame}")
    window.page.keyboard.press("ArrowLeft")
    window.until(f"get('frame') === {frame - 1}")
    shows_frame(window, frame - 1)
    assert view
    assert window.wire.viewer == pytest.approx(view, abs=1e-6), "the view was not turned as well"


@pytest.mark.slow
def test_the_keyboard_passes_the_scene_by_and_enters_it_by_a_key(windows: dict[str, StudioPage]) -> None:
    window = windows["left"]
    window.page.bring_to_front()
    window.key("Home")
    active = "document.activeElement.id || document.activeElement.tagName"
    window.page.locator("#loop").focus()
    stops = []
    for _ in range(60):
        window.page.keyboard.press("Shift+Tab")
        stops.append(window.page.evaluate(active))
    assert "play" in stops
    assert "theme" in stops
    assert "scene" not in stops
    window.key("s")
    window.until("document.activeElement.id === 'scene'")
    tab = "() => document.getElementById('scene').contentDocument.activeElement.textContent"
    assert window.page.evaluate(tab) in ("Search", "Show")
    window.page.keyboard.press("Tab")
    assert window.page.evaluate("document.activeElement.id") == "scene", "its controls follow one another"
    window.page.keyboard.press("Escape")
    assert window.page.evaluate("document.activeElement.id") == "track"
    window.page.keyboard.press("ArrowRight")
    window.until("get('frame') === 1")
