"""A reproduction's folder: JSON for programs, CSV for tables, Markdown for the guide, HTML for people.

footage/<recipe>/           sessions, rendered once
trials/<key>.json           outcomes (`kept_trials`)
<experiment>/findings.json  and numbers.csv, chart-1-….csv, table-1-….csv
results.json, summary.md, report.html
"""

import csv
import io
import json
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from studio.foundations.errors import SessionError
from studio.garden.reproduction.experiment import Experiment
from studio.garden.reproduction.report_document import report_html
from studio.results.comparison.findings_document import REPORT, REPRODUCTIONS, RESULTS, SUMMARY, Document
from studio.results.comparison.trials import Plain
from studio.sessions.atomic_files import write_text
from studio.sessions.object_stores import folder_of, is_address
from studio.sessions.remote_sessions import bring_work
from studio.sessions.workspace import workspace_root

FOOTAGE, TRIALS = "footage", "trials"
FINDINGS = "findings.json"
NUMBER_COLUMNS = ("name", "ours", "low", "high", "unit", "paper", "better", "seeds", "verdict", "firm")

MOST_DECIMALS = 6

Rows = Iterable[Sequence[Plain]]


def work_place(out: str | None) -> str:
    """The folder, or address of a store, where everything is kept: by default in the workspace."""
    place = folder_of(out) if out else str(workspace_root() / REPRODUCTIONS)
    return place if is_address(place) else str(Path(place).expanduser().absolute())


def work_folder(place: str) -> Path:
    """The folder of a place; of an address a copy on this machine, without footage. Raises StudioError."""
    return bring_work(place, FOOTAGE) if is_address(place) else Path(place)


def write_findings(out: Path, document: Document) -> None:
    """Write one experiment's folder; the CSV files of an earlier conclusion are deleted. Raises OSError."""
    folder = out / document["name"]
    folder.mkdir(parents=True, exist_ok=True)
    for old in (*folder.glob("chart-*.csv"), *folder.glob("table-*.csv")):
        old.unlink()
    numbers = [[number[column] for column in NUMBER_COLUMNS] for number in document["numbers"]]
    write_text(folder / "numbers.csv", as_csv([NUMBER_COLUMNS, *numbers]))
    for index, table in enumerate(document["tables"], 1):
        name = f"table-{index}-{_slug(table['title'])}.csv"
        write_text(folder / name, as_csv([table["columns"], *table["rows"]]))
    for index, chart in enumerate(document["charts"], 1):
        name = f"chart-{index}-{_slug(chart['title'])}.csv"
        write_text(folder / name, as_csv(_chart_rows(chart)))
    write_text(folder / FINDINGS, json.dumps(document, indent=1, allow_nan=False) + "\n")


def read_findings(out: Path, name: str) -> Document | None:
    """The findings of an experiment, None where it was not run.

    Raises SessionError for a file that cannot be read.
    """
    path = out / name / FINDINGS
    try:
        return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    except (OSError, ValueError):
        raise SessionError(
            f"'{path}' cannot be read.", "Delete it and run the experiment again; its outcomes are kept."
        ) from None


def write_overview(out: Path, experiments: Iterable[Experiment], software: str, date: str) -> Document:
    """results.json, summary.md and report.html of all experiments that have findings; returns the results.

    Raises OSError, and SessionError for findings that cannot be read.
    """
    documents = [read_findings(out, experiment.name) for experiment in experiments]
    results = {
        "software": software,
        "date": date,
        "experiments": [document for document in documents if document is not None],
    }
    write_text(out / RESULTS, json.dumps(results, allow_nan=False) + "\n")
    write_text(out / SUMMARY, summary_markdown(results))
    write_text(out / REPORT, report_html(results))
    return results


def summary_markdown(results: Document) -> str:
    """A table: every experiment with its verdict and its numbers."""
    lines = ["| experiment | source | verdict | numbers: ours [95 % interval], paper |", "|---|---|---|---|"]
    for document in results["experiments"]:
        numbers = "<br>".join(number_in_words(number) for number in document["numbers"])
        verdict = document["verdict"] + (
            "" if document["firm"] or document["verdict"] == "failed" else " (not firm)"
        )
        cells = (
            f"{document['title']} (`{document['name']}`)",
            f"{document['source']}; {_origin(document)}",
            verdict,
            numbers or document["words"],
        )
        lines.append(f"| {' | '.join(cell.replace('|', '∣').replace(chr(10), ' ') for cell in cells)} |")
    return "\n".join([*lines, "", f"{results['software']}, {results['date']}", ""])


def _origin(document: Document) -> str:
    """Seeds and commits of an experiment's numbers."""
    seeds = f"{document['seeds']} {'seed' if document['seeds'] == 1 else 'seeds'}"
    # Findings that an older version wrote name no commit.
    commits: list[str] = document.get("commits") or []
    quick = ", a quick look" if document["quick"] else ""
    return f"{seeds}{quick}" + (f", commit {', '.join(commits)}" if commits else "")


def number_in_words(number: Document) -> str:
    """ "mean error: 30.1 mm [29.0, 31.2], paper 38: better"."""
    ours, low, high, paper = figures(number)
    unit = f" {number['unit']}" if number["unit"] else ""
    words = f"{number['name']}: {ours}{unit} [{low}, {high}]"
    if number["paper"] is not None:
        words += f", paper {paper}"
    return words if number["verdict"] == "answered" else f"{words}: {number['verdict']}"


def figures(number: Document) -> tuple[str, str, str, str]:
    """Ours, the interval's ends and the paper's value as text, "–" for null.

    The first three have as many decimals as give the largest of them three figures, or more where a different end would
    look equal to the paper's value. `figures` of js/findings_options.js does the same.
    """
    own = (number["ours"], number["low"], number["high"])
    known = [value for value in own if value is not None]
    largest = max((abs(value) for value in known), default=0.0)
    decimals = 2 - math.floor(math.log10(largest)) if largest > 0 else 0
    decimals = 0 if all(value == round(value) for value in known) else min(max(decimals, 0), MOST_DECIMALS)
    paper = number["paper"]
    while (
        decimals < MOST_DECIMALS
        and paper is not None
        and any(value != paper and round(value - paper, decimals) == 0 for value in known[1:])
    ):
        decimals += 1
    ours, low, high = ("–" if value is None else f"{value:.{decimals}f}" for value in own)
    return ours, low, high, "–" if paper is None else f"{paper:g}"


def as_csv(rows: Rows) -> str:
    """Rows as RFC 4180 text; empty for null."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _chart_rows(chart: Document) -> Rows:
    """A heat map as its matrix, all else as one line a point."""
    if chart["heat"]:
        heat = chart["heat"]
        yield (f"{chart['y']} \\ {chart['x']}", *heat["columns"])
        yield from ((name, *values) for name, values in zip(heat["rows"], heat["values"], strict=True))
        return
    yield ("series", chart["x"] or "x", chart["y"] or "y", "low", "high")
    categories = chart["categories"]
    for series in chart["series"]:
        ends = (
            zip(series["low"], series["high"], strict=True)
            if series["low"]
            else [("", "")] * len(series["x"])
        )
        for x, y, (low, high) in zip(series["x"], series["y"], ends, strict=True):
            named = (
                categories[round(x)]
                if categories and x is not None and 0 <= round(x) < len(categories)
                else x
            )
            yield (series["name"], named, y, low, high)


def _slug(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:40].rstrip("-") or "untitled"
