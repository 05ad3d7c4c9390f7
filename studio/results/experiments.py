"""The papers' experiments, as pages and jobs use them; who runs them is plugged in (`registry.plugged_in`)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from studio.foundations.progress import Progress
from studio.foundations.registry import plugged_in

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
    """Numbers of trials run now, kept from before, and failed."""

    measured: int
    kept: int
    failed: int


class Experiments(Protocol):
    """All experiments, and how one is run."""

    def lines(self) -> tuple[ExperimentLine, ...]:
        """All of them, in the order of the report."""
        ...

    def reproduce(
        self, name: str, out: Path, *, quick: bool, seeds: int | None, progress: Progress
    ) -> TrialCounts:
        """Run what is missing of an experiment, or of ALL, and write the folder `out`.

        quick : fewer seeds, frames and settings. seeds : None for as many as the form has. Raises NotFoundError for an
        unknown one, RunError while another process works in the folder.
        """
        ...


def experiments() -> Experiments:
    """What is plugged in. Raises PlugInError where nothing is."""
    return plugged_in("experiments")
