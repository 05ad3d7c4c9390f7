"""The papers' experiments by name: the functions that the studio uses of the room `reproduction`.

To run them again is a leaf: no room of the product imports it. These functions load the room on first use, like a
command's module.
"""

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studio.progress import Progress

ALL = "all"


@dataclass(frozen=True, slots=True)
class ExperimentLine:
    """An experiment. claim : the paper's, in our words. is_long : its full form takes hours."""

    name: str
    title: str
    source: str
    claim: str
    is_long: bool


@dataclass(frozen=True, slots=True)
class TrialCounts:
    """Numbers of trials run now, found stored, and failed."""

    measured: int
    kept: int
    failed: int


def experiments() -> tuple[ExperimentLine, ...]:
    """All of them, in the order of the report."""
    known = _reproduction("catalogue").EXPERIMENTS.values()
    return tuple(
        ExperimentLine(one.name, one.title, one.source, one.claim, bool(getattr(one, "long", "")))
        for one in known
    )


def reproduce(name: str, out: Path, *, quick: bool, seeds: int | None, progress: Progress) -> TrialCounts:
    """Run what is missing of an experiment, or of ALL, and write the folder `out`.

    quick : fewer seeds, frames and settings. seeds : None for as many as the form has. Raises NotFoundError for an
    unknown one, RunError while another process works in the folder.
    """
    catalogue = _reproduction("catalogue")
    found = _reproduction("runner").reproduce(
        catalogue.find_experiments(name),
        out,
        _reproduction("plan").scale_of(seeds, quick),
        progress,
        catalogue=tuple(catalogue.EXPERIMENTS.values()),
    )
    return TrialCounts(found.measured, found.kept, found.failed)


def _reproduction(module: str) -> Any:  # noqa: ANN401 - a module
    return importlib.import_module(f"studio.reproduction.{module}")
