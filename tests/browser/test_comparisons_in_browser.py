"""Comparisons and reports in the page: asked for, watched, cancelled, gone on with, read, downloaded, thrown away."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Locator
from scene_wire import until
from studio_page import StudioPage
from studio_server import StudioServer

from studio.garden.reproduction.experiment import Experiment
from studio.results.comparison.findings import Chart, Findings, Number, Series, Table
from studio.results.comparison.findings_document import Making, as_document
from studio.results.comparison.trials import Scale

pytestmark = pytest.mark.browser

DRAWN = """theme => [...document.querySelectorAll('.findings-canvas')].every((canvas) =>
  !canvas.dataset.drawn || canvas.dataset.drawn === theme)"""
FIRST = "/api/comparisons/walk/small"


@pytest.fixture(scope="module")
def studio(studio: StudioServer) -> StudioServer:
    """With the sample, which has a truth."""
    studio.post("/api/samples", {"name": "walk"})
    return studio


@pytest.fixture
def idle(window: StudioPage) -> StudioPage:
    """The window with no comparison running, however the test before ended."""
    for line in window.studio.get("/api/comparisons?session=walk")["comparisons"]:
        if line["status"] in ("queued", "running"):
            window.studio.post(f"/api/comparisons/walk/{line['name']}/cancel")
    busy = ("queued", "running", "cancelling")
    until(
        window.page,
        lambda: all(
            line["status"] not in busy
            for line in window.studio.get("/api/comparisons?session=walk")["comparisons"]
        ),
    )
    return window


def fill(window: StudioPage, **values: str) -> Locator:
    """Fill the form of a new comparison."""
    form = window.page.locator(".compare-form")
    for name, value in values.items():
        form.locator(f"[name={name}]").fill(value)
    return form


def shoot(window: StudioPage, artefacts: Path, name: str) -> None:
    """Pictures in both themes."""
    page = window.page
    for theme in ("dark", "light"):
        if page.evaluate("document.documentElement.dataset.theme") != theme:
            page.click("#theme")
        page.wait_for_function(DRAWN, arg=theme)
        window.shoot(artefacts / f"page-{name}-{theme}-1280x800.png")
        assert page.evaluate("document.documentElement.scrollWidth") == 1280
        assert page.evaluate("document.documentElement.scrollHeight") == 800
    page.click("#theme")


def test_the_studio_leads_to_comparing(window: StudioPage, artefacts: Path) -> None:
    page = window.page
    window.until("get('session') === 'walk'")
    page.locator(".session > .head").hover()
    window.choose(page.locator(".session > .head .more"), "Compare trackers…")
    page.get_by_role("heading", name="Compare trackers").wait_for()
    form = page.locator(".compare-form")
    assert form.locator("[name=session]").input_value() == "walk"
    assert form.locator("[name=last]").input_value() == "149"
    names = [row.locator("select").first.input_value() for row in form.locator(".candidate").all()]
    assert names == ["annealed", "swarm", "condensation"]
    shoot(window, artefacts, "compare-form")


def test_what_cannot_be_compared_is_reported_in_the_form(window: StudioPage) -> None:
    window.watch.allow(422, "/api/comparisons")
    form = fill(window, evaluations="30")
    form.get_by_role("button", name="Compare", exact=True).click()
    form.locator(".wrong", has_text="too few").wait_for()
    form.locator("[aria-label=Knobs]").first.fill("survival")
    form.get_by_role("button", name="Compare", exact=True).click()
    form.locator(".wrong", has_text="“survival” is not a knob with a value").wait_for()
    form.locator("[aria-label=Knobs]").first.fill("survival=7")
    fill(window, evaluations="200")
    form.get_by_role("button", name="Compare", exact=True).click()
    form.locator(".wrong", has_text="'survival' cannot be '7'").wait_for()


@pytest.mark.slow
def test_it_is_watched_cancelled_and_goes_on(window: StudioPage, artefacts: Path) -> None:
    page = window.page
    form = fill(window, evaluations="200", seeds="60", last="9", name="long")
    form.locator("[aria-label=Knobs]").first.fill("")
    form.get_by_text("180 trials of 10 frames").wait_for()
    form.get_by_role("button", name="Compare", exact=True).click()
    page.get_by_role("heading", name="annealed, swarm, condensation on walk").wait_for()
    page.locator(".progress-words", has_text="left · last:").wait_for(timeout=180_000)
    shoot(window, artefacts, "comparison-running")
    page.get_by_role("button", name="Cancel", exact=True).click()
    page.locator(".card-box .badge", has_text="cancelled").wait_for()
    response = window.studio.get("/api/comparisons/walk/long")["comparison"]
    assert response["status"] == "cancelled"
    assert 0 < response["done"] < response["total"] == 180
    page.get_by_role("button", name="Resume", exact=True).click()
    page.locator(".card-box .badge", has_text="running").wait_for()
    page.get_by_role("button", name="Cancel", exact=True).click()
    page.locator(".card-box .badge", has_text="cancelled").wait_for()
    assert window.studio.get("/api/comparisons/walk/long")["comparison"]["done"] >= response["done"]


@pytest.mark.slow
def test_a_small_one_is_shown_when_it_is_done(idle: StudioPage) -> None:
    window, page = idle, idle.page
    page.get_by_role("button", name="+ New", exact=True).click()
    form = fill(window, evaluations="200", seeds="2", last="9", name="small")
    form.locator("[aria-label=Knobs]").first.fill("survival=0.4, crossover=0.2")
    form.locator("[aria-label=Label]").first.fill("mine")
    form.get_by_text("6 trials of 10 frames").wait_for()
    form.get_by_role("button", name="Compare", exact=True).click()
    page.get_by_role("heading", name="annealed:mine, swarm, condensation on walk").wait_for()
    page.get_by_role("heading", name="Which is nearer").wait_for(timeout=120_000)
    response = window.studio.get(FIRST)
    assert response["comparison"]["status"] == "done"
    assert response["settings"]["annealed:mine"]["survival"] == 0.4


@pytest.mark.slow
def test_the_result_is_read_and_downloaded(window: StudioPage, artefacts: Path) -> None:
    page, result = window.page, window.studio.get(FIRST)["result"]
    rows = page.locator(".figures:not(.trials) tbody tr")
    assert rows.count() == 3
    for at, tracker in enumerate(result["trackers"]):
        text = rows.nth(at).inner_text()
        assert tracker["tracker"] in text
        assert f"{tracker['mean_mm']:.1f}" in text
    # Six seeds drawn thin, three means thick.
    curves = page.locator(".findings-chart").first
    until(page, lambda: curves.locator(".findings-canvas").get_attribute("data-drawn"))
    assert curves.locator(".findings-legend button").count() == 3
    words = page.locator(".words").inner_text()
    assert words.count(" is nearer than ") == 3
    assert "it does not prove" in words
    assert "cannot fall below 0.5" in words
    shoot(window, artefacts, "comparison")
    page.locator("#content").evaluate("element => element.scrollTo(0, 1e6)")
    page.wait_for_function("document.querySelectorAll('.findings-canvas[data-drawn]').length === 2")
    shoot(window, artefacts, "comparison-below")
    with page.expect_download() as coming:
        page.get_by_role("link", name="JSON", exact=True).click()
    assert json.loads(Path(coming.value.path()).read_text())["trackers"] == result["trackers"]
    with page.expect_download() as coming:
        page.get_by_role("link", name="CSV", exact=True).click()
    assert len(Path(coming.value.path()).read_text().splitlines()) == 1 + 3 * 2 * 10


@pytest.mark.slow
def test_a_trial_is_opened_as_a_run_at_its_worst_frame(window: StudioPage) -> None:
    page, response = window.page, window.studio.get(FIRST)
    lines = page.locator(".trials tbody tr")
    assert lines.count() == len(response["trials"]) == 6
    trial = response["trials"][3]
    errors = response["result"]["per_frame"]["error_mm"][trial["tracker"]][1]
    assert trial["worst_frame"] == errors.index(max(errors))
    name = f"Track {trial['tracker']} with seed {trial['seed']} again"
    # Its frame is asked for until it is tracked.
    run = f"small-{trial['tracker'].replace(':', '-')}-{trial['seed']}"
    window.watch.allow(404, f"/api/sessions/walk/runs/{run}/frames/{trial['worst_frame']}")
    page.get_by_role("button", name=name).click()
    page.wait_for_url("**/?*panel=why*")
    frame = trial["worst_frame"]
    window.until(f"get('frame') === {frame} && get('panel') === 'why' && get('detail')?.frame === {frame}")
    window.studio.until(lambda state: state["state"] == "finished")
    assert window.get("run") == run
    stored = window.studio.get(f"/api/sessions/walk/runs/{run}/frames")["frames"][frame]
    assert stored["error_mm"] == pytest.approx(max(errors), abs=2e-3)
    # From then on the row is a link.
    page.go_back()
    link = lines.nth(3).get_by_role("link", name=f"frame {frame}", exact=True)
    link.click()
    page.wait_for_url("**/?*panel=why*")
    window.until(f"get('run') === '{run}' && get('frame') === {frame} && get('panel') === 'why'")
    page.go_back()
    link.wait_for()


@pytest.mark.slow
def test_points_of_the_charts_lead_to_their_trials(window: StudioPage) -> None:
    page, response = window.page, window.studio.get(FIRST)
    other, stored = response["trials"][2:4]
    assert (stored["run"] != "", other["run"]) == (True, "")
    curves, bars = page.locator(".findings-canvas").all()
    # A trial without a run, the middle one of three bars: nothing is tracked, the button that does it has the focus.
    button = page.get_by_role("button", name=f"Track {other['tracker']} with seed {other['seed']} again")
    click_value(bars, 0, other["mean_mm"] / 2, lambda: is_focused(button))
    assert window.studio.get(FIRST)["trials"][2]["run"] == ""
    # The curve of a seed, at a frame.
    errors = response["result"]["per_frame"]["error_mm"][stored["tracker"]][1]
    click_value(curves, 7, errors[7], lambda: "panel=why" in page.url)
    window.until(f"get('run') === '{stored['run']}' && get('frame') === 7")
    page.go_back()
    page.locator(".trials").wait_for()


def is_focused(element: Locator) -> bool:
    return element.evaluate("element => element === document.activeElement")


def click_value(chart: Locator, x: float, y: float, done: Callable[[], bool]) -> None:
    """Click on a chart where a value is drawn, again while nothing came of it: a bar that is drawn anew for the
    window's size is there again a moment later.
    """
    chart.scroll_into_view_if_needed()
    until(chart.page, lambda: chart.get_attribute("data-drawn"))
    for _ in range(10):
        across, down = chart.evaluate(
            """async (place, value) => (await import('/assets/vendor/echarts.esm.min.js'))
              .getInstanceByDom(place).convertToPixel('grid', value)""",
            [x, y],
        )
        chart.click(position={"x": across, "y": down})
        for _ in range(10):
            if done():
                return
            chart.page.wait_for_timeout(200)
    raise AssertionError(f"clicks at {x}, {y} lead nowhere")


@pytest.mark.slow
def test_again_asks_for_the_same(window: StudioPage) -> None:
    page = window.page
    page.get_by_role("button", name="Again…", exact=True).click()
    form = page.locator(".compare-form")
    form.wait_for()
    assert form.locator("[name=evaluations]").input_value() == "200"
    assert form.locator("[aria-label=Label]").first.input_value() == "mine"
    assert "survival=0.4" in form.locator("[aria-label=Knobs]").first.input_value()
    assert "particles" not in form.locator("[aria-label=Knobs]").first.input_value()
    form.locator("[aria-label=Line-up]").select_option("improvements")
    assert form.locator(".candidate").count() == 3
    form.get_by_text("Eq. 13 as Deutscher & Reid print it").wait_for()


@pytest.mark.slow
def test_it_is_listed_with_its_session_thrown_away_and_restored(window: StudioPage) -> None:
    page = window.page
    page.get_by_role("link", name="Studio", exact=True).click()
    window.until("get('session') === 'walk'")
    page.get_by_role("link", name="2 comparisons").click()
    page.get_by_role("heading", name="Which is nearer").wait_for()
    page.get_by_role("button", name="Delete…", exact=True).click()
    page.locator("dialog form").get_by_role("button", name="Delete", exact=True).click()
    page.get_by_role("heading", name="annealed, swarm, condensation on walk").wait_for()
    assert page.locator(".entry").count() == 1
    page.get_by_role("link", name="Studio", exact=True).click()
    line = page.locator("#trash-line")
    window.choose(line.get_by_role("button", name="Restore…", exact=True), "walk / small (comparison)")
    page.get_by_role("heading", name="Which is nearer").wait_for()


def test_reports_are_empty_until_something_was_reproduced(
    window: StudioPage, studio: StudioServer, artefacts: Path
) -> None:
    page = window.page
    page.get_by_role("link", name="Reports", exact=True).click()
    page.get_by_text("Nothing is reproduced yet").wait_for()
    page.get_by_role("button", name="Run it", exact=True).wait_for()
    shoot(window, artefacts, "reports-empty")
    folder = studio.workspace / "reproduction"
    folder.mkdir()
    results = {"software": "test", "date": "2026-11-21", "experiments": [found("one"), found("two")]}
    (folder / "results.json").write_text(json.dumps(results))
    page.reload()
    page.get_by_role("heading", name="Summary").wait_for()
    assert page.locator(".findings-experiment").count() == 2
    page.locator(".findings-badge", has_text="reproduced").first.wait_for()
    shoot(window, artefacts, "reports")
    with page.expect_download() as coming:
        page.get_by_role("link", name="JSON", exact=True).click()
    assert json.loads(Path(coming.value.path()).read_text()) == results


def found(name: str) -> dict:
    """An experiment's document."""
    experiment = Experiment(
        name, f"Experiment {name}", "Fleischmann et al. 2012, Table 2", "The mean error is 38.0 mm.",
        trials=lambda _: (), measure=lambda _arguments, _shelf: {}, shown=lambda _: (),
    )  # fmt: skip
    line = Series("ours", (0.0, 1.0, 2.0), (30.0, 36.0, 33.0), group="ours")
    findings = Findings(
        "reproduced",
        "It is as the paper has it.",
        (Number("mean error", 37.2, 35.9, 38.6, "mm", 38.0, "lower", 10, "reproduced"),),
        (Table("All seeds", ("seed", "mean (mm)"), ((0, 36.9), (1, 37.5))),),
        (Chart("Error", "lines", "frame", "error (mm)", (line,)),),
    )
    return as_document(
        experiment, findings, Making(Scale(tuple(range(10))), 10, 12.0, "test", (), "2026-11-21")
    )
