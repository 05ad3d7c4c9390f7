"""Ready-made settings: the studio's own, and those that a person kept (a file of the workspace)."""

import threading
from dataclasses import dataclass
from pathlib import Path

import msgspec

from studio.foundations.errors import NotFoundError, StudioError
from studio.foundations.knobs import Value
from studio.search.settings import changed_settings, default_settings, in_todays_names, knob_table, values
from studio.search.trackers.catalogue import presets
from studio.search.trackers.tracker import Preset
from studio.sessions.record_files import Entries, RecordFile


@dataclass(frozen=True, slots=True)
class PresetView:
    """Ready-made settings: some knobs, or a paper's whole tracker.

    tracker, weighting, body : that it is made for (weighting: the likelihood); empty fits any that has its knobs, and
        the session's body.
    own : whether a person kept it, so that it can be deleted.
    """

    name: str
    label: str
    help: str
    values: dict[str, Value]
    tracker: str = ""
    weighting: str = ""
    body: str = ""
    own: bool = False


FILE_NAME = "presets.json"
MOST = 100

_lock = threading.Lock()


class PresetError(StudioError, status=422, code="preset"):
    """A preset that cannot be kept."""


class _Kept(msgspec.Struct):
    help: str
    values: dict[str, Value]
    tracker: str = ""
    weighting: str = ""
    body: str = ""


class _File(msgspec.Struct):
    presets: dict[str, _Kept]
    schema: int = 2


def _with_trackers(entries: Entries) -> Entries:
    """Version 1 had presets by name, without tracker: it is the only one that has all their knobs, if there is one."""
    by_name: Entries = {}
    for name, kept in entries.items():
        if name != "schema":
            wanted = in_todays_names(kept["values"])
            having = [one for one in OF_THAT_TIME if wanted.keys() <= values(default_settings(one)).keys()]
            by_name[name] = {**kept, "values": wanted, "tracker": having[0] if len(having) == 1 else ""}
    return {"presets": by_name, "schema": 2}


OF_THAT_TIME = ("annealed", "behaviour", "condensation", "swarm")
"""The trackers of presets of the first version."""
_KEPT = RecordFile(
    _File,
    "a list of kept presets",
    "Move the file away; what it says can be typed again.",
    ("No preset is kept in '{folder}'.", "Keep one first."),
    version=2,
    migrations={1: _with_trackers},
)


def all_presets(folder: Path) -> list[PresetView]:
    """The studio's presets, then a person's own by name."""
    own = _own(folder)
    return [_view(entry, own=entry.name in own) for entry in (*presets(), *own.values())]


def preset(name: str, folder: Path) -> Preset:
    """The preset of that name. Raises NotFoundError."""
    known = {entry.name: entry for entry in presets()} | _own(folder)
    if name in known:
        return known[name]
    raise NotFoundError(f"There is no preset '{name[:64]}'.", f"Known: {', '.join(known)}.")


def _own(folder: Path) -> dict[str, Preset]:
    """A person's own presets by name; none where their file is damaged, which keeping another preset reports."""
    try:
        kept = _read_kept(folder)
    except StudioError:
        return {}
    # One may be older than a knob's name.
    return {
        name: Preset(name, one.help, in_todays_names(one.values), one.tracker, one.weighting, one.body)
        for name, one in sorted(kept.items())
    }


def keep_preset(
    name: str,
    help_text: str,
    wanted: dict[str, Value],
    folder: Path,
    *,
    tracker: str = "",
    weighting: str = "",
    body: str = "",
) -> None:
    """Keep a preset of a person's own, replacing one of the same name.

    tracker, weighting, body : see `PresetView`.

    Raises PresetError for a name of the studio's own presets, an unknown knob, or too many presets; SettingsError for
    an unknown tracker or weighting; SessionError where the kept presets cannot be read.
    """
    words = " ".join(name.split())
    if not 0 < len(words) <= 64 or any(entry.name == words for entry in presets()):
        raise PresetError(
            f"'{name[:64]}' cannot be a preset's name.", "Use 1 to 64 characters, no name taken."
        )
    if tracker and weighting:
        changed_settings(default_settings(tracker, weighting), wanted)
    known = {entry.name for entry in knob_table()}
    for setting in wanted:
        if setting not in known:
            raise PresetError(f"There is no setting '{setting[:64]}'.", "Compare it with /api/knobs.")
    with _lock:
        kept = _read_kept(folder) | {words: _Kept(help_text, wanted, tracker, weighting, body)}
        if len(kept) > MOST:
            raise PresetError(f"There are {MOST} presets already.", "Delete one first.")
        _write(folder, kept)


def drop_preset(name: str, folder: Path) -> None:
    """Delete a preset of a person's own. Raises NotFoundError."""
    with _lock:
        kept = _read_kept(folder)
        if name not in kept:
            raise NotFoundError(f"There is no preset '{name[:64]}' of your own.", "Choose one that you kept.")
        del kept[name]
        _write(folder, kept)


def _view(entry: Preset, *, own: bool) -> PresetView:
    made_for = (entry.tracker, entry.weighting, entry.body)
    return PresetView(entry.name, entry.name, entry.help, entry.values, *made_for, own)


def _read_kept(folder: Path) -> dict[str, _Kept]:
    """The kept presets. Raises SessionError for a damaged file."""
    return _KEPT.read(folder / FILE_NAME, _File({})).presets


def _write(folder: Path, kept: dict[str, _Kept]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    _KEPT.write(folder / FILE_NAME, _File(kept))
