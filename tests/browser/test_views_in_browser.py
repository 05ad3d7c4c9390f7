"""The views of a run's search as a person uses them: drawn is what the store has, and one selection moves them all."""

import csv
import io
import math
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from playwright.sync_api import Browser, expect
from scene_wire import until
from studio_page import PATIENCE, StudioPage
from studio_server import StudioServer

from studio.search.trackers.tracker import LayerRecord
from studio.sessions.workspace import Workspace

pytestmark = pytest.mark.browser

RUN = "/api/sessions/walk/runs/seen"
FRAMES, LAYERS, PARTICLES = 10, 5, 60
FRAME = 6
LONG = 300_000
"""Milliseconds for a run to be drawn and tracked again."""
SETTINGS = {"layers": LAYERS, "particles": PARTICLES, "survival": 0.3, "recovery": "off"}
FIGURE = "#panel-views .figure-chart"
OPTION = """async (place) => {
  const echarts = await import('/assets/vendor/echarts.esm.min.js');
  return echarts.getInstanceByDom(document.querySelector(place))?.getOption().series.map((series) => ({
    type: series.type, name: series.name, data: JSON.parse(JSON.stringify(series.data ?? [])) })) ?? []; }"""
SET = "async (changes) => (await import('/assets/js/state.js')).set(changes)"
PLACE = """async ([place, column, row, plot]) => {
  const echarts = await import('/assets/vendor/echarts.esm.min.js');
  const chart = echarts.getInstanceByDom(document.querySelector(place));
  return chart.convertToPixel({ gridIndex: plot }, [column, row]); }"""
FOCUS = """([part, at]) => {
  const links = "a[href]:not(tbody tr:nth-child(n + 4) a)";
  const stopsOf = (place) => [...place.querySelectorAll(`${links}, button, select, input, [tabindex='0']`)];
  const all = [...document.querySelectorAll(part)].flatMap(stopsOf);
  const stops = all.filter((stop) => stop.checkVisibility() && !stop.disabled && !stop.closest("dialog"));
  const stop = stops[at];
  if (!stop) return null;
  if (stop.matches("input:not([type=checkbox]), textarea, [role=tab], [role=slider]:not(#track)")) return "";
  stop.focus();
  return document.activeElement === stop ? stop.outerHTML.slice(0, 120) : ""; }"""
READ_FRAME = "async () => (await import('/assets/js/state.js')).get('frame')"
HELD = (
    *("session", "run", "frame", "layer", "limb", "parameter", "particle", "camera", "through", "eye"),
    *("panel", "view", "over", "second", "towards"),
)


@pytest.fixture(scope="module")
def studio(studio: StudioServer) -> StudioServer:
    """With the sample, tracked over some frames."""
    studio.post("/api/samples", {"name": "walk"})
    studio.track("walk", "seen", last=FRAMES, settings=SETTINGS)
    return studio


def layers_of(studio: StudioServer) -> list[LayerRecord]:
    """The stored layers of the frame that is looked at."""
    with Workspace(studio.workspace).session("walk").run("seen").results() as results:
        return results.layers(FRAME)


def let_draw(window: StudioPage) -> None:
    """Wait until what was just chosen is drawn."""
    window.page.wait_for_timeout(400)
    figure = window.page.locator("#panel-views .figure")
    until(window.page, lambda: figure.get_attribute("aria-busy") != "true")


def show(window: StudioPage, view: str, **changes: object) -> list[dict]:
    """Show a view of the frame; what is drawn of it, series by series."""
    named = {"layer": None, "parameter": None, "limb": None, "particle": None, "over": None, "towards": None}
    window.until(f"get('run') === 'seen' && get('summary')?.frames.length === {FRAMES} && get('parameters')")
    window.page.evaluate(SET, {"panel": "views", "view": view, "frame": FRAME} | named | changes)
    of_run = changes.get("over") == "run" or view in ("coverage", "frames")
    name = f"walk-seen-{'' if of_run else f'frame{FRAME}-'}{view}"
    body = window.page.locator("#panel-views .figure-body")
    until(window.page, lambda: str(body.get_attribute("data-drawn")).startswith(f"{name} dark"))
    let_draw(window)
    return window.page.evaluate(OPTION, FIGURE)


def rows_of(studio: StudioServer, view: str, table: str, query: str = "", *, run: bool = False) -> list[dict]:
    """A table of a view's answer, rows by key."""
    answer = studio.get(f"{RUN}/{'' if run else f'frames/{FRAME}/'}views/{view}{query}")
    found = next(one for one in answer["tables"] if one["name"] == table)
    keys = [column["key"] for column in found["columns"]]
    return [dict(zip(keys, row, strict=True)) for row in found["rows"]]


def test_variance_and_schedule_are_drawn_as_stored(window: StudioPage, studio: StudioServer) -> None:
    layers = layers_of(studio)
    first, second = [one for one in show(window, "variance") if one["type"] == "heatmap"]
    weighed = layers[0].variance_weighed
    for series, moment in ((first, "variance_resampled"), (second, "variance_diffused")):
        assert len(series["data"]) == LAYERS * len(weighed)
        for layer, parameter, value in series["data"]:
            share = getattr(layers[layer], moment)[parameter] / weighed[parameter]
            assert value == pytest.approx(math.log10(share), abs=1e-9)

    schedule = [one for one in show(window, "schedule") if one["type"] == "line"]
    assert "reached" in [one["name"] for one in schedule]
    series = [one["data"] for one in schedule]
    wanted = [
        [layer.alpha_wanted for layer in layers],
        [layer.alpha_reached for layer in layers],
        [layer.beta for layer in layers],
    ]
    for numbers in wanted:
        assert any(
            len(data) == LAYERS and np.allclose([float(value) for value in data], numbers) for data in series
        ), numbers
    drawn = show(window, "schedule", over="run")
    betas = [row["beta_last"] for row in rows_of(studio, "schedule", "frames", run=True)]
    assert betas[FRAME] == pytest.approx(layers[-1].beta)
    assert betas in [one["data"] for one in drawn]


