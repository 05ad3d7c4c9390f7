"""The report from its file alone: no server, no network, all charts drawn, light and dark."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect
from toy_experiments import measure, toy

from studio.garden.reproduction.report_document import report_html
from studio.results.comparison.findings_document import Making, as_document, failed_document
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.trials import Outcome, Scale

pytestmark = pytest.mark.browser
SEEDS = tuple(range(12))
PATIENCE = 120_000  # milliseconds, for a machine that does much else


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of one concluded and one failed experiment."""
    folder = tmp_path_factory.mktemp("report")
    experiment = toy("toy", folder / "log")
    trials = experiment.trials(Scale(SEEDS))
    outcomes = [Outcome(trial, plain(measure(trial.arguments, None))) for trial in trials]  # pyright: ignore
    making = Making(Scale(SEEDS), 24, 100.0, "0.1.0", ("0.1.0",), "2025-01-02T03:04:05+00:00")
    documents = [
        as_document(experiment, experiment.conclude(outcomes), making),
        failed_document(toy("bad", folder / "log"), [("seed 1", "<img src=x onerror=alert(1)>")], making),
    ]
    path = folder / "report.html"
    path.write_text(report_html({"software": "0.1.0", "date": making.date, "experiments": documents}))
    return path


@pytest.fixture
def page(browser: Browser, report: Path):
    """The report, opened; whatever it asks for beyond itself, and every error, fails the test."""
    wrong: list[str] = []
    context = browser.new_context(viewport={"width": 1280, "height": 800}, color_scheme="light", offline=True)
    context.set_default_timeout(PATIENCE)
    opened = context.new_page()
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    opened.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    opened.on("dialog", lambda dialog: wrong.append(dialog.message))
    opened.on(
        "request",
        lambda asked: wrong.append(asked.url) if not asked.url.startswith(("file:", "data:")) else None,
    )
    opened.goto(report.as_uri())
    yield opened
    context.close()
    assert not wrong


def test_verdicts_claims_numbers_and_failures_are_there(page: Page) -> None:
    rows = page.locator(".findings-summary tbody tr")
    expect(rows).to_have_count(2)
    expect(rows.nth(0)).to_contain_text("reproduced")
    expect(rows.nth(0)).to_contain_text("paper 40")
    expect(rows.nth(1)).to_contain_text("failed")
    section = page.locator("#experiment-toy")
    expect(section.locator("blockquote")).to_contain_text("ten below the plain one")
    expect(section.locator(".findings-numbers tbody tr")).to_have_count(3)
    expect(section.locator(".findings-whisker .paper")).to_have_count(2)
    expect(section.locator("details.findings-settings")).not_to_have_attribute("open", "")
    expect(page.locator("#experiment-bad .findings-failures")).to_contain_text("<img src=x onerror=alert(1)>")
    page.locator(".findings-contents a").nth(1).click()
    expect(page.locator("#experiment-bad")).to_be_in_viewport()


def test_every_chart_is_drawn_in_both_themes(page: Page, artefacts: Path) -> None:
    charts = page.locator(".findings-canvas")
    expect(charts).to_have_count(4)
    for index in range(4):
        charts.nth(index).scroll_into_view_if_needed()
        expect(charts.nth(index)).to_have_attribute("data-drawn", "light")
    lines, bars, points, heat = (charts.nth(index).locator("svg") for index in range(4))
    expect(lines).to_contain_text("paper 38")
    expect(lines).to_contain_text("still")
    expect(lines).to_contain_text("error (mm)")
    expect(bars).to_contain_text("clever")
    expect(points).to_contain_text("particles")
    expect(heat).to_contain_text("holes (%)")
    thick = page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--series-0')").strip()
    assert lines.locator(f"path[stroke='{thick}'][stroke-width='2.2']").count() == 1
    assert lines.locator(f"path[stroke='{thick}'][stroke-opacity='0.3']").count() == len(SEEDS)
    page.locator("#theme").click()
    expect(lines).to_be_attached()
    expect(charts.nth(0)).to_have_attribute("data-drawn", "dark")
    assert lines.locator(f"path[stroke='{thick}']").count() == 0
    artefacts.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=str(artefacts / "report-dark.png"), full_page=True)


def test_a_legend_entry_hides_its_line_with_all_its_seeds(page: Page) -> None:
    chart = page.locator(".findings-chart").nth(0)
    chart.scroll_into_view_if_needed()
    colour = page.evaluate(
        "getComputedStyle(document.documentElement).getPropertyValue('--series-1')"
    ).strip()
    paths = chart.locator(f"svg path[stroke='{colour}']")
    expect(paths).to_have_count(1 + len(SEEDS))
    chart.get_by_role("button", name="clever").click()
    expect(paths).to_have_count(0)
    page.locator("#theme").click()
    expect(paths).to_have_count(0)
    chart.get_by_role("button", name="clever").click()
    expect(chart.get_by_role("button", name="clever")).to_have_attribute("aria-pressed", "true")
