"""The papers' experiments as pages and jobs use them, and their results; the module that runs them is plugged in
(`registry.plugged_in`).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import msgspec

from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.foreign_files import read_file
from studio.foundations.progress import Progress
from studio.foundations.registry import plugged_in
from studio.foundations.typed_decoding import decode_json
from studio.results.comparison.findings_document import REPORT, REPRODUCTIONS, RESULTS, SUMMARY
from studio.sessions.workspace import Workspace

ALL = "all"
DOWNLOADS = {RESULTS: "application/json", SUMMARY: "text/markdown; charset=utf-8", REPORT: "text/html"}
"""The files of what was reproduced, and their media types."""


@dataclass(frozen=True, slots=True)
class ExperimentLine:
    """An experiment.

    claim : the paper's, in our words.
    is_long : its full form takes hours.
    """

    name: str
    title: str
    source: str
    claim: str
    is_long: bool


@dataclass(frozen=True, slots=True)
class TrialCounts:
    """Numbers of trials that were run now, kept from before, and failed."""

    measured: int
    kept: int
    failed: int


class Reports(msgspec.Struct, frozen=True):
    """The reproduced experiments.

    experiments : documents as results.json has them; none before the first command.
    """

    software: str = ""
    date: str = ""
    experiments: list[dict[str, Any]] = msgspec.field(default_factory=list[dict[str, Any]])


class Experiments(Protocol):
    """All experiments, and how one is run."""

    def lines(self) -> tuple[ExperimentLine, ...]:
        """All of them, in the order of the report."""
        ...

    def reproduce(
        self, name: str, out: Path, *, quick: bool, seeds: int | None, progress: Progress
    ) -> TrialCounts:
        """Run the missing trials of an experiment, or of ALL, and write the folder `out`.

        quick : fewer seeds, frames and settings.
        seeds : None for as many as the form has.

        Raises NotFoundError for an unknown experiment, RunError while another process works in the folder.
        """
        ...


def experiments() -> Experiments:
    """The plugged-in experiments. Raises PlugInError where there are none."""
    return plugged_in("experiments")


def kept_reports(workspace: Workspace) -> Reports:
    """What `studio reproduce` wrote into the workspace. Raises SessionError where it cannot be read."""
    path = reproductions_folder(workspace) / RESULTS
    if not path.is_file():
        return Reports()
    try:
        return decode_json(read_file(path), Reports)
    except (msgspec.DecodeError, OSError) as error:
        raise SessionError(
            f"'{path}' cannot be read: {error}.", "Run 'studio reproduce' again; what is measured is kept."
        ) from None


def report_file(workspace: Workspace, name: str) -> Path:
    """A file of the report, one of DOWNLOADS. Raises NotFoundError."""
    path = reproductions_folder(workspace) / name
    if name not in DOWNLOADS or not path.is_file():
        raise NotFoundError(f"There is no report '{name[:40]}'.", "Make one: studio reproduce all --quick.")
    return path


def reproductions_folder(workspace: Workspace) -> Path:
    """The folder for experiments that are run from the page."""
    return workspace.root / REPRODUCTIONS
