"""The layers of a frame on the page: slow motion, a search in progress, the strip of tiles that plays them."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import FRAMES, make_session, true_poses

pytestmark = pytest.mark.browser

RUNS = "/api/sessions/toy/runs"
LAYERS = 4
QUICK = {"particles": 40, "layers": LAYERS, "start_repeats": 2, "recovery": "off"}
TILES = "#layer-tiles .layer-tile"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("serve") / "workspace"
    make_session(place / "toy")
    return place


@pytest.fixture(scope="module")
def window(browser: Browser, studio: StudioServer) -> Iterator[StudioPage]:
    """One window on the session before it has a run; the tests go on from one another."""
    opened = StudioPage(browser, studio, open_at=f"{studio.address}&session=toy", with_scene=False)
    yield opened
    opened.close()


def begun(window: StudioPage, studio: StudioServer) -> None:
    """Make a run whose first frame is searched twice, and open it."""
    studio.post(RUNS, {"name": "one", "start_pose": true_poses()[0].tolist(), "settings": QUICK})
    window.page.goto(f"{studio.origin}/?session=toy&run=one&panel=why")
    window.until("get('run') === 'one' && get('connected') && get('summary') !== null")


def test_slow_motion_is_offered_before_anything_is_tracked(window: StudioPage) -> None:
    speed = window.page.get_by_label("Search speed")
    expect(speed.locator("option")).to_have_text(["full speed", "10 layers/s", "3 layers/s", "1 layer/s"])
    expect(speed).to_be_enabled()


def test_the_first_frame_shows_the_layers_that_there_are(
    window: StudioPage, studio: StudioServer, page: Page
) -> None:
    begun(window, studio)
    page.get_by_label("Search speed").select_option(label="1 layer/s")
    window.until("get('work').seconds_a_layer === 1")
    page.click("#track-toggle")
    window.until("get('detail')?.layers.length >= 2 && get('detail').finished === false")
    # All its tiles are there from the first layer on, under the names of its searches.
    expect(page.locator(TILES)).to_have_count(2 * LAYERS)
    names = page.locator(".layer-search").evaluate_all("all => all.map((one) => one.dataset.name)")
    assert names == ["first search", "second search"]
    # The panel that is open by itself shows what these layers did.
    expect(page.locator("#panel-why .figure-body")).to_have_attribute(
        "data-drawn", re.compile("^toy-one-frame0-variance ")
    )
    page.click("#track-toggle")
    window.until("get('work').state === 'paused' && get('work').layer > 0")

    # They are found again after a reload, though no frame is finished.
    page.reload()
    window.until("get('summary') && get('detail')?.frame === 0 && get('detail').layers.length > 0")
    assert window.get("summary")["frames"] == []  # pyright: ignore[reportIndexIssue]
    done = len(window.get("detail")["layers"])  # pyright: ignore[reportIndexIssue]
    expect(page.locator(f"{TILES}:not(.to-come)")).to_have_count(done)
    expect(page.locator(TILES)).to_have_count(2 * LAYERS)
    expect(page.locator("#panel-why .figure-chart canvas").first).to_be_visible()


def test_layers_are_played_stepped_and_left(
    browser: Browser, window: StudioPage, studio: StudioServer, page: Page
) -> None:
    studio.pace(0.0)
    page.click("#track-toggle")
    window.until(f"get('work').state === 'finished' && get('summary')?.frames.length === {FRAMES}")
    window.key("Home")
    window.until("get('frame') === 0 && get('detail')?.frame === 0 && get('detail').finished")
    words = page.locator("#layer-label span")
    page.get_by_label("Layers a second").select_option(label="10/s")
    window.key("Shift+Space")
    button = page.locator("#play-layers")
    expect(button).to_have_attribute("aria-label", "Pause layers")
    # All layers of both searches come, and the first one again.
    window.until("get('layer') === 2")
    window.until(f"get('layer') === {2 * LAYERS - 1}")
    expect(words).to_have_text(f"layer {LAYERS} of {LAYERS}, second search")
    window.until("get('layer') === 0")
    # So they do in a window that the copied link opens, and after a reload.
    assert "plays=layers" in page.url
    beside = StudioPage(browser, studio, open_at=page.url, with_scene=False, beside=window)
    beside.until("get('plays') === 'layers' && get('layer') === 3")
    beside.until("get('layer') === 1")
    beside.close()
    page.reload()
    window.until("get('plays') === 'layers' && get('layer') === 3")
    window.until("get('layer') === 1")
    # The space bar pauses what plays, and the frames stay where they are.
    window.key(" ")
    expect(button).to_have_attribute("aria-label", "Play layers")
    expect(page.locator("#play")).to_have_attribute("aria-label", "Play")
    assert window.get("frame") == 0
    window.key("Shift+Space")
    window.until("get('plays') === 'layers'")
    # A drag scrubs, and what plays stops.
    box = page.locator(TILES).nth(LAYERS).bounding_box()
    assert box
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    window.until(f"get('layer') === {LAYERS}")
    expect(button).to_have_attribute("aria-label", "Play layers")
    expect(words).to_have_text(f"layer 1 of {LAYERS}, second search")
    window.key("Shift+ArrowLeft")
    window.until(f"get('layer') === {LAYERS - 1}")
    strip = page.get_by_role("slider", name="Layer")
    expect(strip).to_have_attribute("aria-valuenow", str(LAYERS))
    strip.focus()
    page.keyboard.press("Home")
    window.until("get('layer') === 0")
    page.keyboard.press("Escape")
    window.until("get('layer') === null")
    expect(words).to_have_text("all layers")


def test_a_what_if_is_kept_as_a_run_of_its_own(window: StudioPage, studio: StudioServer, page: Page) -> None:
    before = studio.text(f"{RUNS}/one/poses.csv")
    studio.patch(f"{RUNS}/one/settings?frame=5", {"survival": 0.8})
    window.key("End")
    window.page.evaluate("async () => (await import('/assets/js/selection.js')).select({ frame: 5 })")
    window.until("get('frame') === 5 && get('work').state === 'finished'")
    window.key("r")
    window.until(f"get('whatIf')?.length === {LAYERS} && get('work').state === 'finished'")
    page.get_by_role("button", name="Keep as a new run", exact=True).click()
    window.until(f"get('run') !== 'one' && get('summary')?.frames.length === {FRAMES}")
    made = str(window.get("run"))
    after = studio.text(f"{RUNS}/{made}/poses.csv").splitlines()
    assert after[:6] == before.splitlines()[:6]
    assert after[6:] != before.splitlines()[6:]
    assert studio.get(f"{RUNS}/{made}/frames/5")["layers"][0]["alpha_wanted"] == 0.8
    # Nothing of the run that was shown is lost.
    assert studio.text(f"{RUNS}/one/poses.csv") == before
