"""Knobs and settings as the API shows them."""

from studio.knobs import Knob
from studio.runs.moved_knobs import moved_between, settings_with_moved, stored_settings
from studio.server.setting_schemas import KnobView, SettingsChange, SettingsInUse
from studio.sessions.stored_run import StoredRun
from studio.settings import RunSettings, SettingsEntry, SettingsHistory, all_knobs, default_settings


def knob_views(settings: RunSettings) -> list[KnobView]:
    """The knobs of settings, group after group."""
    return [knob_view(entry) for entry in all_knobs(settings)]


def knob_view(entry: Knob) -> KnobView:
    """One declaration as the API shows it."""
    return KnobView.of(entry, kind=entry.kind.__name__)


def history_of(run: StoredRun) -> SettingsHistory:
    """Every version of the settings that a run has used."""
    with run.results() as results:
        stored = results.settings_history()
    return SettingsHistory(
        tuple(SettingsEntry(entry.version, entry.frame, entry.layer, entry.values) for entry in stored)
    )


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
