"""`studio demo` and a browser at the printed address: the first two minutes; then a run that is tracked in it, with the
scene, the slider, the keys, the cameras, the guide.
"""

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, expect
from scene_wire import until
from stored_clouds import differing, drawn, run_path, stored_clouds
from studio_page import StudioPage
from studio_server import StudioServer

from studio.app.scene.particle_view import glowing
from studio.app.scene.viewpoint import WELL_FRAMED, on_screen
from studio.body.forward_kinematics import limb_ends
from studio.body.model import extremities
from studio.runs.drawing.colour_tokens import colour_tokens
from studio.search.settings import knob_table
from studio.sessions.workspace import Workspace

pytestmark = pytest.mark.browser

RUN = "/api/sessions/walk/runs/run-1"
FRAMES_BEFORE = 6
# Seconds a layer while the search goes on: a frame a second, so that a page drawn in software can follow it.
PACE = 0.1
LATER_MILLISECONDS = 2500
"""Longer than the page waits before it asks anew for what is stored."""
PANELS = ("why", "views", "cameras", "log")
SIZES = ((1280, 800), (1920, 1080))


@pytest.fixture(scope="module")
def window(browser: Browser, demo: StudioServer) -> Iterator[StudioPage]:
    """One window for all tests of this file but the first, on a run that is begun in the demo, slowed and held up here,
    and tracked on in the window.
    """
    # The steps stay beside any run of this session; without them the scene has room for its knobs.
    demo.patch("/api/preferences", {"first-steps": "closed"})
    demo.post("/api/sessions/walk/runs", {"name": "run-1"})
    demo.post(f"{RUN}/start")
    demo.pace(PACE)
    demo.until(lambda state: state["done"] >= FRAMES_BEFORE)
    demo.post(f"{RUN}/pause")
    demo.until(lambda state: state["state"] == "paused")
    place = f"{demo.origin}/?token={demo.token}&session=walk&run=run-1"
    opened = StudioPage(browser, demo, open_at=place)
    opened.see_scene()
    yield opened
    opened.close()


@pytest.mark.parametrize(
    ("with_scene", "survival"), [(False, "0.80"), pytest.param(True, "0.65", marks=pytest.mark.slow)]
)
def test_the_first_two_minutes(
    browser: Browser, demo: StudioServer, artefacts: Path, with_scene: bool, survival: str
) -> None:
    """From the printed address without a click: layers play; then step by step, until the steps are closed for good.
    With the scene drawn in software it takes minutes, and pictures of all of it are kept.
    """
    demo.patch("/api/preferences", {"first-steps": None})
    window = StudioPage(browser, demo, with_scene=with_scene)
    page = window.page

    def keep(name: str) -> None:
        if with_scene:
            window.shoot(artefacts / f"first-steps-{name}.png")

    until(page, lambda: demo.get("/api/scene/play-layers", window=window.name)["playing"])
    seen: set[object] = set()
    until(page, lambda: seen.add(window.get("layer")) or {0, 4, 9} <= seen)
    assert (window.get("run"), window.get("frame"), window.get("view")) == ("ten-layers", 10, "variance")
    until(page, window.charts_drawn)
    keep("1")

    # The survival rate, in the strip: the frame is searched again, and the schedule has other numbers.
    page.get_by_role("button", name="Next", exact=True).click()
    window.until("get('view') === 'schedule'")
    until(page, window.charts_drawn)
    before = window.chart("views")
    slider = page.locator(".first-knob input:enabled")
    slider.wait_for()
    slider.fill(survival)
    window.until("get('whatIf')?.length === 10")
    until(page, lambda: window.charts_drawn() and window.chart("views") != before)
    assert page.locator(".first-knob output").inner_text() == survival
    keep("2")

    # One layer has lost the walker where ten hold him, with as many evaluations.
    page.get_by_role("button", name="Next", exact=True).click()
    window.until("get('run') === 'one-layer' && get('compared') === 'walk/ten-layers' && get('frame') === 13")
    page.get_by_role("button", name="ten layers", exact=True).click()
    window.until("get('run') === 'ten-layers' && get('compared') === 'walk/one-layer'")
    keep("3")

    # The course beside the scene: scrolling drives it, and a number in a sentence is a knob.
    page.get_by_role("button", name="Next", exact=True).click()
    page.get_by_role("button", name="The course, beside the scene", exact=True).click()
    window.until("get('session') === 'planar_arm' && get('run') === 'arm' && get('view') === 'clouds'")
    lesson = page.get_by_role("region", name="Lesson")
    views = set[object]()
    told = {"schedule", "variance", "genealogy"}
    for _ in range(40):
        if told <= views:
            break
        lesson.evaluate("place => place.scrollBy(0, 120)")
        page.wait_for_timeout(300)
        views.add(window.get("view"))
    assert told <= views
    knob = page.get_by_role("slider", name="survival", exact=True).first
    knob.scroll_into_view_if_needed()
    knob.focus()
    knob.press("PageUp")
    window.until("get('whatIf')?.length > 0")
    keep("course")
    page.get_by_role("button", name="Close the course", exact=True).click()

    page.goto(demo.origin + "/?session=walk&run=ten-layers&frame=10")
    page.get_by_role("button", name="Close the first steps for good", exact=True).click()
    page.locator(".first-steps").wait_for(state="detached")
    page.reload()
    window.until("get('summary')?.frames.length === 14")
    until(page, lambda: demo.get("/api/preferences").get("first-steps") == "closed")
    assert not page.locator(".first-steps").count()
    window.close()