def test_particles_and_their_parents_are_drawn_as_stored(window: StudioPage, studio: StudioServer) -> None:
    layers = layers_of(studio)
    drawn = show(window, "genealogy")
    points = next(one for one in drawn if one["type"] == "scatter")["data"]
    assert len(points) == sum(len(layer.poses) for layer in layers) == LAYERS * PARTICLES
    survivors = [row for row in rows_of(studio, "genealogy", "particles") if row["survives"] and row["layer"]]
    ribbons = [one["data"] for one in drawn if one["type"] == "lines"]
    assert len(survivors) in [len(data) for data in ribbons]

    weights = np.exp(layers[2].beta * (layers[2].log_weights - layers[2].log_weights.max()))
    weights = np.sort(weights / weights.sum())[::-1]
    (curve,) = [one for one in show(window, "weights", layer=2) if one["name"] == "weight"]
    found = [point["value"][1] for point in curve["data"]]
    assert found == pytest.approx(weights[weights > 0].tolist(), rel=1e-6)
    assert [point["value"][0] for point in curve["data"]] == list(range(1, len(found) + 1))

    lines = [one["data"] for one in show(window, "survivors", layer=2) if one["type"] == "parallel"]
    assert sum(len(data) for data in lines) == PARTICLES
    alive = [row for row in rows_of(studio, "survivors", "particles", "?layer=2") if row["survives"]]
    assert len(lines[1]) == len(alive) < PARTICLES
    assert {line["row"]["particle"] for line in lines[1]} == {row["particle"] for row in alive}


def test_clouds_couplings_and_modes_are_drawn_as_stored(window: StudioPage, studio: StudioServer) -> None:
    layers = layers_of(studio)
    names = list(Workspace(studio.workspace).session("walk").run("seen").record.parameters)
    at = next(place for place, one in enumerate(names) if "knee" in one)
    name = names[at]
    drawn = show(window, "clouds", parameter=name)
    ridges = [one for one in drawn if one["type"] == "custom" and one["name"] in ("drawn", "1", str(LAYERS))]
    assert len(ridges) == 3
    bars = next(one for one in drawn if one["name"] == "first cloud")["data"]
    own = next(bar["own"] for bar in bars if bar["own"]["parameter"] == name)
    assert own["mean"] == pytest.approx(float(layers[0].poses[:, at].mean()), abs=1e-9)

    (matrix,) = [one for one in show(window, "coupling", layer=1) if one["type"] == "heatmap"]
    rows = rows_of(studio, "coupling", "matrix", "?layer=1")
    assert len(matrix["data"]) == len(names) ** 2
    assert {round(cell[2], 9) for cell in matrix["data"] if cell[2] != "-"} >= {
        round(row["correlation"], 9) for row in rows if row["correlation"] is not None
    }
    masses = {(row["layer"], row["mode"]): row["mass"] for row in rows_of(studio, "modes", "layers")}
    for series in show(window, "modes"):
        for bar in series["data"] if str(series["name"]).startswith("mode ") else []:
            mode = int(series["name"].removeprefix("mode "))
            assert bar["value"] == pytest.approx(masses.get((bar["layer"], mode), 0.0))


def differences_drawn(studio: StudioServer) -> list[float]:
    """The differences on the map's scale: logarithmic to both sides, level within `level` of nothing."""
    (scale,) = rows_of(studio, "blame", "scale")
    differences = [row["difference"] for row in rows_of(studio, "blame", "matrix")]
    return [math.copysign(math.log10(1.0 + abs(one) / scale["level"]), one) for one in differences]


def test_landscape_and_blame_are_what_the_likelihood_says(window: StudioPage, studio: StudioServer) -> None:
    name = "pelvis_rz"
    rows = rows_of(studio, "landscape", "slice", f"?parameter={name}")
    curve = next(one for one in show(window, "landscape", parameter=name) if one["name"] == "log weight")
    turn = 180.0 / math.pi if rows[0]["unit"] == "rad" else 1.0
    assert [point[0] for point in curve["data"]] == pytest.approx([row["at"] * turn for row in rows])
    assert [point[1] for point in curve["data"]] == pytest.approx([row["log_weight"] for row in rows])

    (heat,) = [one for one in show(window, "blame") if one["type"] == "heatmap"]
    wanted = differences_drawn(studio)
    assert [cell[2] for cell in heat["data"]] == pytest.approx(wanted)


def test_the_run_is_drawn_as_measured(window: StudioPage, studio: StudioServer) -> None:
    lines = [one["data"] for one in show(window, "frames") if one["type"] == "line"]
    summary = studio.get(f"{RUN}/frames")["frames"]
    for key in ("error_mm", "log_weight", "milliseconds"):
        assert [line[key] for line in summary] in lines
    points = [one["data"] for one in show(window, "coverage") if one["type"] == "scatter"]
    rows = rows_of(studio, "coverage", "frames", run=True)
    assert sum(map(len, points)) == sum((row["spread"] or 0) > 0 and (row["error"] or 0) > 0 for row in rows)


