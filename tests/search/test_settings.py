"""All knobs of a run: unique, checked, rebuilt from a record, described to machines."""

import json

import msgspec
import pytest

from studio.evidence.settings import EvidenceSettings
from studio.foundations.errors import SettingsError
from studio.foundations.knobs import knobs_of
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import (
    DEFAULT_WEIGHTING,
    RecordingSettings,
    SettingsEntry,
    SettingsHistory,
    all_knobs,
    changed_settings,
    default_settings,
    json_schema,
    knob_table,
    settings_from_values,
    values,
)
from studio.search.trackers.catalogue import TRACKERS

PAIRS = [(tracker, weighting) for tracker in sorted(TRACKERS) for weighting in sorted(WEIGHTINGS)]


@pytest.mark.parametrize(("tracker", "weighting"), PAIRS)
def test_flat_names_are_unique(tracker: str, weighting: str) -> None:
    names = [entry.name for entry in all_knobs(default_settings(tracker, weighting))]
    assert len(names) == len(set(names))


@pytest.mark.parametrize(("tracker", "weighting"), PAIRS)
def test_defaults_are_allowed_and_survive_a_record(tracker: str, weighting: str) -> None:
    settings = default_settings(tracker, weighting)
    recorded = json.loads(json.dumps(values(settings)))
    assert settings_from_values(tracker, weighting, recorded) == settings


@pytest.mark.parametrize("entry", knob_table(), ids=lambda entry: f"{entry.group}-{entry.name}")
def test_every_knob_is_declared_whole(entry) -> None:
    assert entry.help.endswith((".", "?"))
    assert entry.label
    assert entry.group
    assert entry.takes_effect in ("next layer", "next frame", "new run")
    if entry.kind in (int, float):
        assert entry.low is not None
        assert entry.high is not None
        assert entry.low <= entry.default <= entry.high
    if entry.choices:
        assert entry.default in entry.choices


def test_the_table_has_every_settings_class_once() -> None:
    table = knob_table()
    assert len({(entry.group, entry.name) for entry in table}) == len(table)
    for settings_type in (EvidenceSettings, RecordingSettings, TRACKERS["condensation"].settings_type):
        assert set(knobs_of(settings_type)) <= set(table)


def test_the_knobs_of_values_are_those_of_their_class_and_keep_no_value() -> None:
    tracker = default_settings().tracker
    assert knobs_of(tracker) is knobs_of(type(tracker))
    changed = changed_settings(default_settings(), {"layers": 7}).tracker
    assert knobs_of(changed) is knobs_of(tracker)


def test_the_issues_defaults() -> None:
    now = values(default_settings())
    assert (now["layers"], now["particles"], now["crossover"]) == (10, 100, 0.5)
    assert now["adaptive_diffusion"] is True
    assert now["carry"] == "weighted"
    assert now["record_particles"] == 2000


def test_changes_reach_their_groups() -> None:
    settings = default_settings("annealed", "edge-region")
    knob = knobs_of(type(settings.weighting))[0]
    changed = changed_settings(
        settings, {"survival": "0.4", "record_particles": 10, knob.name: knob.high, "mask_threshold": 6}
    )
    assert changed.tracker.survival == 0.4
    assert changed.recording.record_particles == 10
    assert getattr(changed.weighting, knob.name) == knob.high
    assert changed.evidence.mask_threshold == 6.0
    assert settings == default_settings("annealed", "edge-region")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"survival": 1.5}, "'survival' cannot be 1.5"),
        ({"particles": 2.5}, "'particles' cannot be 2.5"),
        ({"layers": 5, "survivel": 0.4}, "no setting 'survivel'"),
        ({"carry": "nothing"}, "'carry' cannot be 'nothing'"),
        ({"survival_per_layer": "0.5,x"}, "'survival_per_layer' cannot be"),
    ],
)
def test_what_is_not_allowed_is_named(changes: dict[str, object], said: str) -> None:
    with pytest.raises(SettingsError, match=said) as caught:
        changed_settings(default_settings(), changes)
    assert caught.value.hint


def test_a_misspelt_name_gets_the_nearest() -> None:
    with pytest.raises(SettingsError) as caught:
        changed_settings(default_settings(), {"partciles": 10})
    assert caught.value.hint == "Did you mean 'particles'?"


@pytest.mark.parametrize(
    ("limits", "constraints"), [("clamp", "clamp"), ("reflect", "clamp"), ("ignore", "ignore")]
)
def test_a_record_with_an_older_knob_is_understood(limits: str, constraints: str) -> None:
    recorded = {**values(default_settings()), "limits": limits}
    del recorded["constraints"], recorded["limbs_apart"]
    settings = settings_from_values("annealed", DEFAULT_WEIGHTING, recorded)
    assert settings == changed_settings(default_settings(), {"constraints": constraints})
    with pytest.raises(SettingsError, match="'limits'"):
        changed_settings(default_settings(), {"limits": limits})


def test_a_record_from_before_frames_were_refined_stays_unrefined() -> None:
    recorded = values(default_settings())
    assert settings_from_values("annealed", DEFAULT_WEIGHTING, recorded).refinement.refine_frames
    del recorded["refine_frames"]
    assert not settings_from_values("annealed", DEFAULT_WEIGHTING, recorded).refinement.refine_frames


def test_another_trackers_knob_says_whose_settings_these_are() -> None:
    with pytest.raises(SettingsError, match="tracker 'condensation'"):
        changed_settings(default_settings("condensation"), {"layers": 5})


@pytest.mark.parametrize(("tracker", "weighting"), [("flock", "edge-region"), ("annealed", "magic")])
def test_unknown_names_are_refused(tracker: str, weighting: str) -> None:
    with pytest.raises(SettingsError, match=r"There is no (tracker 'flock'|weighting 'magic')"):
        default_settings(tracker, weighting)


def test_schema_describes_every_knob() -> None:
    settings = changed_settings(default_settings(), {"survival": 0.3})
    schema = json_schema(settings)
    assert set(schema["properties"]) == set(values(settings))
    survival = schema["properties"]["survival"]
    assert (survival["type"], survival["default"]) == ("number", 0.3)
    assert (survival["minimum"], survival["maximum"]) == (0.02, 0.98)
    assert survival["x-takes-effect"] == "next layer"
    assert schema["properties"]["carry"]["enum"] == ["weighted", "resampled", "mode"]
    assert schema["properties"]["layers"]["type"] == "integer"
    assert schema["properties"]["adaptive_diffusion"]["type"] == "boolean"
    assert schema["additionalProperties"] is False
    json.dumps(schema)


def test_history_tells_what_was_in_use() -> None:
    first = default_settings()
    second = changed_settings(first, {"survival": 0.4})
    history = SettingsHistory().with_applied(1, 10, 0, first).with_applied(2, 12, 4, second)
    assert history.with_applied(2, 13, 0, second) is history
    assert history.in_use(9, 9) is None
    for frame, layer, version in ((10, 0, 1), (12, 3, 1), (12, 4, 2), (12, 5, 2), (99, 0, 2)):
        entry = history.in_use(frame, layer)
        assert entry.version == version
    assert history.changes()[1] == ("survival",)
    assert set(history.changes()[0]) == set(values(first))
    encoded = msgspec.json.encode(history.entries)
    assert msgspec.json.decode(encoded, type=tuple[SettingsEntry, ...]) == history.entries


def test_a_number_beyond_all_numbers_is_refused_in_few_words() -> None:
    with pytest.raises(SettingsError, match="'particles' cannot be 999") as caught:
        changed_settings(default_settings(), {"particles": 10**400 - 1})
    assert len(caught.value.message) < 200
