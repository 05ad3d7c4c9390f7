"""The preferences of a person's pages (theme, speed, folded panels): a free object in a file of the workspace."""

from pathlib import Path

import msgspec

from studio.foundations.errors import SessionError, StudioError
from studio.foundations.foreign_files import LARGEST_RECORD, read_file
from studio.foundations.typed_decoding import decode_json
from studio.sessions.atomic_files import write_bytes

FILE_NAME = "preferences.json"
LARGEST = 16_384
"""Bytes."""


class PreferencesError(StudioError, status=422, code="preferences"):
    """View preferences that cannot be kept."""


def read_preferences(folder: Path) -> dict[str, object]:
    """The stored object; a missing or damaged file counts as empty, since nothing depends on it."""
    try:
        return decode_json(read_file(folder / FILE_NAME, LARGEST_RECORD), dict[str, object])
    except (OSError, SessionError, msgspec.DecodeError):
        return {}


def change_preferences(folder: Path, changes: dict[str, object]) -> dict[str, object]:
    """Set some entries (None removes one), and return all. Raises PreferencesError for more than LARGEST."""
    kept = {name: value for name, value in (read_preferences(folder) | changes).items() if value is not None}
    content = msgspec.json.encode(kept)
    if len(content) > LARGEST:
        raise PreferencesError(
            f"The view preferences take {len(content)} bytes.", f"Keep them under {LARGEST}."
        )
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / FILE_NAME, content)
    return kept
