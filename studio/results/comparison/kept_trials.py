"""Outcomes on disk, one file each, so that nothing is measured twice.

A file's name is made from all that an outcome depends on: the function that measures, its arguments, and the
recipes of the footage that these name. Experiments with the same trial share it; a program that was killed
resumes where it was. Files are written atomically.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from studio.foundations.errors import SessionError
from studio.foundations.foreign_files import LARGEST_RECORD, read_file, read_text
from studio.foundations.package import package_folder, software_version
from studio.results.comparison.trials import Plain, is_mapping
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.atomic_files import write_text

# Rooms whose code affects outcomes; pages, commands and reports do not.
SCIENCE = (
    *("foundations/geometry", "body", "footage/capture", "evidence", "search", "runs", "results/evaluation"),
)


@dataclass(frozen=True, slots=True)
class KeptOutcome:
    """The outcome of a trial, or its failure.

    measured : plain values, None where it failed. failure : why, "" where it did not. seconds : its duration. software
    : version that measured it. finished : UTC, ISO 8601. label, arguments : of the trial, for readers of the file.
    commit : of the code that measured it, "" where that is not known.
    """

    measured: Mapping[str, Plain] | None
    failure: str
    seconds: float
    software: str
    finished: str
    label: str
    arguments: Mapping[str, Plain]
    commit: str = ""


class KeptTrials:
    """The folder of kept outcomes; one process writes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def read(self, key: str) -> KeptOutcome | None:
        """The outcome of a key; None without a readable file."""
        try:
            return KeptOutcome(**json.loads(read_text(self.folder / f"{key}.json", LARGEST_RECORD)))
        except (OSError, SessionError, ValueError, TypeError, RecursionError):
            return None

    def write(self, key: str, outcome: KeptOutcome) -> None:
        """Store an outcome, replacing an older one. Raises OSError."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write_text(self.folder / f"{key}.json", json.dumps(plain(asdict(outcome)), indent=1) + "\n")


def measured_by() -> str:
    """The studio's version and a digest of the code that affects outcomes: "0.1.0+1a2b3c4d"; then the packages that
    add trackers or weightings.
    """
    packages = dict.fromkeys((*TRACKERS.packages, *WEIGHTINGS.packages))
    return ", ".join((f"{software_version()}+{code_digest(SCIENCE)}", *packages))


@cache
def code_digest(rooms: tuple[str, ...]) -> str:
    """A digest of the code of some rooms, read once in a process."""
    package = package_folder()
    digest = hashlib.sha256()
    for room in rooms:
        for path in sorted((package / room).rglob("*")):
            if path.suffix in (".py", ".toml"):
                digest.update(read_file(path))
    return digest.hexdigest()[:8]


def plain(value: Plain) -> Any:  # noqa: ANN401
    """The value as it comes back from JSON (tuples as lists, keys as words, NumPy's numbers as numbers)."""
    return json.loads(json.dumps(value, default=_plain_value))


def _plain_value(value: Any) -> Any:  # noqa: ANN401
    """NumPy's arrays and numbers, mappings and sets. Raises TypeError for other types."""
    as_list = getattr(value, "tolist", None)
    if callable(as_list):
        return as_list()
    if is_mapping(value):
        return dict(value)
    raise TypeError(f"A {type(value).__name__} is not a plain value.")