@pytest.mark.slow
def test_a_step_stays_and_says_which_run_it_is_about(browser: Browser, demo: StudioServer) -> None:
    """Also after a reload and while another run is looked at; a comparison goes on with the run that is chosen."""
    demo.patch("/api/preferences", {"first-steps": None})
    window = StudioPage(browser, demo, with_scene=False)
    page = window.page
    strip = page.locator(".first-steps")
    strip.get_by_role("button", name="Make it fail").click()
    window.until("get('step') === 3 && get('run') === 'one-layer' && get('compared') === 'walk/ten-layers'")
    until(page, lambda: "step=3" in page.url)
    page.reload()
    window.until("get('step') === 3 && get('run') === 'one-layer' && get('summary')?.frames.length")
    expect(strip.locator("[aria-current=step]")).to_contain_text("Make it fail")
    page.locator('.run[data-key="walk/ten-layers"]').click()
    window.until("get('run') === 'ten-layers' && get('compared') === 'walk/one-layer'")
    # A run's colour is its own, whichever of them is open.
    swatches = page.locator("#panel-compare .compared .swatch")
    until(page, lambda: swatches.count() == 2)

    def colours() -> dict[str, str]:
        rows = page.locator("#panel-compare .compared tbody tr")
        return {
            row.locator("td").first.inner_text(): str(row.locator(".swatch").get_attribute("style"))
            for row in rows.all()
        }

    before = colours()
    page.locator('.run[data-key="walk/one-layer"]').click()
    window.until("get('run') === 'one-layer' && get('compared') === 'walk/ten-layers'")
    until(page, lambda: list(colours()) != list(before) and len(colours()) == 2)
    assert colours() == before
    # The second step is about the other run.
    strip.get_by_role("button", name="Change survival").click()
    window.until("get('run') === 'ten-layers' && get('step') === 2")
    page.locator('.run[data-key="walk/one-layer"]').click()
    strip.get_by_text("this step is about").wait_for()
    strip.get_by_role("button", name="Back to this step", exact=True).click()
    window.until("get('run') === 'ten-layers' && get('step') === 2 && get('view') === 'schedule'")
    page.locator(".first-knob input:enabled").wait_for()
    window.close()


