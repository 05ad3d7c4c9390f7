"""A run in a few words says what its later frames were searched with."""

import dataclasses

from studio.operations.overview import describe
from studio.search.settings import SettingsEntry, SettingsHistory
from studio.sessions.stored_run import StoredRun


def test_another_size_later_in_the_run_is_said(tracked: StoredRun) -> None:
    record = tracked.record
    first = SettingsEntry(1, 0, 0, dict(record.settings))
    wider = dataclasses.replace(first, version=2, frame=3, values={**first.values, "survival": 0.9})
    fewer = dataclasses.replace(
        first, version=3, frame=6, values={**first.values, "layers": 3, "particles": 40}
    )
    assert describe(record, SettingsHistory((first, wider))) == describe(record)
    assert describe(record, SettingsHistory((first, wider, fewer))) == "annealed 10×100, 3×40 from frame 6"
