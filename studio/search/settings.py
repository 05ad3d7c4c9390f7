"""All knobs of a run in one frozen, versioned value.

A run's settings are six groups: the tracker's, the likelihood's (stored as *weighting*), the evidence's, the
refinement's, the recovery's and the recording's. Each knob has a flat name that is unique over the six, so that a
slider, `--set name=value` and `PATCH /settings` need no group.
"""

import dataclasses
import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from studio.evidence.settings import EvidenceSettings
from studio.foundations.errors import SettingsError
from studio.foundations.knobs import Knob, Value, changed, knob, knobs_of
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_refinement import FrameRefinementSettings
from studio.search.trackers.recovery_settings import RecoverySettings

GROUPS = ("tracker", "weighting", "evidence", "refinement", "recovery", "recording")
DEFAULT_TRACKER, DEFAULT_WEIGHTING = "annealed", "edge-region-silhouette"
# Knobs of older records: the new name, and the new value where an old one is gone.
RENAMED: dict[str, tuple[str, dict[object, Value]]] = {"limits": ("constraints", {"reflect": "clamp"})}
# Knobs that older records do not have, as those runs were tracked.
BEFORE: dict[str, Value] = {
    "refine_frames": False,
    "above_floor": False,
    "limb_colours": False,
    "ask_network_every": 0,
    "thin_limbs": False,
    "mask_shadow_window": 1,
    "mask_shadow_floor": False,
    "mask_shadow_alike": 0.0,
    "mask_shadow_doubt": False,
}
# Knobs that are gone; what they did cannot be done again.
GONE = ("mask_shadow_learnt",)
JSON_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}


