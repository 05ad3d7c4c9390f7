"""Findings as the guide keeps them: a small file an experiment, with the commits that measured it and their date.

web_assets/guide/reproduction/<experiment>.json   what `studio reproduce NAME --into-guide` wrote
web_assets/guide/reproduction/before.json         what all of them said on 21 November 2026, and why a row has changed

The guide's page (`app/server/guide_routes.py`) is made of these files. So an experiment that is run again changes one
file, and what was measured stays where its outcomes do not.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from studio.foundations.errors import StudioError
from studio.foundations.package import assets_folder
from studio.foundations.typed_decoding import is_list
from studio.garden.reproduction.findings_files import number_in_words
from studio.garden.reproduction.provenance import CHANGED
from studio.results.comparison.findings_document import Document
from studio.results.comparison.trials import is_mapping
from studio.sessions.atomic_files import write_text

FIGURES, POINTS, ROWS = 4, 61, 60
"""Significant figures of every number; most points of a curve, and rows of a table."""


def guide_folder() -> Path:
    """Where the guide's findings lie. Raises StudioError where the pages' files are not installed."""
    return assets_folder() / "guide" / "reproduction"


def write_into_guide(folder: Path, document: Document) -> Path:
    """Write an experiment's file, and return its path. Raises StudioError for findings that cite no commit, because an
    outcome was measured outside a checkout or by code that was not committed.
    """
    commits: Sequence[str] = document["commits"]
    if not commits or any(commit.endswith(CHANGED) for commit in commits):
        raise StudioError(
            f"The outcomes of '{document['name']}' cite no commit that exists.",
            "Commit the code, delete the experiment's outcomes, and measure again.",
        )
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{document['name']}.json"
    write_text(path, _text(thinned(document)))
    return path


def thinned(document: Document) -> Document:
    """The document with fewer figures and points: of curves drawn for every seed only the mean, and of each curve at
    most POINTS points. lines : the numbers that claims rest on, in words; without claims all.
    """
    claimed = [number for number in document["numbers"] if number["verdict"] != "answered"]
    kept = {name: value for name, value in document.items() if name not in ("failures", "software")}
    charts = [{**chart, "series": _series(chart["series"])} for chart in document["charts"]]
    tables = [{**table, "rows": table["rows"][:ROWS]} for table in document["tables"]]
    lines = [number_in_words(number) for number in claimed or document["numbers"]]
    return _rounded({**kept, "charts": charts, "tables": tables, "failures": [], "lines": lines})


def _series(every: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Series without those of single seeds where their mean is there too, thinned."""
    means = {entry["group"] for entry in every if not entry["thin"]}
    shown = [entry for entry in every if not (entry["thin"] and entry["group"] in means)]
    return [
        {
            name: [value[place] for place in _places(len(value))] if is_list(value) else value
            for name, value in entry.items()
        }
        for entry in shown
    ]


def _places(count: int) -> list[int]:
    """At most POINTS places of `count`, the first and the last among them."""
    return (
        list(range(count))
        if count <= POINTS
        else np.linspace(0, count - 1, POINTS).round().astype(int).tolist()
    )


def _rounded(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, float):
        return float(f"{value:.{FIGURES}g}")
    if is_mapping(value):
        return {name: _rounded(entry) for name, entry in value.items()}
    return [_rounded(entry) for entry in value] if is_list(value) else value


def _text(document: Document) -> str:
    """JSON with a line a number, a table and a chart, so that a difference between two measurements can be read."""
    lines: list[str] = []
    for name, value in document.items():
        if is_list(value) and value and is_mapping(value[0]):
            entries = ",\n  ".join(_json(entry) for entry in value)
            lines.append(f' "{name}": [\n  {entries}\n ]')
        else:
            lines.append(f' "{name}": {_json(value)}')
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _json(value: Any) -> str:  # noqa: ANN401
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
