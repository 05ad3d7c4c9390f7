"""A trial: one piece of work whose outcome depends on its arguments alone, run in any process, stored and reused."""

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeGuard, TypeVar

from studio.foundations.errors import StudioError
from studio.results.comparison.footage_cache import FootageCache

# Numbers, text, lists and dictionaries: the types of JSON.
Plain = Any


def is_mapping(value: Plain) -> TypeGuard[Mapping[str, Plain]]:
    return isinstance(value, Mapping)


Measure = Callable[[Mapping[str, Plain], FootageCache], dict[str, Plain]]
M = TypeVar("M", bound=Callable[..., Any])
NAMED_BELOW = "studio.experiments"
ALLOW_INCONSISTENT = "despite_findings"
"""The entry of a trial's arguments for `allow_inconsistent`: names of kept trials and batches are made of it, so it
stays as it first was.
"""


@dataclass(frozen=True, slots=True)
class Scale:
    """Extent of an experiment. seeds : of the trials. quick : a preview in minutes."""

    seeds: tuple[int, ...]
    quick: bool = False


@dataclass(frozen=True, slots=True)
class Trial:
    """One piece of work. label : text for the progress. arguments : all that its outcome depends on, plain;
    the same arguments always give the same outcome, so a kept outcome is used again.
    """

    label: str
    arguments: Mapping[str, Plain]


@dataclass(frozen=True, slots=True)
class Outcome:
    """A trial and its measured values, plain."""

    trial: Trial
    measured: Mapping[str, Plain]


@dataclass(frozen=True, slots=True)
class TrialJob:
    """A trial that can run in any process.

    key : under which its outcome is kept. experiment : the first that needs it. footage : recipes that it
    uses. frames : number from the first, None for all. alone : nothing else may run at the same time.
    """

    key: str
    experiment: str
    label: str
    arguments: Mapping[str, Plain]
    measure: Measure
    footage: tuple[str, ...]
    frames: int | None
    alone: bool


def kept_as(name: str) -> Callable[[M], M]:
    """Give a measure the name that its outcomes are stored under, independent of its module.

    The names are those of the modules in which outcomes were first measured, below NAMED_BELOW: another name is
    another trial, and everything is measured again.
    """

    def named(measure: M) -> M:
        measure.kept_as = f"{NAMED_BELOW}.{name}"  # pyright: ignore[reportFunctionMemberAccess]
        return measure

    return named


def measure_name(measure: Measure) -> str:
    """The name that a measure's outcomes are stored under: that of `kept_as`, else its module and function."""
    return getattr(measure, "kept_as", f"{measure.__module__}.{measure.__qualname__}")


def failure_in_words(error: Exception) -> str:
    """The failure as text: a StudioError's message, else the kind of error and where it was raised."""
    if isinstance(error, StudioError):
        return str(error)
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(place.filename).name}, line {place.lineno})"