def test_annealing_is_seen_on_the_first_screen(browser: Browser, demo: StudioServer, artefacts: Path) -> None:
    """From the printed address, at 1280 × 800, also in a later window: the body is large and of glass, the first clouds
    at hands and feet are wide, the last one's still are clouds, and nothing covers any of it.
    """
    demo.patch("/api/preferences", {"first-steps": None})
    window = StudioPage(browser, demo)
    page = window.page
    until(page, lambda: demo.get("/api/scene/play-layers", window=window.name)["playing"])
    page.get_by_role("region", name="The first two minutes").wait_for()
    run = Workspace(demo.workspace).session("walk").run("ten-layers")
    frame, body = window.get("frame"), run.body()
    assert isinstance(frame, int)
    pose = np.array(demo.get(f"/api/sessions/walk/runs/ten-layers/frames/{frame}")["pose"])
    ends = limb_ends(body, pose[None])[0].reshape(-1, 3) / 1000.0

    def seen(points: np.ndarray) -> np.ndarray:
        """Pixels of the window."""
        box = page.frame_locator("#scene").locator("canvas").first.bounding_box()
        shares = on_screen(points, window.wire.eye, *window.wire.lens)[:, :2]
        return np.array([box["x"], box["y"]]) + shares * np.array([box["width"], box["height"]])

    def share_of_height() -> float:
        if not window.wire.eye:
            return 0.0
        return float(np.ptp(on_screen(ends, window.wire.eye, *window.wire.lens)[:, 1]))

    until(page, lambda: WELL_FRAMED[0] <= share_of_height() <= WELL_FRAMED[1])
    # Stand still, at the first layer.
    page.evaluate("async () => (await import('/assets/js/studio/layer_playback.js')).scrubTo(0)")
    until(page, lambda: window.wire.layers().keys() == {0})
    until(page, lambda: not demo.get("/api/scene/play-layers", window=window.name)["playing"])
    scene = page.frame_locator("#scene")
    scene.locator("#webgl-software-rendering button").dispatch_event("click")
    # This browser has no graphics card: its pictures are not smoothed, which would take it twice as long.
    attributes = "canvas => canvas.getContext('webgl2').getContextAttributes()"
    assert scene.locator("canvas").first.evaluate(attributes)["antialias"] is False
    clouds = stored_clouds(window, frame)
    until(page, lambda: np.allclose(window.wire.layers()[0], clouds[0], atol=1e-5))
    names = [body.drawn[at].name for at in extremities(body)]
    # (particles, limbs, 2)
    first, last = (seen(clouds[layer]).reshape(-1, len(names), 2) for layer in (0, max(clouds)))
    for at, name in enumerate(names):
        spreads = [float(np.ptp(cloud[:, at], axis=0).max()) for cloud in (first, last)]
        if "hand" in name or "foot" in name:
            assert spreads[0] >= 80.0, (name, spreads)
            assert spreads[1] >= 8.0, (name, spreads)
    limbs = [at for at, name in enumerate(names) if "hand" in name or "foot" in name]
    points = np.concatenate([first[:, limbs].reshape(-1, 2), last[:, limbs].reshape(-1, 2)])
    # viser's word about drawing in software goes a moment after it was closed.
    until(page, lambda: page.evaluate(ALL_IN_SCENE, points.tolist()))
    # What is drawn there has the layer's own shades, whatever lies before it.
    shades = glowing(colour_tokens(True), 0, len(clouds), np.linspace(0.0, 1.0, 30)).astype(float)

    def drawn_share() -> float:
        path = artefacts / "first-screen.png"
        window.shoot(path)
        picture = cv2.imread(str(path))[:, :, ::-1].astype(float)
        places = np.round(first[:, limbs].reshape(-1, 2)).astype(int)
        return float(np.mean([_has_shade(picture, place, shades) for place in places]))

    until(page, lambda: drawn_share() > 0.9)
    window.close()


ALL_IN_SCENE = """points => points.every(([x, y]) => {
  const scene = document.getElementById("scene");
  const box = scene.getBoundingClientRect();
  const within = scene.contentDocument.elementFromPoint(x - box.x, y - box.y);
  return document.elementFromPoint(x, y) === scene && within?.tagName === "CANVAS";
})"""


def _has_shade(picture: np.ndarray, place: np.ndarray, shades: np.ndarray) -> bool:
    """Whether about a place of a picture a pixel has one of some colours."""
    (across, down), reach = place, 4
    near = picture[down - reach : down + reach + 1, across - reach : across + reach + 1].reshape(-1, 1, 3)
    return bool((np.abs(near - shades[None]).max(axis=2) < 40.0).any())


@pytest.fixture
def paused(window: StudioPage) -> StudioPage:
    """The window with some frames tracked and the tracking paused, the newest frame shown."""
    window.until("get('summary')?.frames.length > 4")
    if window.page.locator("#track-toggle").inner_text() == "Pause":
        window.page.click("#track-toggle")
    window.until("get('work')?.state === 'paused'")
    window.key("End")
    window.until(
        "get('frame') === get('summary').frames.at(-1).frame && get('detail')?.frame === get('frame')"
    )
    return window


