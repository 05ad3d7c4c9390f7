"""Ready-made settings: those that the studio brings, and those that a person kept (a file of the
workspace).
"""

import threading
from collections.abc import Mapping
from pathlib import Path

import msgspec

from studio.errors import NotFoundError, SessionError, StudioError
from studio.foreign_files import LARGEST_RECORD, read_file
from studio.server.schemas import Answer, Value
from studio.sessions.atomic_files import write_bytes
from studio.settings import in_todays_names, knob_table
from studio.trackers.catalogue import presets
from studio.typed_decoding import decode_json


class PresetView(Answer):
    """Ready-made settings: a handful of knobs. own: made by a person, so that it can be deleted."""

    name: str
    label: str
    help: str
    values: dict[str, Value]
    own: bool = False


FILE_NAME = "presets.json"
MOST = 100

_lock = threading.Lock()


class PresetError(StudioError, status=422, code="preset"):
    """A preset that cannot be kept."""


class _Kept(msgspec.Struct):
    help: str
    values: dict[str, Value]


def all_presets(folder: Path) -> list[PresetView]:
    """The studio's presets, then a person's own by name."""
    brought = [_view(entry.name, entry.help, entry.values, False) for entry in presets()]
    own = [_view(name, kept.help, kept.values, True) for name, kept in sorted(_read(folder).items())]
    return brought + own


def preset(name: str, folder: Path) -> PresetView:
    """The preset of that name. Raises NotFoundError."""
    known = all_presets(folder)
    for entry in known:
        if entry.name == name:
            return entry
    names = ", ".join(entry.name for entry in known)
    raise NotFoundError(f"There is no preset '{name[:64]}'.", f"Known: {names}.")


def keep_preset(name: str, help_text: str, values: dict[str, Value], folder: Path) -> None:
    """Keep a preset of a person's own, replacing one of the same name.

    Raises PresetError for a name that the studio's own presets have, an unknown knob, or too many.
    """
    words = " ".join(name.split())
    if not 0 < len(words) <= 64 or any(entry.name == words for entry in presets()):
        raise PresetError(
            f"'{name[:64]}' cannot be a preset's name.", "Use 1 to 64 characters, no name taken."
        )
    known = {entry.name for entry in knob_table()}
    for setting in values:
        if setting not in known:
            raise PresetError(f"There is no setting '{setting[:64]}'.", "Compare it with /api/knobs.")
    with _lock:
        kept = _read(folder) | {words: _Kept(help_text, values)}
        if len(kept) > MOST:
            raise PresetError(f"There are {MOST} presets already.", "Delete one first.")
        _write(folder, kept)


def drop_preset(name: str, folder: Path) -> None:
    """Delete a preset of a person's own. Raises NotFoundError."""
    with _lock:
        kept = _read(folder)
        if name not in kept:
            raise NotFoundError(f"There is no preset '{name[:64]}' of your own.", "Choose one that you kept.")
        del kept[name]
        _write(folder, kept)


def _view(name: str, help_text: str, values: Mapping[str, Value], own: bool) -> PresetView:
    # A person's preset may be older than a knob's name.
    return PresetView(name=name, label=name, help=help_text, values=in_todays_names(values), own=own)


def _read(folder: Path) -> dict[str, _Kept]:
    """The kept presets; a missing or damaged file counts as none."""
    try:
        return decode_json(read_file(folder / FILE_NAME, LARGEST_RECORD), dict[str, _Kept])
    except (OSError, SessionError, msgspec.DecodeError):
        return {}


def _write(folder: Path, kept: dict[str, _Kept]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / FILE_NAME, msgspec.json.encode(kept))