def test_a_click_in_one_view_is_followed_by_all(window: StudioPage, studio: StudioServer) -> None:
    show(window, "variance")
    page = window.page
    x, y = page.evaluate(PLACE, [FIGURE, 3, 2, 0])
    page.locator(FIGURE).click(position={"x": x, "y": y})
    window.until("get('layer') === 3 && get('parameter') === get('parameters')[2].name")
    page.locator("#layer-label", has_text=f"layer 4 of {LAYERS}").wait_for()
    label = window.page.evaluate(
        "async () => (await import('/assets/js/state.js')).get('parameters')[2].label"
    )
    record = layers_of(studio)[3]
    readout = page.locator("#panel-views .readout")
    readout.get_by_text(f"{label}, layer 4 of {LAYERS}").wait_for()
    shown = float(f"{record.variance_resampled[2]:.3g}")
    assert str(shown) in readout.inner_text() or f"{record.variance_resampled[2]:.1e}".split("e")[0] in (
        readout.inner_text()
    )
    until(page, lambda: "layer=3" in page.url and "parameter=" in page.url)
    # The next view shows the same layer and parameter.
    window.key("v")
    window.until("get('view') === 'schedule' && get('layer') === 3")
    readout.get_by_text(f"Layer 4 of {LAYERS}: β").wait_for()
    window.key("Shift+V")
    window.until("get('view') === 'variance'")