@pytest.mark.slow
def test_the_scene_is_seen_while_the_tracking_goes_on(window: StudioPage) -> None:
    window.until("get('work')?.state === 'paused' && get('summary')?.frames.length > 0")
    count = len(window.get("summary")["frames"])  # pyright: ignore[reportIndexIssue]
    window.page.get_by_role("button", name="Continue", exact=True).click()
    window.until("get('work').state === 'tracking'")
    window.until(f"get('summary').frames.length > {count + 2} && get('frame') > {count}")
    window.until("get('detail')?.layers.length > 0 && get('follow')")
    assert "tracking" in window.page.locator("#state-text").inner_text()
    window.page.click("#track-toggle")
    window.until("get('work').state === 'paused'")
    window.page.locator("#state-text", has_text="paused").wait_for()
    assert window.page.locator("#track-toggle").inner_text() == "Continue"
    assert not window.wire.read().shadows, "this browser has no graphics card"
    # What is drawn of a stored frame is what the store has.
    window.key("Home")
    window.until("get('frame') === 0 && get('detail')?.frame === 0")
    clouds = stored_clouds(window, 0)
    until(window.page, lambda: drawn(window, clouds))


def test_the_search_is_watched_layer_by_layer(paused: StudioPage, artefacts: Path) -> None:
    page = paused.page
    speed = page.get_by_label("Search speed")
    until(page, lambda: speed.locator("option:checked").inner_text() == "10 layers/s")
    speed.select_option(label="3 layers/s")
    paused.until("get('work').seconds_a_layer === 1 / 3")
    page.click("#track-toggle")
    # The page shows the frame in progress as it grows, and so does the scene.
    for layers in (2, 4):
        paused.until(f"get('detail')?.finished === false && get('detail').layers.length >= {layers}")
    until(page, lambda: len(paused.wire.layers()) >= 4)
    paused.shoot(artefacts / "page-watched-dark-1280x800.png")
    page.click("#track-toggle")
    paused.until("get('work').state === 'paused'")

    # By the keyboard; and a speed that a script sets is shown too.
    speed.focus()
    page.keyboard.press("Home")
    paused.until("get('work').seconds_a_layer === 0")
    paused.studio.pace(0.05)
    until(page, lambda: speed.locator("option:checked").inner_text() == "20 layers/s")
    paused.studio.pace(PACE)
    until(page, lambda: speed.locator("option:checked").inner_text() == "10 layers/s")


def test_a_narrow_scene_has_its_knobs_when_they_are_asked_for(paused: StudioPage) -> None:
    """As beside the first steps on a laptop: the panel would cover the body."""
    page, knob = paused.page, paused.scene.get_by_text("survival rate").first
    button = page.get_by_role("button", name="Knobs", exact=True)
    knob.wait_for()
    assert button.count() == 0
    page.set_viewport_size({"width": 600, "height": 800})
    button.wait_for()
    knob.wait_for(state="hidden")
    button.click()
    knob.wait_for()
    button.click()
    knob.wait_for(state="hidden")
    page.set_viewport_size({"width": 1280, "height": 800})
    button.wait_for(state="detached")
    knob.wait_for()


