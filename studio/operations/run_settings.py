"""Knobs and settings: of a tracker with a likelihood, and of a run since its start."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from studio.foundations.errors import SettingsError
from studio.foundations.knobs import Knob, Value
from studio.operations.presets import preset
from studio.runs.behaviour_models import check_prediction
from studio.runs.moved_knobs import moved_between, settings_with_moved, stored_settings
from studio.runs.pace import StoredPace, stored_pace
from studio.search.settings import (
    SettingsHistory,
    all_knobs,
    changed_settings,
    default_settings,
    json_schema,
    values,
)
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

NEW_RUN = "new run"
"""When a knob takes effect that a run keeps to its end."""


@dataclass(frozen=True, slots=True)
class KnobList:
    """The knobs of a tracker with a likelihood. json_schema : the same as JSON Schema (2020-12)."""

    tracker: str
    weighting: str
    knobs: tuple[Knob, ...]
    values: dict[str, Value]
    json_schema: dict[str, object]


@dataclass(frozen=True, slots=True)
class SettingsChange:
    """When a version of the settings came into use, and which knobs moved."""

    version: int
    frame: int
    layer: int
    changed: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SettingsInUse:
    """A run's settings: the newest version that its frames used, since when it is in use, and all earlier changes.

    moved : knobs that were moved since and that no stored frame uses; the search continues with these values.
    """

    tracker: str
    weighting: str
    version: int
    frame: int
    layer: int
    values: dict[str, Value]
    knobs: tuple[Knob, ...]
    changes: tuple[SettingsChange, ...]
    moved: dict[str, Value]


def knobs_of_tracker(tracker: str, weighting: str) -> KnobList:
    """Every knob of a tracker with a likelihood, with its default. Raises SettingsError."""
    settings = default_settings(tracker, weighting)
    return KnobList(tracker, weighting, all_knobs(settings), values(settings), json_schema(settings))


def history_of(run: StoredRun) -> SettingsHistory:
    """Every version of the settings that a run has used."""
    with run.results() as results:
        return SettingsHistory(tuple(results.settings_history()))


def changes_of(history: SettingsHistory) -> tuple[SettingsChange, ...]:
    """Where settings changed after the start, and which knobs."""
    named = zip(history.entries, history.changes(), strict=True)
    changes = (SettingsChange(entry.version, entry.frame, entry.layer, names) for entry, names in named)
    return tuple(changes)[1:]


def settings_of(run: StoredRun) -> SettingsInUse:
    """A run's newest settings and the way there, from its store."""
    record, history = run.record, history_of(run)
    now = history.entries[-1] if history.entries else None
    return SettingsInUse(
        tracker=record.tracker,
        weighting=record.weighting,
        version=now.version if now else 1,
        frame=now.frame if now else record.first,
        layer=now.layer if now else 0,
        values=dict(now.values if now else record.settings),
        knobs=all_knobs(default_settings(record.tracker, record.weighting)),
        changes=changes_of(history),
        moved=moved_between(stored_settings(run)[1], settings_with_moved(run)),
    )


def check_changes(run: StoredRun, changes: Mapping[str, Value]) -> None:
    """Raise SettingsError for changes that a run's knobs do not allow."""
    check_prediction(changed_settings(settings_with_moved(run), changes), bool(run.record.behaviour))


def defaults_of(run: StoredRun, names: Sequence[str]) -> dict[str, Value]:
    """The defaults of a run's knobs; without names, of all that may change during a run. Raises SettingsError."""
    knobs = {entry.name: entry for entry in _knobs(run)}
    for name in names:
        if name not in knobs:
            raise SettingsError(f"There is no setting '{name[:64]}'.", f"Known: {', '.join(sorted(knobs))}.")
    chosen = names or [entry.name for entry in knobs.values() if entry.takes_effect != NEW_RUN]
    return {name: knobs[name].default for name in chosen}


def values_of_preset(run: StoredRun, name: str, folder: Path) -> dict[str, Value]:
    """The knobs of a preset that can change during a run. folder : of the kept presets.

    Raises NotFoundError; SettingsError where it is made for another tracker or likelihood.
    """
    chosen, tracker, weighting = preset(name, folder), run.record.tracker, run.record.weighting
    if not chosen.fits(tracker, weighting):
        made_for = " with ".join(name for name in (chosen.tracker, chosen.weighting) if name)
        raise SettingsError(
            f"The preset '{chosen.name}' is made for {made_for}, this run is tracked by {tracker} with {weighting}.",
            "Begin a new run with the preset.",
        )
    kept = {entry.name for entry in _knobs(run) if entry.takes_effect == NEW_RUN}
    return {knob: value for knob, value in chosen.values.items() if knob not in kept}


def expected_pace(session: Session, tracker: str, weighting: str, evaluations: int) -> StoredPace:
    """How long a pose and a frame of so many evaluations take, by a stored run of the session with that likelihood; NaN
    and no run without one.
    """
    return stored_pace(session, tracker, weighting, evaluations) or StoredPace("", math.nan, math.nan, 0)


def _knobs(run: StoredRun) -> tuple[Knob, ...]:
    return all_knobs(default_settings(run.record.tracker, run.record.weighting))