def test_every_view_is_used_by_the_keyboard(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    show(window, "variance")
    names = [one["name"] for one in studio.get("/api/views")["views"] if one["name"] != "why"] + ["frames"]
    for name in [*names[1:], names[0]]:
        window.key("v")
        window.until(f"get('view') === '{name}'")
    window.key("]")
    window.until("get('parameter') === get('parameters')[0].name")
    window.key("[")
    window.until("get('parameter') === get('parameters').at(-1).name")
    window.key("t")
    table = page.locator("#panel-views .figure-words table").first
    expect(table.locator("caption")).to_have_text(
        "Variance of every parameter in every layer", timeout=PATIENCE
    )
    heads = table.locator("thead th[scope=col]").all_inner_texts()
    row = rows_of(studio, "variance", "layers")[0]
    assert len(heads) == len(row)
    cells = dict(zip(row, table.locator("tbody tr").first.locator("td").all_inner_texts(), strict=True))
    assert cells["parameter"] == row["parameter"]
    assert float(cells["weighed"]) == pytest.approx(row["weighed"], rel=1e-8)
    window.key("t")
    table.wait_for(state="detached")
    # By a few letters of its name.
    page.keyboard.press("Control+k")
    dialog = page.locator("dialog.palette[open]")
    dialog.get_by_role("combobox").fill("genea")
    dialog.locator("[aria-selected=true]", has_text="Genealogy").wait_for()
    page.keyboard.press("Enter")
    window.until("get('view') === 'genealogy'")
    dialog.wait_for(state="detached")
    page.keyboard.press("Control+k")
    page.keyboard.press("Escape")
    dialog.wait_for(state="detached")
    # The list of views is one stop; its arrows go from view to view, those to the sides stay the timeline's.
    page.locator(".view-entry[aria-current=true]").focus()
    page.keyboard.press("ArrowDown")
    window.until("get('view') === 'weights'")
    page.keyboard.press("ArrowRight")
    window.until(f"get('frame') === {FRAME + 1}")


@pytest.mark.slow
@pytest.mark.parametrize("panel", ["why", "views", "compare", "cameras", "export"])
def test_the_arrows_move_the_timeline_from_every_stop_of_the_keyboard(window: StudioPage, panel: str) -> None:
    """Fields that are typed in, sliders and the list of tabs keep them. Of a table its first rows stand for all; what
    stands around the panels is gone through once.
    """
    page = window.page
    page.bring_to_front()
    show(window, "variance")
    if panel == "views":
        window.key("t")
    page.click(f"[data-panel={panel}]")
    window.until(f"get('panel') === '{panel}' && get('frame') === {FRAME}")
    page.wait_for_timeout(500)
    stops, at, frame = [], 0, FRAME
    part = "body" if panel == "why" else f"#panel-{panel}, #tab-tools"
    until(page, lambda: page.evaluate(FOCUS, [part, 0]) is not None)
    while True:
        stop = page.evaluate(FOCUS, [part, at])
        at += 1
        if stop is None:
            break
        if not stop:
            continue
        # There and back, so that the run does not end.
        key, frame = ("ArrowRight", FRAME + 1) if frame == FRAME else ("ArrowLeft", FRAME)
        page.keyboard.press(key)
        moved = page.evaluate(READ_FRAME)
        assert moved == frame, (stop, key)
        stops.append(stop)
    assert len(stops) > (20 if panel == "why" else 0), stops
    if panel == "views":
        window.key("t")


def test_a_row_of_a_table_leads_to_what_it_speaks_of(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    show(window, "schedule", over="run")
    window.key("t")
    table = page.locator("#panel-views .figure-words table").first
    link = table.get_by_role("link", name="3", exact=True).first
    assert "frame=3" in str(link.get_attribute("href"))
    link.click()
    window.until("get('frame') === 3 && get('view') === 'schedule'")
    show(window, "variance")
    window.key("t")
    row = table.locator("tbody tr").nth(7)
    wanted = rows_of(studio, "variance", "layers")[7]
    link = row.get_by_role("link")
    assert f"parameter={wanted['parameter']}" in str(link.get_attribute("href"))
    link.click()
    window.until(f"get('layer') === {wanted['layer']} && get('parameter') === '{wanted['parameter']}'")
    # Opened in another window it shows the same. Of a row that is drawn anew meanwhile nothing would be clicked.
    let_draw(window)
    with window.context.expect_page() as coming:
        link.click(modifiers=["ControlOrMeta"])
    opened = coming.value
    until(opened, lambda: f"layer={wanted['layer']}" in opened.url)
    opened.close()
    window.key("t")


def test_a_view_is_taken_along_with_its_caption(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    show(window, "schedule")
    answer = studio.get(f"{RUN}/frames/{FRAME}/views/schedule")
    assert f"frame {FRAME}" in answer["caption"]
    with page.expect_download() as coming:
        page.locator("#panel-views").get_by_role("button", name="CSV", exact=True).click()
    assert coming.value.suggested_filename == f"walk-seen-frame{FRAME}-schedule.csv"
    text = Path(coming.value.path()).read_text()
    assert answer["caption"] in text.splitlines()[0]
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    written = list(csv.DictReader(io.StringIO("\n".join(lines))))
    for row, wanted in zip(written, answer["tables"][0]["rows"], strict=True):
        keys = [column["key"] for column in answer["tables"][0]["columns"]]
        assert float(row["beta"]) == pytest.approx(wanted[keys.index("beta")])
    with page.expect_download() as coming:
        page.locator("#panel-views").get_by_role("button", name="SVG", exact=True).click()
    drawing = ElementTree.parse(coming.value.path()).getroot()
    words = "".join(drawing.itertext())
    assert "Did annealing proceed as asked?" in words
    assert answer["caption"] in words
    assert drawing.findall(".//{http://www.w3.org/2000/svg}path")
    assert window.page.evaluate("document.documentElement.dataset.theme") == "dark"

    page.evaluate("window.print = () => { document.title = document.title + '!'; }")
    page.locator("#panel-views").get_by_role("button", name="PDF", exact=True).click()
    until(page, lambda: page.title() == f"walk-seen-frame{FRAME}-schedule!")
    printed = page.pdf(prefer_css_page_size=True)
    assert printed.startswith(b"%PDF")
    assert printed.count(b"/Type /Page\n") in (0, 1)
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.locator("#paper").count() == 0


STATES = (
    {"panel": "cameras", "camera": "cam2", "through": "cam3", "frame": 2},
    {"panel": "views", "view": "variance", "over": "run", "parameter": "pelvis_rx", "frame": 8},
    {"panel": "views", "view": "genealogy", "layer": 1, "particle": 17, "limb": "left arm"},
    {"panel": "views", "view": "landscape", "parameter": "pelvis_rz", "second": "pelvis_rx"},
    {"panel": "views", "view": "landscape", "towards": "truth", "eye": "1.5,2,1.2,0,0,1"},
)


@pytest.mark.slow
def test_a_copied_address_restores_every_state(
    browser: Browser, window: StudioPage, studio: StudioServer
) -> None:
    """Whatever the page holds in its address, in another browser and after a reload."""
    nothing = dict.fromkeys(HELD[3:])
    fresh = StudioPage(browser, studio, with_scene=False)
    for state in STATES:
        window.page.bring_to_front()
        window.page.evaluate(SET, {"frame": FRAME} | nothing | state)
        window.page.wait_for_timeout(600)
        wanted = {name: window.get(name) for name in HELD}
        assert {name: wanted[name] for name in state} == state
        query = window.page.url.split("?")[1]
        for visit in ("copied", "reloaded") if state is STATES[-1] else ("copied",):
            fresh.page.bring_to_front()
            if visit == "copied":
                fresh.page.goto(f"{studio.origin}/?{query}")
            else:
                fresh.page.reload()
            fresh.until(
                f"get('summary')?.frames.length === {FRAMES} && get('detail')?.frame === get('frame')"
            )
            fresh.page.wait_for_timeout(400)
            assert {name: fresh.get(name) for name in HELD} == wanted, visit
            assert fresh.page.url.split("?")[1] == query
    fresh.close()


def test_back_and_forward_lead_through_the_states(window: StudioPage) -> None:
    window.page.bring_to_front()
    show(window, "variance", layer=1)
    window.page.wait_for_timeout(500)
    for panel in ("cameras", "log"):
        window.page.click(f"[data-panel={panel}]")
        window.until(f"get('panel') === '{panel}'")
        window.page.wait_for_timeout(500)
    window.key("ArrowRight")
    until(window.page, lambda: f"frame={FRAME + 1}" in window.page.url)
    window.page.go_back()
    window.until("get('panel') === 'cameras'")
    window.page.go_back()
    window.until(f"get('panel') === 'views' && get('view') === 'variance' && get('frame') === {FRAME}")
    assert window.get("layer") == 1
    window.page.go_forward()
    window.page.go_forward()
    window.until(f"get('panel') === 'log' && get('frame') === {FRAME + 1}")
    tab = window.page.locator("#tabs [aria-selected=true]")
    assert tab.inner_text() == "Log"


def test_a_what_if_says_what_it_changes_and_is_discarded(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.bring_to_front()
    show(window, "schedule")
    studio.patch(f"{RUN}/settings?frame={FRAME}", {"survival": 0.55})
    bar = page.locator("#trial .outcome")
    bar.wait_for()
    trials = window.get("trials")
    assert isinstance(trials, dict)
    before, after = trials["stored"], trials["trials"][-1]
    assert after["name"] == window.get("trial")
    stored = studio.get(f"{RUN}/frames/{FRAME}")
    line = studio.get(f"{RUN}/frames")["frames"][FRAME]
    assert before["error_mm"] == pytest.approx(line["error_mm"], rel=1e-6)
    assert after["error_mm"] != before["error_mm"]
    assert before["log_weight"] == pytest.approx(stored["log_weight"])
    limbs = bar.locator("tbody th").all_inner_texts()
    assert limbs == ["error", "log weight", "evaluations", "time", *before["limbs"]]
    # Bars mean one thing: to the left and in one colour better, to the right and in the other worse.
    for name, old, new in [("error", before["error_mm"], after["error_mm"])] + [
        (limb, mm, after["limbs"][limb]) for limb, mm in before["limbs"].items()
    ]:
        row = bar.locator("tbody tr", has=page.get_by_role("rowheader", name=name, exact=True))
        expect(row).to_have_class(f"change {'better' if new < old else 'worse'}")
    card = page.locator("#trial").bounding_box()
    stage = page.locator("#stage").bounding_box()
    assert card
    assert stage
    assert card["y"] >= stage["y"] + stage["height"]
    assert "→" in page.locator("#frame-label").inner_text()
    # Both results are outlined in the pictures, and in the charts before stands beside after.
    page.click("[data-panel=cameras]")
    until(page, lambda: "beside=" in str(page.locator(".view img").first.get_attribute("src")))
    drawn = show(window, "schedule")
    window.until("get('whatIf') !== null")
    assert {"stored, reached", "tried, reached", "stored", "tried"} <= {str(one["name"]) for one in drawn}
    page.locator("#trial").get_by_role("button", name="Discard", exact=True).click()
    window.until("get('whatIf') === null && get('trial') === null")
    page.locator("#trial", has_text="tried again").wait_for(state="hidden")
    assert studio.get(f"{RUN}/frames/{FRAME}") == stored
    page.get_by_role("button", name="Put back", exact=True).click()
    page.locator("#trial").wait_for(state="hidden")


def test_a_trial_is_drawn_beside_the_stored_discarded_and_taken_back(
    window: StudioPage, studio: StudioServer
) -> None:
    page = window.page
    page.bring_to_front()
    show(window, "schedule")
    more = LAYERS + 3
    changes = {"survival": 0.7, "layers": more, "particles": 40}
    studio.patch(f"{RUN}/settings?frame={FRAME}", changes)
    window.until(f"get('trial') && get('whatIf')?.length === {more} && get('trials')")
    trial = f"?trial={window.get('trial')}"
    names = list(Workspace(studio.workspace).session("walk").run("seen").record.parameters)
    stored, tried = layers_of(studio), rows_of(studio, "schedule", "layers", trial)
    assert len(tried) == more

    # Maps are cut along the diagonal, on one scale: shares of the stored first layer's variance.
    cells = next(one["data"] for one in show(window, "variance") if one["name"] == "stored and tried")
    variances = rows_of(studio, "variance", "layers", trial)
    for side, rows in ((0, rows_of(studio, "variance", "layers")), (1, variances)):
        drawn = {(cell[0], cell[1]): cell[2] for cell in cells if cell[3] == side}
        wanted = {
            (row["layer"], at): math.log10(row["before"] / stored[0].variance_weighed[at])
            for row in rows
            for at in [names.index(row["parameter"])]
        }
        assert drawn == pytest.approx(wanted, abs=1e-6)
    schedule = show(window, "schedule")
    lines = {str(one["name"]): one["data"] for one in schedule if one["type"] == "line"}
    for key, name in (("beta", "tried"), ("alpha_reached", "tried, reached")):
        assert [row[key] for row in tried] in [one["data"] for one in schedule if one["name"] == name], key
    assert len(lines["stored, reached"]) == more, "over the longer number of layers"
    assert lines["stored, reached"][LAYERS:] == [None] * 3

    # The numbers of each view are held by inspection/test_drawings.py; the panel *Why* has its own way to them.
    page.evaluate(SET, {"panel": "why"})
    until(
        page,
        lambda: any(
            one["name"] == "stored and tried" for one in page.evaluate(OPTION, "#panel-why .figure-chart")
        ),
    )
    page.locator("#trial").get_by_role("button", name="Discard", exact=True).click()
    window.until("get('trial') === null && get('whatIf') === null")
    # The tray keeps it.
    page.locator("#trial .tile").nth(-1).locator(".tile-body").click()
    window.until(f"get('trial') && get('whatIf')?.length === {more}")
    page.locator("#trial").get_by_role("button", name="Put back", exact=True).click()
    window.until("get('trial') === null")


def test_a_trial_of_fewer_layers_is_counted_as_it_is_shown(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.bring_to_front()
    show(window, "variance")
    fewer = LAYERS - 2
    studio.patch(f"{RUN}/settings?frame={FRAME}", {"layers": fewer})
    window.until(f"get('trial') && get('whatIf')?.length === {fewer} && get('trials')")
    words, readout = page.locator("#layer-label"), page.locator("#panel-views .readout")
    window.key("Shift+ArrowRight")
    expect(words).to_contain_text(f"layer 1 of {fewer}")
    expect(readout).to_contain_text(re.compile(r", layer 1: stored: variance .*; tried: variance "))
    # A layer that only what is stored has: named as that, in its own column.
    page.evaluate(SET, {"layer": LAYERS - 1})
    expect(words.locator("span")).to_have_text(f"layer {LAYERS} of {LAYERS}")
    expect(words.locator("small")).to_have_text(f"stored only; tried: {fewer}")
    expect(readout).to_contain_text(
        re.compile(rf", layer {LAYERS}: stored: variance .*; tried: no such layer")
    )
    window.key("Shift+ArrowLeft")
    window.until(f"get('layer') === {fewer - 1}")
    # While layers play the strip says which one is shown.
    window.key("Shift+Space")
    window.until("get('plays') === 'layers' && get('layer') === 0")
    for _ in range(20):
        expect(words.locator("span")).to_have_text(re.compile("^layer "), timeout=100)
        page.wait_for_timeout(50)
    window.key(" ")
    window.until("get('plays') === null")
    page.locator("#trial").get_by_role("button", name="Put back", exact=True).click()
    window.until("get('trial') === null")


def test_a_heading_stays_inside_its_sheet_and_off_the_one_beside_it(window: StudioPage) -> None:
    wide, narrow = window.page.evaluate(
        """async () => {
          const { Sheet, categories, numbers } = await import('/assets/js/view_sheet.js');
          const axes = () => ({ x: categories(['1'], ''), y: numbers() });
          return [540, 380].map((left) => {
            const sheet = new Sheet(left + 110);
            sheet.plot({ left: 300, width: 100, height: 100 }, { title: 'After noise', ...axes() });
            const title = 'left clavicle forward and backward';
            sheet.plot({ left, width: 100, height: 100 }, { title, ...axes() });
            const drawn = sheet.option.title.map(({ text }) => text.slice(3, -1));
            return { width: sheet.width, places: sheet.headings, drawn };
          }); }"""
    )
    for sheet in (wide, narrow):
        first, second = sheet["places"]
        assert second["right"] <= sheet["width"]
        assert second["left"] >= first["right"]
    assert wide["drawn"][1] == "left clavicle forward and backward"
    assert narrow["drawn"][1].endswith("…")


def test_words_of_lines_do_not_cover_each_other_and_limbs_keep_their_looks(window: StudioPage) -> None:
    places = window.page.evaluate(
        """async () => {
          const { Sheet } = await import('/assets/js/view_sheet.js');
          const marks = ['estimate', 'truth', 'searched'].map((word, at) => ({ word, x: 0.5 + 0.001 * at }));
          return [...Sheet.wordPlaces(marks, [0, 1], 400).values()]; }"""
    )
    assert [one["level"] for one in places] == [0, 1, 2]
    looks = window.page.evaluate(
        """async () => {
          const { limbLook } = await import('/assets/js/limb_looks.js');
          const { token } = await import('/assets/js/chart_looks.js');
          const all = ['left arm', 'left leg', 'right arm'];
          return [token('limb-left'), token('limb-right'), limbLook('left leg', all),
            limbLook('left leg', ['left leg']), limbLook('right arm', all), limbLook('left arm', all)]; }"""
    )
    left, right, leg, alone, other, arm = looks
    assert leg == alone, "whatever stands beside it"
    assert (leg["colour"], arm["colour"], other["colour"]) == (left, left, right)
    assert leg["symbol"] != arm["symbol"]


def moved_knobs(window: StudioPage) -> dict[str, tuple[object, object]]:
    """What the page says of knobs that were moved: before and after by label."""
    moved = window.get("moved") or []
    assert isinstance(moved, list)
    return {one["label"]: (one["before"], one["after"]) for one in moved}


@pytest.mark.slow
def test_moved_knobs_are_kept_per_run_until_they_are_put_back(
    browser: Browser, window: StudioPage, studio: StudioServer
) -> None:
    page = window.page
    page.bring_to_front()
    studio.post(
        "/api/sessions/walk/runs", {"name": "beside", "first": 0, "last": 1, "settings": SETTINGS, "seed": 2}
    )
    show(window, "schedule")
    stored = studio.get(f"{RUN}/settings")["values"]
    studio.patch(f"{RUN}/settings?frame={FRAME}", {"survival": 0.5, "particles": 70})
    studio.until(lambda state: state["state"] != "reannealing")
    wanted = {"survival rate": (SETTINGS["survival"], 0.5), "particles": (PARTICLES, 70)}
    window.until("get('moved')?.length === 2 && get('whatIf')")
    assert moved_knobs(window) == wanted
    bar = page.locator("#trial")
    bar.get_by_text("survival rate 0.3 → 0.5").wait_for()
    bar.get_by_text("particles 60 → 70").wait_for()
    until(page, lambda: "trial=" in page.url)
    # Another run, back, and a reload: the knobs of this run are as they were left, and what was annealed, which is not
    # stored, is there as long as the address names it.
    page.locator('.run[data-key="walk/beside"]').click()
    window.until("get('run') === 'beside' && get('moved')?.length === 0")
    bar.wait_for(state="hidden")
    studio.post("/api/sessions/walk/runs/beside/open")
    studio.until(lambda state: state["run"] == "beside")
    page.go_back()
    window.until("get('run') === 'seen' && get('moved')?.length === 2")
    page.reload()
    window.until("get('moved')?.length === 2")
    assert moved_knobs(window) == wanted
    window.until(f"get('trial') && get('whatIf')?.length === {LAYERS}")
    bar.get_by_role("button", name="Discard", exact=True).click()
    window.until("get('trial') === null && get('whatIf') === null")
    # Another browser has the knobs, too; it may put them back.
    fresh = StudioPage(browser, studio, open_at=f"{studio.address}&session=walk&run=seen", with_scene=False)
    fresh.until("get('moved')?.length === 2 && get('detail')")
    assert fresh.get("whatIf") is None
    fresh.page.get_by_role("button", name="Put back", exact=True).click()
    for one in (fresh, window):
        one.page.bring_to_front()
        one.until("get('moved')?.length === 0")
        one.page.locator("#trial").wait_for(state="hidden")
    fresh.close()
    page.bring_to_front()
    assert studio.get(f"{RUN}/settings")["values"] == stored
    assert studio.get(f"{RUN}/settings")["moved"] == {}


def test_a_view_that_is_left_does_not_hold_up_the_next(window: StudioPage) -> None:
    page = window.page
    show(window, "schedule")
    left = list[object]()
    page.route("**/views/coverage*", lambda route: left.append(route))
    page.evaluate(SET, {"view": "coverage"})
    until(page, lambda: bool(left))
    show(window, "variance")
    page.unroute("**/views/coverage*")
    # Asked for again it comes: nothing of the request that was broken off is kept.
    show(window, "coverage")


PLACES = """async () => {
  const echarts = await import('/assets/vendor/echarts.esm.min.js');
  const place = document.querySelector('#panel-views .figure-chart');
  const { grid, title } = echarts.getInstanceByDom(place).getOption();
  const pen = document.createElement('canvas').getContext('2d');
  pen.font = '12px Inter, system-ui, sans-serif';
  const words = (text) => text.replaceAll(/[{][ab][|]|[}]/g, '');
  return {
    width: place.clientWidth,
    plots: grid.map((one) => [one.left, one.top, one.left + one.width, one.top + one.height]),
    headings: title.map((one) => {
      const wide = pen.measureText(words(one.text)).width;
      return [one.left, one.top, one.left + wide, one.top + 12, words(one.text)];
    }),
  };
}"""


def lie_apart(boxes: list[list[float]]) -> bool:
    """Whether no two boxes (left, top, right, bottom) share anything."""
    return all(
        one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
        for at, one in enumerate(boxes)
        for other in boxes[:at]
    )


@pytest.mark.slow
def test_where_it_is_narrow_no_plot_or_heading_lies_on_another(
    window: StudioPage, studio: StudioServer
) -> None:
    page = window.page
    size = page.viewport_size
    assert size is not None
    page.set_viewport_size({"width": 480, "height": 800})
    try:
        views = studio.get("/api/views")["views"]
        for name in [one["name"] for one in views if one["name"] != "why" and not one["is_job"]]:
            show(window, name)
            until(page, window.charts_drawn)
            found = page.evaluate(PLACES)
            assert lie_apart(found["plots"]), name
            assert lie_apart(found["headings"]), (name, found["headings"])
            assert max(box[2] for box in found["plots"]) <= found["width"], name
    finally:
        page.set_viewport_size(size)


@pytest.mark.slow
def test_the_views_look_designed(window: StudioPage, artefacts: Path) -> None:
    page = window.page
    for theme in ("dark", "light"):
        for width, height in ((1024, 720), (1280, 800), (1920, 1080), (2560, 1440)):
            page.set_viewport_size({"width": width, "height": height})
            for view in ("variance", "clouds") if width in (1024, 2560) else ("genealogy", "blame"):
                page.evaluate(SET, {"panel": "views", "view": view, "frame": FRAME, "over": None})
                body = page.locator("#panel-views .figure-body")
                expect(body).to_have_attribute("data-drawn", re.compile(f"{view} {theme}"), timeout=PATIENCE)
                page.wait_for_timeout(500)
                window.shoot(artefacts / f"view-{view}-{theme}-{width}x{height}.png")
                assert page.evaluate("document.documentElement.scrollWidth") == width
                assert page.evaluate("document.documentElement.scrollHeight") == height
        page.click("#theme")
    page.set_viewport_size({"width": 1280, "height": 800})


def test_a_large_picture_follows_the_timeline(window: StudioPage) -> None:
    page = window.page
    page.evaluate(SET, {"panel": "cameras", "frame": FRAME})
    page.locator(".view").nth(1).click()
    large = page.locator("dialog.large-view img")
    until(page, lambda: f"/frames/{FRAME}/views/cam2.jpg" in str(large.get_attribute("src")))
    page.keyboard.press("ArrowRight")
    window.until(f"get('frame') === {FRAME + 1}")
    until(page, lambda: f"/frames/{FRAME + 1}/views/cam2.jpg" in str(large.get_attribute("src")))
    page.keyboard.press("Escape")
    large.wait_for(state="detached" if not large.count() else "hidden")


def test_nothing_that_is_drawn_is_made_up(window: StudioPage, studio: StudioServer) -> None:
    """What why says stands in the panel, word by word."""
    window.page.evaluate(SET, {"panel": "why", "frame": FRAME, "trial": None, "whatIf": None})
    answer = studio.get(f"{RUN}/frames/{FRAME}/views/why")
    words = window.page.locator(".why-words")
    # What another test tried of the frame goes.
    expect(words.locator(".tried-words")).to_have_count(0)
    for finding in answer["findings"]:
        words.get_by_text(finding["words"]).wait_for()
    rows = rows_of(studio, "why", "limbs", run=True)
    wanted = sorted(row["error"] for row in rows)

    def is_drawn() -> bool:
        drawn = window.page.evaluate(OPTION, "#panel-why .figure-chart")
        heats = [one["data"] for one in drawn if one["type"] == "heatmap"]
        return len(heats) == 1 and sorted(cell[2] for cell in heats[0]) == pytest.approx(wanted)

    # The chart is drawn after the words, perhaps over what another test showed.
    until(window.page, is_drawn)


@pytest.mark.slow
def test_stored_runs_are_compared_side_by_side(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.bring_to_front()
    runs = "/api/sessions/walk/runs"
    for name, survival in (("second", 0.6), ("third", 0.15)):
        studio.post(
            runs, {"name": name, "last": FRAMES, "settings": SETTINGS | {"survival": survival}, "seed": 3}
        )
        studio.post(f"{runs}/{name}/start")
        studio.until(lambda state, name=name: state["run"] == name and state["state"] == "finished")
    window.until("get('sessions')[0].runs.length >= 3 && get('run') === 'seen'")
    page.locator('.run[data-key="walk/seen"]').hover()
    window.choose(page.locator('.run[data-key="walk/seen"] .more'), "Compare with…")
    form = page.locator("dialog form")
    for name in ("second", "third"):
        form.locator(f'[name="walk/{name}"]').check()
    form.get_by_role("button", name="Compare", exact=True).click()
    window.until("get('panel') === 'compare' && get('compared')?.split(',').length === 2")
    answer = studio.get("/api/compared-runs?run=walk/seen&run=walk/second&run=walk/third")
    tables = {table["name"]: table for table in answer["tables"]}
    figure = "#panel-compare .figure-chart"
    until(page, lambda: len(page.evaluate(OPTION, figure)) > 6)
    drawn = page.evaluate(OPTION, figure)
    keys = [column["key"] for column in tables["curves"]["columns"]]
    rows = [dict(zip(keys, row, strict=True)) for row in tables["curves"]["rows"]]
    curves = {name: [row["error"] for row in rows if row["run"] == name] for name in answer["runs"]}
    for name, curve in curves.items():
        assert curve in [one["data"] for one in drawn if one["name"] == name]
    apart = [other - own for own, other in zip(curves["walk/seen"], curves["walk/third"], strict=True)]
    assert any(
        np.allclose(one["data"], apart)
        for one in drawn
        if one["name"] == "walk/third" and len(one["data"]) == FRAMES
    )
    page.locator("#panel-compare").get_by_role("cell", name="survival", exact=True).wait_for()
    # Their outlines stand in the camera pictures, each in its colour.
    page.click("[data-panel=cameras]")
    others = [name.removeprefix("walk/") for name in answer["runs"][1:]]
    ordered = [name.removeprefix("walk/") for name in str(window.get("compared")).split(",")]
    assert sorted(ordered) == sorted(others)
    wanted = f"compared={'%2C'.join(ordered)}"
    until(page, lambda: wanted in str(page.locator(".view img").first.get_attribute("src")))
    assert page.locator(".run-colours > span").all_inner_texts() == ["seen", *ordered]
    page.click("[data-panel=compare]")
    worst = dict(zip([row[0] for row in tables["worst"]["rows"]], tables["worst"]["rows"], strict=True))
    page.locator('[data-key="worst-walk/third"]').click()
    window.until(f"get('frame') === {worst['walk/third'][1]}")
    page.get_by_role("button", name="walk/third", exact=True).click()
    window.until("get('run') === 'third' && get('compared') === 'walk/seen,walk/second'")
    assert window.get("frame") == worst["walk/third"][1]
    page.go_back()
    window.until("get('run') === 'seen' && get('compared') === 'walk/third,walk/second'")


def test_a_frame_s_seeds_are_searched_and_drawn(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.bring_to_front()
    page.evaluate(SET, {"panel": "views", "view": "seeds", "frame": FRAME, "compared": None})
    field = page.get_by_label("How many other seeds")
    field.fill("3")
    field.press("Tab")
    page.get_by_role("button", name="Search with other seeds", exact=True).click()
    page.locator("#panel-views .readout", has_text="Monte-Carlo error").wait_for()
    rows = rows_of(studio, "seeds", "limbs")
    drawn = {str(one["name"]): one["data"] for one in page.evaluate(OPTION, FIGURE)}
    for name, key in (
        ("within a seed", "within"),
        ("between seeds", "between"),
        ("Monte-Carlo error", "error"),
    ):
        assert [bar["value"] for bar in drawn[name]] == pytest.approx([row[key] for row in rows])
    assert len(rows_of(studio, "seeds", "seeds")) >= 3


def test_how_far_off_joints_may_be_is_measured_and_drawn(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.bring_to_front()
    page.evaluate(SET, {"panel": "views", "view": "uncertainty", "frame": FRAME, "compared": None})
    page.get_by_role("button", name="Measure how far off joints may be").click()
    cancel = page.locator("#panel-views").get_by_role("button", name="Cancel", exact=True)
    cancel.wait_for()
    page.reload()
    cancel.wait_for()
    page.locator("#panel-views .readout", has_text="of frames no farther off than").wait_for(timeout=LONG)
    rows = rows_of(studio, "uncertainty", "joints", run=True)
    assert len(rows) == 15
    drawn = {str(one["name"]): one["data"] for one in page.evaluate(OPTION, FIGURE)}
    assert drawn["50 %"] == pytest.approx([row["within_50"] for row in rows])
    coverage = rows_of(studio, "uncertainty", "coverage", run=True)
    known = [[row["promised"], row["true"]] for row in coverage if row["true"] is not None]
    assert [dot["value"] for dot in drawn["truth"]] == known


def test_why_says_first_whose_fault_the_error_is(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.bring_to_front()
    page.evaluate(SET, {"panel": "why", "frame": FRAME, "compared": None})
    first = page.locator("#panel-why .why-findings li").first
    first.wait_for()
    assert not first.inner_text().startswith("Mostly the")
    page.get_by_role("button", name="Search this frame for long").click()
    until(page, lambda: first.inner_text().startswith("Mostly the"))
    whole = page.locator("#panel-why h3", has_text="Whose fault is the error?").locator("+ p")
    assert whole.inner_text().startswith("Mostly the ")
    [row] = rows_of(studio, "why", "parts", run=True)
    assert row["frame"] == FRAME


def test_a_new_run_shows_what_it_costs_and_may_only_be_made(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.bring_to_front()
    page.locator(".session.open .new-run").click()
    form = page.locator("dialog form")
    assert form.locator("[name=knob-particles]").input_value() == "100"
    form.get_by_text("1000 evaluations a frame").wait_for()
    form.locator("[name=knob-particles]").fill("40")
    form.locator("[name=knob-survival]").fill("0.45")
    form.locator("[name=knob-survival]").press("Tab")
    form.get_by_text("400 evaluations a frame").wait_for()
    form.locator("[name=name]").fill("made")
    form.locator("[name=last]").fill("4")
    form.locator("[name=start]").uncheck()
    form.get_by_role("button", name="Track", exact=True).click()
    window.until("get('run') === 'made'")
    made = studio.get("/api/sessions/walk/runs/made")
    assert (made["settings"]["particles"], made["settings"]["survival"]) == (40, 0.45)
    assert made["settings"]["layers"] == 10
    assert studio.get("/api/worker")["run"] != "made"