def test_the_survival_rate_is_moved_and_new_layers_are_drawn(paused: StudioPage) -> None:
    frame = paused.get("frame")
    assert isinstance(frame, int)
    stored = paused.studio.get(f"{run_path(paused)}/frames/{frame}")
    clouds = stored_clouds(paused, frame)
    until(paused.page, lambda: drawn(paused, clouds))
    paused.show_view("schedule")
    until(paused.page, lambda: paused.page.locator("#panel-views .figure-chart canvas").count() > 0)
    until(paused.page, paused.charts_drawn)
    before = paused.chart("views")
    slider = paused.slider("survival rate")
    value = float(slider.get_attribute("aria-valuenow") or "nan")
    slider.focus()
    view, requested = paused.wire.viewer, len(paused.watch.requests)
    paused.page.keyboard.press("ArrowRight")
    wanted = round(value + 0.01, 2)
    paused.until(f"get('settings')?.values.survival === {wanted}")
    paused.scene.get_by_text(f"In use since frame {frame}, layer 1.").wait_for()
    paused.until("get('whatIf')?.length === get('layerCount') && get('work').state === 'paused'")
    layers = paused.get("whatIf")
    assert isinstance(layers, list)
    assert {layer["frame"] for layer in layers} == {frame}
    assert {layer["alpha_wanted"] for layer in layers} == {wanted}

    # The scene is split: what is stored at the left; at the right the first cloud is the same, for only the knob
    # differs, and the others are new, and so are the charts.
    until(paused.page, lambda: differing(paused.tried_wire.layers(), clouds) == set(clouds) - {0})
    until(paused.page, lambda: differing(paused.wire.layers(), clouds) == set())
    until(paused.page, lambda: paused.chart("views") != before)

    # The arrow key moved the slider and nothing else.
    assert view
    np.testing.assert_allclose(paused.wire.viewer, view, atol=1e-6)

    # The stored answer stays, in the store and at its side of the divider, which the keyboard moves.
    divider = paused.page.get_by_role("separator", name="Stored at the left, tried at the right")
    divider.focus()
    paused.page.keyboard.press("ArrowRight")
    assert divider.get_attribute("aria-valuenow") == "52"
    paused.page.keyboard.press("Home")
    paused.page.keyboard.press("End")
    assert divider.get_attribute("aria-valuenow") == "96"
    divider.dblclick()
    assert divider.get_attribute("aria-valuenow") == "50"
    boxes = [
        paused.page.frame_locator(scene).locator("canvas").first.bounding_box()
        for scene in ("#scene", ".tried-scene")
    ]
    assert boxes[0] == pytest.approx(boxes[1], abs=1.0), "both are seen alike"
    # Where the scene is narrow, the knobs lie over what was tried, too, and can be moved on.
    paused.page.set_viewport_size({"width": 480, "height": 800})
    knobs = paused.page.get_by_role("button", name="Knobs", exact=True)
    knobs.click()
    paused.scene.get_by_text("survival rate").first.click(trial=True)
    knobs.click()
    paused.scene.get_by_text("survival rate").first.wait_for(state="hidden")
    expect(paused.page.locator(".twin-box")).to_have_css("clip-path", "none")
    paused.page.set_viewport_size({"width": 1280, "height": 800})
    paused.page.locator(".twin-box .divider").wait_for()
    paused.page.locator("#trial", has_text=f"Frame {frame} tried again, not stored").wait_for()
    assert paused.studio.get(f"{run_path(paused)}/frames/{frame}") == stored

    # Nothing that is stored is asked for again: a trial changes none of it.
    paused.page.wait_for_timeout(LATER_MILLISECONDS)
    asked = set(paused.watch.requests[requested:])
    assert not asked & {"GET /api/sessions", f"GET {run_path(paused)}/frames"}


@pytest.mark.slow
def test_pictures_of_page_scene_and_charts_are_kept(paused: StudioPage, artefacts: Path) -> None:
    for theme in ("dark", "light"):
        if paused.page.evaluate("document.documentElement.dataset.theme") != theme:
            paused.page.click("#theme")
        for width, height in SIZES:
            paused.page.set_viewport_size({"width": width, "height": height})
            name = f"{theme}-{width}x{height}"
            # A wide window takes long to draw in software: the panels are kept in the narrow one.
            for panel in PANELS if width == SIZES[0][0] else PANELS[:1]:
                paused.page.click(f"[data-panel={panel}]")
                if panel == "cameras":
                    until(paused.page, lambda: loaded_views(paused) == 4)
                until(paused.page, paused.charts_drawn)
                paused.shoot(artefacts / f"charts-{panel}-{name}.png", "#panels")
            paused.show_view("variance")
            until(paused.page, paused.charts_drawn)
            paused.scene.locator(f"html[data-mantine-color-scheme={theme}]").wait_for(state="attached")
            paused.shoot(artefacts / f"page-{name}.png")
            paused.shoot(artefacts / f"scene-{name}.png", "#stage")
            assert paused.page.evaluate("document.documentElement.scrollHeight") == height
            assert paused.page.evaluate("document.documentElement.scrollWidth") == width
    paused.page.set_viewport_size({"width": 1280, "height": 800})
    paused.page.click("#theme")
    paused.show_view("schedule")
    until(paused.page, paused.charts_drawn)
    before = paused.chart("views")
    paused.key("r")
    paused.until("get('whatIf')?.length === get('layerCount') && get('work').state === 'paused'")
    until(paused.page, lambda: paused.chart("views") != before)
    paused.shoot(artefacts / "page-re-annealed-dark-1280x800.png")


