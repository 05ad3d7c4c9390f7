"""Knobs and settings as the API shows them."""

from pydantic import Field

from studio.app.server.schemas import Answer, Value
from studio.foundations.knobs import Knob
from studio.runs.moved_knobs import moved_between, settings_with_moved, stored_settings
from studio.search.settings import RunSettings, SettingsHistory, all_knobs, default_settings
from studio.sessions.stored_run import StoredRun


class KnobView(Answer):
    """The declaration of one knob: all that a slider needs."""

    name: str
    label: str
    kind: str = Field(description="bool, int, float or str.")
    default: Value
    low: float | None
    high: float | None
    step: float | None
    unit: str
    choices: list[str]
    takes_effect: str = Field(description="next layer, next frame or new run.")
    help: str
    group: str


class SettingsChange(Answer):
    """When a version of the settings came into use, and which knobs moved."""

    version: int
    frame: int
    layer: int
    changed: list[str]


class SettingsInUse(Answer):
    """A run's settings: the newest version that its frames used, since when it is in use, and all changes before.

    moved : knobs that were moved since and that no stored frame uses; the search goes on with these values.
    """

    tracker: str
    weighting: str
    version: int
    frame: int
    layer: int
    values: dict[str, Value]
    knobs: list[KnobView]
    changes: list[SettingsChange]
    moved: dict[str, Value]


def knob_views(settings: RunSettings) -> list[KnobView]:
    """The knobs of settings, group after group."""
    return [knob_view(entry) for entry in all_knobs(settings)]


def knob_view(entry: Knob) -> KnobView:
    """One declaration as the API shows it."""
    return KnobView.of(entry, kind=entry.kind.__name__)


def history_of(run: StoredRun) -> SettingsHistory:
    """Every version of the settings that a run has used."""
    with run.results() as results:
        return SettingsHistory(tuple(results.settings_history()))


def changes_of(history: SettingsHistory) -> list[SettingsChange]:
    """Where settings changed after the start, and which knobs."""
    named = zip(history.entries, history.changes(), strict=True)
    return [
        SettingsChange(version=entry.version, frame=entry.frame, layer=entry.layer, changed=list(names))
        for entry, names in named
    ][1:]


def settings_of(run: StoredRun) -> SettingsInUse:
    """A run's newest settings and the way there, from its store."""
    record = run.record
    history = history_of(run)
    defaults = default_settings(record.tracker, record.weighting)
    now = history.entries[-1] if history.entries else None
    return SettingsInUse(
        tracker=record.tracker,
        weighting=record.weighting,
        version=now.version if now else 1,
        frame=now.frame if now else record.first,
        layer=now.layer if now else 0,
        values=dict(now.values if now else record.settings),
        knobs=knob_views(defaults),
        changes=changes_of(history),
        moved=moved_between(stored_settings(run)[1], settings_with_moved(run)),
    )
