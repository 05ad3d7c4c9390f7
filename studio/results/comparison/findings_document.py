"""Findings as plain JSON values, for the report, the studio's pages and scripts.

NaN and infinity become null; numbers keep six significant figures, more than a chart can show.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from studio.foundations.typed_decoding import is_list
from studio.results.comparison.findings import FAILED, FIRM_SEEDS, Findings, Heading
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.statistics import firmness
from studio.results.comparison.trials import Plain, Scale, is_mapping

FIGURES = 6
Document = dict[str, Any]

# Folder of the reproduced figures' documents in the workspace, and the file of all of them together.
REPRODUCTIONS = "reproduction"
RESULTS, SUMMARY, REPORT = "results.json", "summary.md", "report.html"


@dataclass(frozen=True, slots=True)
class Making:
    """Origin of findings.

    scale : of the experiment. trials : their number. seconds : of all of them in sequence. software : version that
    drew the conclusion; measured_by : versions that measured the trials. date : UTC, ISO 8601. commits : of the code
    that measured the trials, as far as they are known. measured : when the last of them was, as `date`.
    """

    scale: Scale
    trials: int
    seconds: float
    software: str
    measured_by: tuple[str, ...]
    date: str
    commits: tuple[str, ...] = ()
    measured: str = ""


def as_document(heading: Heading, findings: Findings, making: Making) -> Document:
    numbers = [_without_nan(asdict(number)) for number in findings.numbers]
    for number, entry in zip(findings.numbers, numbers, strict=True):
        entry["firm"] = number.seeds >= FIRM_SEEDS
    return {
        **_head(heading, making),
        "verdict": findings.verdict,
        "firm": _seeds(findings, making) >= FIRM_SEEDS,
        "words": findings.words,
        "numbers": numbers,
        "tables": [_without_nan(asdict(table)) for table in findings.tables],
        "charts": [_without_nan(asdict(chart)) for chart in findings.charts],
        "settings": _without_nan(plain(findings.settings)),
        "failures": [],
        "notes": _notes(findings, making),
    }


def failed_document(heading: Heading, reasons: Sequence[tuple[str, str]], making: Making) -> Document:
    """The document of an experiment without findings. reasons : what failed (a trial's label), and why."""
    failed = sum(1 for label, _ in reasons if label)
    first = ": ".join(part for part in reasons[0] if part)
    if len(reasons) > 1:
        words = f"Not concluded: {failed} of {making.trials} trials failed; the first: {first}"
    else:
        words = f"Not concluded. {first}"
    return {
        **_head(heading, making),
        "verdict": FAILED,
        "firm": False,
        "words": words,
        "numbers": [],
        "tables": [],
        "charts": [],
        "settings": {},
        "failures": [{"label": label, "reason": why} for label, why in reasons],
        "notes": [],
    }


def _head(heading: Heading, making: Making) -> Document:
    return {
        "name": heading.name,
        "title": heading.title,
        "source": heading.source,
        "claim": heading.claim,
        "seeds": len(making.scale.seeds),
        "quick": making.scale.quick,
        "trials": making.trials,
        "seconds": round(making.seconds, 1),
        "software": making.software,
        "commits": list(making.commits),
        "measured": making.measured,
        "date": making.date,
    }


def _seeds(findings: Findings, making: Making) -> int:
    """Number of seeds behind the verdict: the fewest of a number that was compared with the paper's."""
    compared = [number.seeds for number in findings.numbers if number.verdict != "answered"]
    return min(compared, default=len(making.scale.seeds))


def _notes(findings: Findings, making: Making) -> list[str]:
    notes: list[str] = []
    few = firmness(_seeds(findings, making))
    if few:
        notes.append(f"The verdict is {few}.")
    if making.scale.quick:
        notes.append("A quick look: less is run than for the figures of the guide.")
    others = [version for version in making.measured_by if version != making.software]
    if others:
        notes.append(f"Some outcomes were measured by another version ({', '.join(others)}).")
    return notes


def _without_nan(value: Plain) -> Any:  # noqa: ANN401
    """The value with finite numbers of six figures and null for all other floats."""
    if isinstance(value, float):
        return float(f"{value:.{FIGURES}g}") if math.isfinite(value) else None
    if is_mapping(value):
        return {str(key): _without_nan(entry) for key, entry in value.items()}
    if is_list(value):
        return [_without_nan(entry) for entry in value]
    as_number = getattr(value, "item", None)
    return _without_nan(as_number()) if callable(as_number) else value
