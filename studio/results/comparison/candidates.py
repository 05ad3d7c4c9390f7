"""The candidates of a comparison: trackers by name, each with the same number of evaluations a frame.

A name is a tracker, `annealed`, or a tracker with a label, `annealed:eq13`, so that one tracker may take part
several times. Known labels imply their knobs (VARIANTS); any other label is free and needs a change of its own. A
name of LINEUPS stands for several.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from studio.foundations.errors import SettingsError
from studio.foundations.knobs import Value
from studio.search.settings import RunSettings, changed_settings, default_settings, values
from studio.search.trackers.catalogue import TRACKERS, knobs_for_evaluations
from studio.search.trackers.swarm_settings import PARTITIONS

LABEL = re.compile(r"[A-Za-z0-9_-]{1,40}")
WEIGHTING, BODY = "weighting", "body"
"""What counts as a knob of a candidate beside its settings."""
DEFAULT_LAYERS = 10
# Allowed deviation from the requested evaluations, as a share: rounding, not an advantage.
UNEQUAL_SHARE = 0.01


VARIANTS = {
    f"{name}:{label}": variant
    for name, tracker in TRACKERS.items()
    for label, variant in tracker.variants.items()
}

LINEUPS: dict[str, tuple[str, ...]] = {
    "improvements": ("annealed:improved", "annealed:eq13", "condensation"),
    "papers": ("swarm", "annealed:improved", "annealed:eq13", "condensation"),
    "guided": ("behaviour", "annealed:guided", "annealed", "condensation"),
    "partitions": ("swarm", *(f"swarm:{partition}" for partition in PARTITIONS[1:])),
}


@dataclass(frozen=True, slots=True)
class Candidate:
    """A tracker in a comparison. name : unique in it. changes : knobs by flat name, those of the evaluations
    included. evaluations : poses weighed in a frame. body : a name, "" for the comparison's.
    """

    name: str
    tracker: str
    weighting: str
    evaluations: int
    changes: Mapping[str, Value]
    body: str = ""

    @property
    def chosen(self) -> dict[str, Value]:
        """What it differs by from others, as `--set` takes it."""
        return {WEIGHTING: self.weighting, **({BODY: self.body} if self.body else {}), **self.changes}

    def settings(self) -> RunSettings:
        """All knobs of its run."""
        return changed_settings(default_settings(self.tracker, self.weighting), self.changes)


@dataclass(frozen=True, slots=True)
class Lineup:
    """The requested candidates.

    names : trackers, tracker:label, or names of LINEUPS. weighting : of all. evaluations : a frame. layers : of
    annealed trackers without their own. changes : by name, knobs by flat name; under "" those of all trackers that
    have them; of one, `weighting` and `body` count as knobs.
    """

    names: tuple[str, ...]
    weighting: str
    evaluations: int
    layers: int = DEFAULT_LAYERS
    changes: Mapping[str, Mapping[str, Value]] = field(default_factory=dict[str, Mapping[str, Value]])


def candidates(lineup: Lineup) -> tuple[Candidate, ...]:
    """The candidates, all with the same number of evaluations. Raises SettingsError for a faulty one."""
    names = expanded(lineup.names)
    if not names:
        raise SettingsError(
            "No tracker was named to compare.", f"Name some of {', '.join(sorted(TRACKERS))}."
        )
    for name in names:
        if names.count(name) > 1:
            hint = f"Give one a label and a change, like {name.partition(':')[0]}:b with --set."
            raise SettingsError(f"'{name}' is named twice.", hint)
    for name in lineup.changes:
        if name and name not in names:
            hint = f"Name it as it stands in the list: {', '.join(names)}."
            raise SettingsError(f"A change is for '{name}', which does not take part.", hint)
    _check_shared(lineup.changes.get("", {}), names, lineup.weighting)
    return tuple(_candidate(name, lineup) for name in names)


def expanded(names: Sequence[str]) -> tuple[str, ...]:
    """The names with those of LINEUPS expanded. Raises SettingsError for an unknown one."""
    members = [one for name in names for one in LINEUPS.get(name, (name,))]
    for name in members:
        tracker, colon, label = name.partition(":")
        if tracker not in TRACKERS:
            known = ", ".join((*sorted(TRACKERS), *VARIANTS, *LINEUPS))
            raise SettingsError(f"There is no tracker '{tracker}'.", f"Known: {known}.")
        if colon and not LABEL.fullmatch(label):
            hint = "After the colon write letters, digits, - and _, like annealed:eq13."
            raise SettingsError(f"'{name}' is not a tracker's name.", hint)
    return tuple(members)


def _candidate(name: str, lineup: Lineup) -> Candidate:
    tracker = name.partition(":")[0]
    own = dict(lineup.changes.get(name, {}))
    weighting, body = str(own.pop(WEIGHTING, lineup.weighting)), str(own.pop(BODY, ""))
    settings = default_settings(tracker, weighting)
    shared = {knob: value for knob, value in lineup.changes.get("", {}).items() if knob in values(settings)}
    if ":" in name and name not in VARIANTS and not (own or body or weighting != lineup.weighting):
        known = ", ".join(entry for entry in VARIANTS if entry.startswith(f"{tracker}:")) or "none"
        raise SettingsError(
            f"'{name}' does not differ from '{tracker}'.",
            f"Change a knob of it, as in --set {name}.KNOB=VALUE; labels with knobs of their own: {known}.",
        )
    variant: Mapping[str, Value] = VARIANTS[name].changes if name in VARIANTS else {}
    requested = {**shared, **variant, **own}
    layers = (
        getattr(changed_settings(settings, requested).tracker, "layers", 0)
        if "layers" in requested
        else lineup.layers
    )
    equal = knobs_for_evaluations(tracker, lineup.evaluations, layers)
    usual = TRACKERS[tracker].evaluations(changed_settings(settings, equal).tracker)
    changed = changed_settings(settings, {**equal, **requested})
    total = TRACKERS[tracker].evaluations(changed.tracker)
    if abs(total - lineup.evaluations) > max(
        abs(usual - lineup.evaluations), UNEQUAL_SHARE * lineup.evaluations
    ):
        raise SettingsError(
            f"'{name}' would evaluate {total} poses a frame instead of {lineup.evaluations}.",
            f"Leave {', '.join(equal)} as they follow from the evaluations, or change them together.",
        )
    chosen = values(changed)
    changes = {knob: chosen[knob] for knob in {**equal, **requested}}
    return Candidate(name, tracker, weighting, total, changes, body)


def _check_shared(shared: Mapping[str, Value], names: Sequence[str], weighting: str) -> None:
    """Raise SettingsError for a knob that no candidate has."""
    known = {knob for name in names for knob in values(default_settings(name.partition(":")[0], weighting))}
    for knob in shared:
        if knob in (WEIGHTING, BODY):
            raise SettingsError(
                f"The {knob} of all trackers is not a knob.",
                f"Choose it with --{knob}, or for one tracker by its name.",
            )
        if knob not in known:
            raise SettingsError(
                f"No tracker of the comparison has a setting '{knob}'.", f"Known: {', '.join(sorted(known))}."
            )