def loaded_views(window: StudioPage) -> int:
    """How many camera views show a picture."""
    return window.page.locator(".view img").evaluate_all(
        "images => images.filter((image) => image.complete && image.naturalWidth > 0).length"
    )


def test_the_keyboard_moves_frames_and_layers(paused: StudioPage) -> None:
    last = paused.get("frame")
    assert isinstance(last, int)
    paused.key("ArrowLeft")
    paused.until(f"get('frame') === {last - 1} && get('detail')?.frame === {last - 1}")
    clouds = stored_clouds(paused, last - 1)
    until(paused.page, lambda: drawn(paused, clouds))
    paused.key("ArrowRight")
    paused.until(f"get('frame') === {last}")
    paused.key("Home")
    paused.until("get('frame') === 0 && get('detail')?.frame === 0")
    paused.key("Shift+ArrowRight")
    paused.until("get('layer') === 0")
    until(paused.page, lambda: paused.wire.layers().keys() == {0})
    paused.key("Shift+ArrowLeft")
    paused.until("get('layer') === null")
    until(paused.page, lambda: len(paused.wire.layers()) > 1)
    paused.key("End")
    paused.until(f"get('frame') === {last}")


@pytest.mark.slow
def test_the_keyboard_plays_loops_looks_and_explains(paused: StudioPage, artefacts: Path) -> None:
    page = paused.page
    paused.key("l")
    assert page.locator("#loop").get_attribute("aria-pressed") == "true"
    paused.key("Home")
    paused.key(" ")
    page.locator("#play[aria-label=Pause]").wait_for()
    paused.until("get('frame') > 1")
    paused.key(" ")
    page.locator("#play[aria-label=Play]").wait_for()
    paused.key("l")
    assert page.locator("#loop").get_attribute("aria-pressed") == "false"

    moves = paused.wire.read().camera_moves
    paused.key("2")
    until(page, lambda: paused.wire.read().camera_moves > moves)
    moves = paused.wire.camera_moves
    paused.key("0")
    until(page, lambda: paused.wire.read().camera_moves > moves)

    paused.key("?")
    dialog = page.locator("dialog[open]")
    dialog.get_by_role("heading", name="Keys").wait_for()
    assert dialog.locator("tr").count() >= 12
    paused.shoot(artefacts / "page-keys-dark-1280x800.png")
    page.keyboard.press("Escape")
    dialog.wait_for(state="detached")

    paused.key("End")
    paused.key("r")
    paused.until("get('whatIf')?.length === get('layerCount') && get('work').state === 'paused'")


@pytest.mark.slow
def test_camera_views_with_every_overlay(paused: StudioPage, artefacts: Path) -> None:
    page = paused.page
    page.click("[data-panel=cameras]")
    until(page, lambda: loaded_views(paused) == 4)
    for label in ("truth", "mask", "edge map", "sample points", "particles"):
        before = page.locator(".view img").first.get_attribute("src")
        page.locator("#tab-tools label", has_text=label).locator("input").check()
        until(page, lambda was=before: page.locator(".view img").first.get_attribute("src") != was)
    until(page, lambda: loaded_views(paused) == 4)
    everything = "show=outline,truth,mask,edges,samples,particles"
    until(
        page,
        lambda: all(
            everything in unquote(str(image.get_attribute("src")))
            for image in page.locator(".view img").all()
        ),
    )
    page.locator(".view").nth(1).click()
    large = page.locator("dialog[open] img")
    until(page, lambda: large.evaluate("image => image.naturalHeight") >= 480)
    picture, frame = large.bounding_box(), page.locator("dialog[open]").bounding_box()
    assert picture["width"] <= frame["width"], "the whole picture is seen"
    assert picture["height"] <= frame["height"]
    paused.shoot(artefacts / "page-camera-enlarged-dark-1280x800.png")
    page.keyboard.press("Escape")
    for label in ("truth", "mask", "edge map", "sample points", "particles"):
        page.locator("#tab-tools label", has_text=label).locator("input").uncheck()


