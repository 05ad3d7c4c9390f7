"""Knobs that were moved in a run, but used by none of its stored frames: they lie in its folder, so that a reload,
another window and the next start of the studio show them as they were left.
"""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from studio.foundations.errors import SessionError, SettingsError
from studio.foundations.foreign_files import LARGEST_RECORD, read_file
from studio.foundations.knobs import Value
from studio.foundations.typed_decoding import decode_json
from studio.search.settings import RunSettings, changed_settings, settings_from_values, values
from studio.sessions.atomic_files import write_bytes
from studio.sessions.stored_run import StoredRun

FILE_NAME = "moved_knobs.json"
FIRST_VERSION = 1
"""Of the settings that a run was made with, which its store holds from its first layer on."""


class _MovedKnobs(msgspec.Struct):
    """after : the version of the run's newest settings when the knobs were moved."""

    after: int
    values: dict[str, Any]


def stored_settings(run: StoredRun) -> tuple[int, RunSettings]:
    """The newest settings that the run's frames used, and their version. Raises SessionError."""
    record = run.record
    with run.results() as results:
        history = results.settings_history()
    version, recorded = (
        (history[-1].version, history[-1].values) if history else (FIRST_VERSION, record.settings)
    )
    return version, settings_from_values(record.tracker, record.weighting, recorded)


def settings_with_moved(run: StoredRun) -> RunSettings:
    """The settings that the run continues with: the newest stored ones with the knobs that were moved since."""
    version, stored = stored_settings(run)
    return with_moved(run, version, stored)


def with_moved(run: StoredRun, version: int, stored: RunSettings) -> RunSettings:
    """The settings stored last, with the knobs that were moved since. A file that cannot be read, is older than these
    settings or holds what a knob does not allow moves nothing: no result depends on it.
    """
    try:
        moved = decode_json(read_file(_path(run), LARGEST_RECORD), _MovedKnobs)
    except (OSError, SessionError, msgspec.DecodeError):
        return stored
    if moved.after != version:
        return stored
    try:
        return changed_settings(stored, moved.values)
    except SettingsError:
        return stored


def moved_between(stored: RunSettings, now: RunSettings) -> dict[str, Value]:
    """The knobs whose values differ, with their new values."""
    before = values(stored)
    return {name: value for name, value in values(now).items() if value != before[name]}


def keep_moved(run: StoredRun, version: int, moved: Mapping[str, Value]) -> None:
    """Keep the knobs that were moved since the stored settings of a version; with none, forget the kept ones.

    Raises SessionError where the disk refuses.
    """
    path = _path(run)
    if moved:
        write_bytes(path, msgspec.json.encode(_MovedKnobs(version, dict(moved))))
    else:
        with contextlib.suppress(OSError):
            path.unlink()


def _path(run: StoredRun) -> Path:
    return run.folder / FILE_NAME
