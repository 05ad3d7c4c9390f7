"""Files for programs and people: valid JSON, CSV that reads back, a self-contained page."""

import base64
import csv
import dataclasses
import json
import math
import re
import subprocess
from pathlib import Path

import pytest
from html_page import HtmlPage
from toy_experiments import measure, toy

from studio.foundations.errors import SessionError
from studio.garden.reproduction.findings_files import (
    as_csv,
    number_in_words,
    read_findings,
    summary_markdown,
    write_findings,
    write_overview,
)
from studio.garden.reproduction.guide_findings import POINTS, guide_folder, thinned
from studio.garden.reproduction.provenance import CHANGED, commit
from studio.garden.reproduction.report_document import report_html
from studio.results.comparison.findings import Chart, Findings, Number, Series
from studio.results.comparison.findings_document import Making, as_document, failed_document
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.trials import Outcome, Scale

ROOT = Path(__file__).resolve().parents[3]
SOFTWARE, DATE = "0.1.0+12345678", "2025-01-02T03:04:05+00:00"


def making(seeds: int = 12, quick: bool = False, measured_by: tuple[str, ...] = (SOFTWARE,)) -> Making:
    return Making(Scale(tuple(range(seeds)), quick), 2 * seeds, 12.34, SOFTWARE, measured_by, DATE)


@pytest.fixture
def document(tmp_path: Path) -> dict:
    experiment = toy("toy", tmp_path / "log")
    trials = experiment.trials(Scale(tuple(range(12))))
    outcomes = [Outcome(trial, plain(measure(trial.arguments, None))) for trial in trials]  # pyright: ignore
    return as_document(experiment, experiment.conclude(outcomes), making())


def test_the_report_is_self_contained(document: dict) -> None:
    results = {"software": "<b>1</b>", "date": DATE, "experiments": [document]}
    text = report_html(results)
    page = HtmlPage(text)
    assert page.addresses == []
    assert json.loads(page.scripts["application/json"]) == results
    assert "<b>1</b>" not in text
    named = re.findall(r'url\("([^"]{0,40})', text)
    assert len(named) == 1
    assert named[0].startswith("data:")
    modules = json.loads(page.scripts["importmap"])["imports"]
    assert {"vendor/echarts.esm.min.js", "js/findings.js", "js/findings_charts.js"} <= set(modules)
    inner = {name: base64.b64decode(address.partition(",")[2]).decode() for name, address in modules.items()}
    assert "drawFindings" in inner["js/findings.js"]
    for source in inner.values():
        assert set(re.findall(r'^import [^"]*"([^"]+)"', source, re.MULTILINE)) <= set(modules)
    assert set(re.findall(r'from "([^"]+)"', page.scripts["module"])) <= set(modules)
    assert "--verdict" in text
    assert "--series-0" in text


def test_findings_read_back_and_old_charts_go(document: dict, tmp_path: Path) -> None:
    assert read_findings(tmp_path, "toy") is None
    write_findings(tmp_path, document)
    assert read_findings(tmp_path, "toy") == document
    rows = list(csv.reader((tmp_path / "toy" / "chart-1-error-over-frames.csv").read_text().splitlines()))
    assert rows[0] == ["series", "frame", "error (mm)", "low", "high"]
    chart = document["charts"][0]
    assert len(rows) == 1 + sum(len(series["x"]) for series in chart["series"])
    assert rows[1][:2] == [chart["series"][0]["name"], "0.0"]
    assert float(rows[1][2]) == chart["series"][0]["y"][0]
    bars = list(csv.DictReader((tmp_path / "toy" / "chart-2-error-by-setting.csv").read_text().splitlines()))
    assert [row["setting"] for row in bars] == ["plain", "clever"]
    assert float(bars[0]["low"]) < float(bars[0]["error (mm)"]) < float(bars[0]["high"])
    write_findings(tmp_path, document | {"charts": []})
    assert not list((tmp_path / "toy").glob("chart-*.csv"))
    (tmp_path / "toy" / "findings.json").write_text("{")
    with pytest.raises(SessionError, match="cannot be read"):
        read_findings(tmp_path, "toy")


def test_the_overview_has_the_experiments_in_the_catalogues_order(document: dict, tmp_path: Path) -> None:
    known = [toy(name, tmp_path) for name in ("second", "never", "toy")]
    write_findings(tmp_path, document)
    write_findings(tmp_path, document | {"name": "second"})
    results = write_overview(tmp_path, known, SOFTWARE, DATE)
    assert [entry["name"] for entry in results["experiments"]] == ["second", "toy"]
    assert json.loads((tmp_path / "results.json").read_text()) == results
    assert (tmp_path / "report.html").read_text().startswith("<!doctype html>")


def test_the_summary_is_a_table(document: dict) -> None:
    failed = failed_document(toy("bad", Path("log")), [("seed 1", "No | luck.")], making())
    text = summary_markdown({"software": SOFTWARE, "date": DATE, "experiments": [document, failed]})
    lines = text.splitlines()
    assert [line.count("|") for line in lines[:4]] == [5, 5, 5, 5]
    assert "| reproduced |" in lines[2]
    assert "error, plain: 40.0 mm [" in lines[2]
    assert ", paper 40: reproduced<br>" in lines[2]
    assert "| failed | Not concluded. seed 1: No ∣ luck. |" in lines[3]