def test_variances_and_poses_come_as_csv(paused: StudioPage) -> None:
    page, frame = paused.page, paused.get("frame")
    paused.show_view("variance")
    until(page, lambda: page.locator("#panel-views .figure-body").get_attribute("data-drawn"))
    with page.expect_download() as coming:
        page.locator("#panel-views").get_by_role("button", name="CSV", exact=True).click()
    lines = Path(coming.value.path()).read_text().splitlines()
    # The first table; each has its title in a line of its own.
    ends = [at for at, line in enumerate(lines) if line.startswith("#")]
    rows = list(csv.DictReader(lines[ends[1] + 1 : ends[2]]))
    stored = list(
        csv.DictReader(io.StringIO(paused.studio.text(f"{run_path(paused)}/frames/{frame}/variance.csv")))
    )
    moments = {"weighed": "weighed", "before": "before_diffusion", "after": "after_diffusion"}
    assert len(rows) * len(moments) == len(stored) * (len(stored[0]) - 3)
    for row in rows:
        for key, moment in moments.items():
            (line,) = [one for one in stored if (one["layer"], one["moment"]) == (row["layer"], moment)]
            np.testing.assert_allclose(float(row[key]), float(line[row["parameter"]]), rtol=1e-8)

    page.locator(".run[aria-selected=true]").hover()
    with page.expect_download() as coming:
        paused.choose(page.locator(".run[aria-selected=true] .more"), "Poses as CSV")
    assert Path(coming.value.path()).read_text() == paused.studio.text(f"{run_path(paused)}/poses.csv")


def test_the_guide_lists_every_knob(paused: StudioPage, artefacts: Path) -> None:
    with paused.context.expect_page() as coming:
        paused.page.get_by_role("link", name="Guide", exact=True).click()
    guide = coming.value
    guide.wait_for_load_state()
    faults: list[str] = []
    guide.on("response", lambda answer: faults.append(answer.url) if answer.status >= 400 else None)
    guide.reload()
    text = guide.locator("main").inner_text()
    assert [entry.name for entry in knob_table() if entry.name not in text] == []
    assert faults == []
    guide.screenshot(path=artefacts / "guide-dark-1280x800.png")
    guide.get_by_role("link", name="knob").first.click()
    guide.screenshot(path=artefacts / "guide-knobs-dark-1280x800.png")
    guide.close()


@pytest.mark.slow
def test_a_new_answer_can_be_kept(paused: StudioPage) -> None:
    last = paused.get("frame")
    assert isinstance(last, int)
    paused.key("ArrowLeft")
    paused.key("ArrowLeft")
    paused.until(f"get('frame') === {last - 2} && get('detail')?.frame === {last - 2}")
    before = paused.studio.get(f"{run_path(paused)}/frames/{last - 2}")
    paused.key("r")
    paused.until("get('whatIf')?.length === get('layerCount') && get('work').state === 'paused'")
    paused.page.locator("#trial").get_by_role("button", name="Replace…", exact=True).click()
    paused.page.locator("dialog form").get_by_role("button", name="Replace it", exact=True).click()
    paused.until(f"get('summary').frames.at(-1).frame === {last - 2} && get('whatIf') === null")
    after = paused.studio.get(f"{run_path(paused)}/frames/{last - 2}")
    assert after["pose"] != before["pose"]
    paused.until(f"get('detail')?.frame === {last - 2}")
    clouds = stored_clouds(paused, last - 2)
    until(paused.page, lambda: drawn(paused, clouds))


@pytest.mark.slow
def test_tracking_on_uses_the_new_setting(paused: StudioPage) -> None:
    last = paused.get("frame")
    assert isinstance(last, int)
    in_use = json.loads(json.dumps(paused.get("settings")))["values"]["survival"]
    paused.page.click("#track-toggle")
    # The search may have been paused inside the next frame, whose first layers ran with the value before.
    paused.until(f"get('summary').frames.at(-1).frame > {last + 2}")
    reply = paused.studio.get(f"{run_path(paused)}/frames/{last + 2}")
    assert {layer["alpha_wanted"] for layer in reply["layers"]} == {in_use}
