"""A race on disk and as a page: its document, what its page draws, and the page as one file."""

import html
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from studio.results.arena.drawing import drawn_race
from studio.results.arena.problem import Definition
from studio.results.arena.racing import as_trial
from studio.results.arena.reports import charts_of, tables_of, words_of
from studio.results.comparison.findings import Findings, Heading
from studio.results.comparison.findings_document import Making, as_document
from studio.results.comparison.kept_trials import measured_by
from studio.results.comparison.trials import Outcome, Scale
from studio.results.self_contained import self_contained_page
from studio.sessions.atomic_files import write_text
from studio.sessions.manifest import now

DOCUMENT, PAGE = "race.json", "race.html"
RaceDocument = dict[str, Any]
HEADING = Heading(
    "arena",
    "Optimisers on frames",
    "an open question",
    "Which optimiser comes how near the heaviest known pose with how many evaluations?",
)


def race_document(
    definitions: Sequence[Definition],
    outcomes: Sequence[Outcome],
    labels: Mapping[str, str],
    budget: int,
) -> RaceDocument:
    """Charts and tables (`findings`), and who is where after how many evaluations (`drawn`). labels : of the racers."""
    trials = [as_trial(outcome) for outcome in outcomes]
    seeds = tuple(sorted({trial.seed for trial in trials}))
    settings = {
        "evaluations": budget,
        "seeds": len(seeds),
        "problems": len(definitions),
        "racers": ", ".join(f"{name} ({label})" for name, label in labels.items()),
    }
    findings = Findings(
        "answered",
        words_of(trials, budget),
        (),
        tuple(tables_of(trials, definitions)),
        tuple(charts_of(trials, definitions, budget)),
        settings,
    )
    seconds = sum(float(outcome.measured["seconds"]) for outcome in outcomes)
    making = Making(Scale(seeds), len(outcomes), seconds, measured_by(), (measured_by(),), now())
    return {"findings": as_document(HEADING, findings, making), "drawn": drawn_race(definitions, outcomes)}


def write_race(folder: Path, document: RaceDocument) -> None:
    """Write the document and the page. Raises SessionError where that fails."""
    write_text(folder / DOCUMENT, json.dumps(document, allow_nan=False) + "\n")
    write_text(folder / PAGE, race_html(document))


BODY = """<header class="report-head">
<div>
<h1>Optimisers on frames</h1>
<p>{software}, {date}</p>
</div>
<button type="button" id="theme" aria-label="Light or dark" title="Light or dark">◐</button>
</header>
<main><section id="race"></section><div id="findings"><p>This page is drawn by a script; allow scripts for this file to
read it.</p></div></main>"""

SCRIPT = """import * as echarts from "vendor/echarts.esm.min.js";
import { drawFindings } from "js/findings.js";
import { drawRace } from "js/race_drawing.js";
import { startTheme } from "js/theme.js";
startTheme();
const { findings, drawn } = JSON.parse(document.getElementById("data").textContent);
drawRace(document.getElementById("race"), drawn);
drawFindings(document.getElementById("findings"), [findings], echarts);"""


def race_html(document: RaceDocument) -> str:
    """The page of a race. Raises StudioError where the pages' files are not installed."""
    findings = document["findings"]
    return self_contained_page(
        title="Optimisers on frames",
        kind="report",
        styles=("report.css",),
        entries=("vendor/echarts.esm.min.js", "js/findings.js", "js/race_drawing.js", "js/theme.js"),
        body=BODY.format(
            software=html.escape(f"Capture studio {findings['software']}"),
            date=html.escape(findings["date"][:16].replace("T", " ") + " UTC"),
        ),
        data=document,
        script=SCRIPT,
    )