def test_documents_are_json_for_any_measurement(tmp_path: Path) -> None:
    gaps = Series("a", (0.0, 1.0), (math.nan, math.inf))
    numbers = (Number("n", math.nan, math.nan, math.inf, seeds=12),)
    found = Findings(
        "answered",
        "",
        numbers,
        charts=(Chart("c", "lines", "x", "y", (gaps,)),),
        settings={"s": (1, math.nan)},
    )
    written = json.loads(json.dumps(as_document(toy("toy", tmp_path), found, making()), allow_nan=False))
    assert written["charts"][0]["series"][0]["y"] == [None, None]
    assert written["settings"] == {"s": [1, None]}
    assert (written["numbers"][0]["ours"], written["numbers"][0]["high"]) == (None, None)


def test_a_summary_cites_the_commits_that_measured(tmp_path: Path) -> None:
    """Numbers can be traced to code: the commit of each outcome stands in the summary, and it is one that exists."""
    made = dataclasses.replace(making(), commits=("0123456789ab",))
    document = as_document(toy("toy", tmp_path), Findings("answered", ""), made)
    assert "12 seeds, commit 0123456789ab |" in summary_markdown(
        {"software": SOFTWARE, "date": DATE, "experiments": [document]}
    )
    cited = commit().removesuffix(CHANGED)
    if cited:
        assert commit_exists(cited)


def test_the_guides_page_cites_commits_that_exist() -> None:
    """Every commit on the page is in this repository's history; rows without one are older than commits are kept."""
    page = (ROOT / "web_assets" / "guide" / "reproduction.md").read_text(encoding="utf-8")
    if not commit():
        pytest.skip("No checkout: commits cannot be looked up.")
    missing = [name for name in re.findall(r"commit ([0-9a-f]{7,40})", page) if not commit_exists(name)]
    assert missing == []


def commit_exists(name: str) -> bool:
    """Whether this repository has a commit."""
    asked = ["git", "-C", str(ROOT), "cat-file", "-e", f"{name}^{{commit}}"]
    return subprocess.run(asked, check=False, capture_output=True).returncode == 0


def test_verdicts_state_their_basis(tmp_path: Path) -> None:
    few = Findings("reproduced", "", (Number("n", 1, 0, 2, paper=1, seeds=5, verdict="reproduced"),))
    written = as_document(toy("toy", tmp_path), few, making(12, quick=True, measured_by=(SOFTWARE, "0.0.9")))
    assert (written["firm"], written["numbers"][0]["firm"]) == (False, False)
    assert written["notes"][0] == "The verdict is not firm: 5 seeds of at least 10."
    assert "quick" in written["notes"][1]
    assert "(0.0.9)" in written["notes"][2]
    assert as_document(toy("toy", tmp_path), Findings("answered", ""), making())["notes"] == []


def test_many_failures_are_counted(tmp_path: Path) -> None:
    reasons = [(f"seed {seed}", "No luck.") for seed in range(4)]
    written = failed_document(toy("toy", tmp_path), reasons, making())
    assert written["words"] == "Not concluded: 4 of 24 trials failed; the first: seed 0: No luck."
    assert len(written["failures"]) == 4


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ((1234.5, 0.12345, None, None), "n: 1234 mm [0, –]"),
        ((34.04, 31.72, 38.21, 38.0), "n: 34.0 mm [31.7, 38.2], paper 38"),
        ((34.04, 31.72, 37.98, 38.0), "n: 34.04 mm [31.72, 37.98], paper 38"),
        ((0.554, 0.35, 0.674, 1.0), "n: 0.554 mm [0.350, 0.674], paper 1"),
        ((1.0, 0.0, 1.0, 1.0), "n: 1 mm [0, 1], paper 1"),
        ((0.0, 0.0, 0.0, None), "n: 0 mm [0, 0]"),
    ],
)
def test_numbers_in_words(values: tuple, words: str) -> None:
    ours, low, high, paper = values
    written = {"name": "n", "ours": ours, "low": low, "high": high, "unit": "mm", "paper": paper}
    assert number_in_words({**written, "verdict": "answered"}) == words
    assert number_in_words({**written, "verdict": "better"}) == f"{words}: better"


def test_csv_quotes_and_leaves_out_null() -> None:
    assert as_csv([("a,b", None, 1.5)]) == '"a,b",,1.5\n'


def test_the_guide_keeps_the_means_and_at_most_so_many_points(document: dict) -> None:
    x = list(range(300))
    curve = {"name": "a", "x": x, "y": [value / 3.0 for value in x], "low": [], "high": [], "group": "a"}
    seed = {**curve, "name": "a, seed 0", "thin": True, "dashed": False}
    alone = {**seed, "group": "b"}
    chart = {**document["charts"][0], "series": [seed, {**curve, "thin": False, "dashed": False}, alone]}
    found = thinned({**document, "charts": [chart]})
    kept = found["charts"][0]["series"]
    assert [entry["group"] for entry in kept] == ["a", "b"]
    assert [entry["thin"] for entry in kept] == [False, True]
    assert (len(kept[0]["x"]), kept[0]["x"][0], kept[0]["x"][-1], kept[0]["y"][-1]) == (POINTS, 0, 299, 99.67)
    assert found["lines"] == [
        number_in_words(entry) for entry in document["numbers"] if entry["verdict"] != "answered"
    ]


def test_the_guide_cites_commits_of_this_repository() -> None:
    def git(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=False)

    if git("rev-parse", "--is-shallow-repository").stdout.strip() != "false":
        pytest.skip("no checkout with its whole history")
    files = [path for path in guide_folder().glob("*.json") if path.name != "before.json"]
    for path in files:
        for cited in json.loads(path.read_text(encoding="utf-8"))["commits"]:
            assert git("cat-file", "-e", f"{cited}^{{commit}}").returncode == 0, (path.name, cited)
