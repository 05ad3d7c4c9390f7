"""The trackers by name: a new one is one module and one line here, or a package's entry point (`registry`)."""

from collections.abc import Mapping

from studio.foundations.errors import SettingsError
from studio.foundations.knobs import Value, changed, knobs_of
from studio.foundations.registry import Registry
from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.behaviour_guided import BehaviourGuided
from studio.search.trackers.condensation import Condensation
from studio.search.trackers.particle_swarm import ParticleSwarm
from studio.search.trackers.tempered import TemperedFilter
from studio.search.trackers.tracker import AnyTracker, Preset, Tracker

NEEDED_KNOBS = ("start_repeats",)


def _check(tracker: AnyTracker) -> None:
    """Raise SettingsError where a required knob is missing."""
    has = {entry.name for entry in knobs_of(tracker.settings_type)}
    for knob in (*NEEDED_KNOBS, *(one for names in tracker.size_knobs for one in names)):
        if knob not in has:
            raise SettingsError(f"its settings have no knob '{knob}'")


TRACKERS: Registry[AnyTracker] = Registry(
    "tracker",
    "studio.trackers",
    Tracker,
    (AnnealedParticleFilter(), BehaviourGuided(), Condensation(), ParticleSwarm(), TemperedFilter()),
    _check,
)


def knobs_for_evaluations(tracker: str, evaluations: int, layers: int = 10) -> dict[str, int]:
    """Knobs by flat name with which a tracker evaluates about `evaluations` poses a frame.

    Trackers are compared at equal evaluations, which take nearly all of a frame's time (Fleischmann et al. 2012,
    section 3). Raises SettingsError where the number is too small or too large, UnknownMemberError for an unknown
    tracker.
    """
    chosen = TRACKERS[tracker]
    least = chosen.least_evaluations(layers)
    if evaluations < least:
        raise SettingsError(
            f"{evaluations} evaluations a frame are too few for the tracker '{tracker}'.",
            f"Give it {least} or more.",
        )
    knobs = chosen.evaluation_knobs(evaluations, layers)
    changed(chosen.settings_type(), knobs)
    return knobs


def size_in_words(tracker: str, values: Mapping[str, Value]) -> str:
    """Search size in words, like "10×200" (layers × particles), stages joined by "+"; "" if the tracker is not
    installed.

    values : knobs by name.
    """
    stages = TRACKERS[tracker].size_knobs if tracker in TRACKERS else ()
    words = ("×".join(str(values[name]) for name in names if name in values) for names in stages)
    return " + ".join(word for word in words if word)


def presets() -> tuple[Preset, ...]:
    """Ready-made settings of all trackers."""
    return tuple(preset for tracker in TRACKERS.values() for preset in tracker.presets)