@dataclass(frozen=True, slots=True)
class RecordingSettings:
    """What of a run is kept beside its results."""

    title = "Recording"

    record_particles: int = knob(
        2000, 0, 200000, 100, label="particles kept",
        help="Most particles stored of a layer; the set at a frame's end is always kept whole.",
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class RunSettings:
    """All settings of a run. tracker, weighting : of the settings_type of the tracker and the likelihood named."""

    tracker_name: str
    weighting_name: str
    tracker: Any
    weighting: Any
    evidence: EvidenceSettings
    refinement: FrameRefinementSettings
    recovery: RecoverySettings
    recording: RecordingSettings


@dataclass(frozen=True, slots=True)
class SettingsEntry:
    """The settings in use from (frame, layer) on. values : every knob by name."""

    version: int
    frame: int
    layer: int
    values: dict[str, Value]


@dataclass(frozen=True, slots=True)
class SettingsHistory:
    """All settings that a run has used, oldest first; versions count from 1. `entries` is plain data for a
    record.
    """

    entries: tuple[SettingsEntry, ...] = ()

    def with_applied(self, version: int, frame: int, layer: int, settings: RunSettings) -> "SettingsHistory":
        """The history with one entry more; itself where `version` is the last one already."""
        if self.entries and self.entries[-1].version == version:
            return self
        return SettingsHistory((*self.entries, SettingsEntry(version, frame, layer, values(settings))))

    def in_use(self, frame: int, layer: int) -> SettingsEntry | None:
        """The last entry that was applied at or before a layer of a frame, None before the first."""
        found = [entry for entry in self.entries if (entry.frame, entry.layer) <= (frame, layer)]
        return found[-1] if found else None

    def changes(self) -> tuple[tuple[str, ...], ...]:
        """For each entry the names whose value differs from the entry before (all names for the first)."""
        before: dict[str, Value] = {}
        named: list[tuple[str, ...]] = []
        for entry in self.entries:
            named.append(tuple(name for name in entry.values if entry.values[name] != before.get(name)))
            before = entry.values
        return tuple(named)


def default_settings(
    tracker_name: str = DEFAULT_TRACKER, weighting_name: str = DEFAULT_WEIGHTING
) -> RunSettings:
    """The defaults of a tracker and a likelihood; raises SettingsError for an unknown name of either, or for a
    knob that two groups have.
    """
    tracker = TRACKERS[tracker_name].settings_type()
    weighting = WEIGHTINGS[weighting_name].settings_type()
    settings = RunSettings(
        tracker_name,
        weighting_name,
        tracker,
        weighting,
        EvidenceSettings(),
        FrameRefinementSettings(),
        RecoverySettings(),
        RecordingSettings(),
    )
    names = [entry.name for entry in all_knobs(settings)]
    if len(names) > len(set(names)):
        twice = next(name for name in names if names.count(name) > 1)
        raise SettingsError(
            f"Setting '{twice}' means two things with tracker '{tracker_name}' and weighting '{weighting_name}'.",
            "Give the knob of the one that you added another name.",
        )
    return settings


def changed_settings(settings: RunSettings, changes: Mapping[str, object]) -> RunSettings:
    """A copy with some knobs changed, by flat names; all or nothing.

    Raises SettingsError for an unknown name or a value that is not allowed.
    """
    owner = {entry.name: group for group in GROUPS for entry in knobs_of(getattr(settings, group))}
    by_group: dict[str, dict[str, object]] = {}
    for name, value in changes.items():
        if name not in owner:
            raise _unknown(name, settings, tuple(owner))
        by_group.setdefault(owner[name], {})[name] = value
    groups = {group: changed(getattr(settings, group), wanted) for group, wanted in by_group.items()}
    return dataclasses.replace(settings, **groups)


def settings_from_values(
    tracker_name: str, weighting_name: str, recorded: Mapping[str, object]
) -> RunSettings:
    """The settings that a record describes: defaults, changed to the recorded values; knobs that have another
    name today are understood, and what a record does not have yet was not done.
    """
    known = in_todays_names(recorded)
    return changed_settings(default_settings(tracker_name, weighting_name), {**BEFORE, **known})


def in_todays_names(recorded: Mapping[str, Any]) -> dict[str, Any]:
    """Recorded knobs by the names that they have today."""
    found: dict[str, Any] = {}
    for name, value in recorded.items():
        if name in GONE:
            continue
        today, changes = RENAMED.get(name, (name, {}))
        found[today] = changes.get(value, value)
    return found


def all_knobs(settings: RunSettings) -> tuple[Knob, ...]:
    """Every knob of a run, group after group."""
    return tuple(entry for group in GROUPS for entry in knobs_of(getattr(settings, group)))


def values(settings: RunSettings) -> dict[str, Value]:
    """Every knob's value by its flat name."""
    groups = [getattr(settings, group) for group in GROUPS]
    return {entry.name: getattr(group, entry.name) for group in groups for entry in knobs_of(group)}


def knob_table() -> tuple[Knob, ...]:
    """Every knob that there is, of all trackers and likelihoods, for the guide; `group` says whose it is."""
    types = [tracker.settings_type for tracker in TRACKERS.values()]
    types += [weighting.settings_type for weighting in WEIGHTINGS.values()]
    types += [EvidenceSettings, FrameRefinementSettings, RecoverySettings, RecordingSettings]
    return tuple(entry for settings_type in dict.fromkeys(types) for entry in knobs_of(settings_type))


def json_schema(settings: RunSettings) -> dict[str, Any]:
    """JSON Schema (2020-12) of a change of these settings; each property's default is the value now in
    use.
    """
    now = values(settings)
    return {
        "title": f"Settings of {settings.tracker_name} with {settings.weighting_name}",
        "type": "object",
        "additionalProperties": False,
        "properties": {entry.name: _property(entry, now[entry.name]) for entry in all_knobs(settings)},
    }


def _property(entry: Knob, now: Value) -> dict[str, Any]:
    """One knob as a schema's property; what the standard has no word for begins with x-."""
    written: dict[str, Any] = {
        "type": JSON_TYPES[entry.kind],
        "title": entry.label,
        "description": entry.help,
        "default": now,
        "minimum": entry.low,
        "maximum": entry.high,
        "enum": list(entry.choices) or None,
        "x-step": entry.step,
        "x-unit": entry.unit or None,
        "x-group": entry.group,
        "x-takes-effect": entry.takes_effect,
    }
    return {key: value for key, value in written.items() if value is not None}


def _unknown(name: str, settings: RunSettings, known: tuple[str, ...]) -> SettingsError:
    """The error for a name that no group has, with the nearest one as remedy."""
    near = difflib.get_close_matches(name, known, 1)
    hint = f"Did you mean '{near[0]}'?" if near else f"Known: {', '.join(sorted(known))}."
    whose = f"tracker '{settings.tracker_name}' and weighting '{settings.weighting_name}'"
    return SettingsError(f"There is no setting '{name}' with {whose}.", hint)
