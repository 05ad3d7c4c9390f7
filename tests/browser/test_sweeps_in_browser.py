"""A sweep in the page: what it takes is said, its runs are drawn and opened, one of them is given away as a page."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect
from scene_wire import until
from studio_page import StudioPage
from toy_session import make_session

pytestmark = pytest.mark.browser

SWEEP = "/api/comparisons/toy/sweep-1"
FIGURES = ("parallel", "map", "curve")


@pytest.fixture(scope="module")
def workspace(workspace: Path) -> Path:
    """With the toy arm, which has no truth."""
    make_session(workspace / "toy")
    return workspace


@pytest.mark.slow
def test_a_sweep_is_begun_and_watched(window: StudioPage) -> None:
    page = window.page
    window.watch.allow(422, "/api/comparisons/sweeps/expected")
    page.goto(f"{window.studio.origin}/comparisons?new=sweep&session=toy")
    form = page.locator(".compare-form")
    values = form.locator("[aria-label=Values]")
    expect(values).to_have_count(2)
    values.nth(0).fill("0.2, 7")
    expect(form.locator(".wrong")).to_contain_text("'survival' cannot be '7'")
    values.nth(0).fill("0.2, 0.5")
    values.nth(1).fill("10, 20")
    form.locator("[name=fixed]").fill("layers=2")
    form.locator("[name=seeds]").fill("2")
    form.locator("[name=last]").fill("2")
    form.locator("[name=shape]").uncheck()
    expect(form.locator("[role=status]")).to_contain_text(
        "8 runs of 3 frames · 720 evaluations · how long that takes is known once the first one is done"
    )
    form.get_by_role("button", name="Start the sweep").click()
    page.get_by_role("heading", name="Sweep of survival, particles on toy").wait_for()
    page.locator(".sweep-figure").first.wait_for(timeout=180_000)
    assert window.studio.get(SWEEP)["comparison"]["status"] == "done"


@pytest.mark.slow
def test_what_is_drawn_is_the_result_and_opens_the_runs(window: StudioPage, artefacts: Path) -> None:
    page = window.page
    result = window.studio.get(SWEEP)["result"]
    until(page, window.charts_drawn)
    window.shoot(artefacts / "page-sweep-dark-1280x800.png")
    page.get_by_role("button", name="Again…").click()
    form = page.locator(".compare-form")
    expect(form.locator("[name=fixed]")).to_have_value("layers=2")
    expect(form.locator("[name=seeds]")).to_have_value("2")
    expect(form.locator("[name=last]")).to_have_value("2")
    expect(form.locator("[name=shape]")).not_to_be_checked()
    expect(form.locator("[name=inconsistent]")).not_to_be_visible()
    page.locator(".entry", has_text="sweep-1").click()
    until(page, window.charts_drawn)
    for name in FIGURES:
        figure = page.locator(f".sweep-figure[data-key={name}]")
        figure.get_by_role("button", name="Table", exact=True).click()
        rows = figure.locator("table").first.locator("tbody tr")
        expect(rows).to_have_count(8)
        first = rows.first.locator("td").all_inner_texts()
        assert first[3] == result["tables"][0]["rows"][0][3] == "sweep-1-p1-s0"
        figure.get_by_role("button", name="Table", exact=True).click()
    page.locator(".sweep-choices select").first.select_option("search_lost")
    expect(page.locator(".sweep-figure[data-key=map] .readout")).to_contain_text("Least at")
    page.locator(".sweep-choices select").first.select_option("overlap")
    with page.expect_download() as kept:
        page.locator(".sweep-figure[data-key=curve]").get_by_role("button", name="CSV").click()
    text = Path(kept.value.path()).read_text()
    assert text.startswith("# One knob. Session toy, sweep sweep-1: survival 0.2, 0.5; particles 10, 20;")
    assert text.count("sweep-1-p") == 8

    # The cell of survival 0.2 and particles 10, at the bottom left.
    until(page, window.charts_drawn)
    box = page.locator(".sweep-figure[data-key=map] .figure-chart").bounding_box()
    page.mouse.click(box["x"] + 150, box["y"] + box["height"] - 90)
    page.wait_for_url(re.compile(r"run=sweep-1-p1-s[01]"))
    window.until("get('frame') !== null && get('run')")
    (row,) = (one for one in result["tables"][0]["rows"] if one[3] == window.get("run"))
    assert window.get("frame") == row[-1]
    # Its runs stand under one line, open as one of them is shown.
    assert page.locator(".run.swept").inner_text().startswith("▾ sweep-1")
    assert page.locator(".runs .run:not(.swept)").count() == 8


@pytest.mark.slow
def test_a_run_is_given_away_as_a_page(
    browser: Browser, window: StudioPage, tmp_path: Path, artefacts: Path
) -> None:
    line = window.page.locator(".run[aria-selected=true]")
    line.hover()
    with window.page.expect_download() as kept:
        window.choose(line.locator(".more"), "Share as one page…")
        window.page.get_by_role("button", name="Save the page", exact=True).click()
    path = tmp_path / kept.value.suggested_filename
    kept.value.save_as(path)
    assert path.name == f"toy-{window.get('run')}.html"
    wrong: list[str] = []
    context = browser.new_context(viewport={"width": 1280, "height": 800}, offline=True)
    page = context.new_page()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None)
    page.on(
        "request",
        lambda asked: wrong.append(asked.url) if not asked.url.startswith(("file:", "data:")) else None,
    )
    page.goto(path.as_uri())
    expect(page.locator("h1")).to_have_text(f"toy / {window.get('run')}")
    # The layers of the frame that is looked into play by themselves.
    layer = page.locator(".shared-layers output")
    expect(layer).to_have_text(re.compile(r"layer 1 of \d+ · \d+ particles"))
    expect(layer).to_have_text(re.compile(r"layer 2 of \d+"))
    page.get_by_role("button", name="Pause layers").click()
    figures = page.locator(".shared-figure")
    expect(figures).to_have_count(6)
    until(page, lambda: page.locator(".figure-body[data-drawn]").count() == 6)
    readout = page.locator("[data-key=frames-run] .readout")
    for frame in (0, 2):
        page.get_by_label("Frame", exact=True).fill(str(frame))
        expect(page.locator(".shared-transport:not(.shared-layers) output")).to_have_text(f"frame {frame}")
        expect(readout).to_contain_text(f"Frame {frame}:")
    drawn = (
        "canvas => canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some(Boolean)"
    )
    assert page.locator(".shared-scene").evaluate(drawn)
    page.locator("#theme").click()
    until(page, lambda: page.locator(".figure-body").evaluate_all("all => all.length") == 6)
    page.screenshot(path=artefacts / "page-shared.png")
    context.close()
    assert not wrong
