"""The tracks of a run: the search's own, and those derived from it.

`raw` is in the results store; every other track is one file `tracks/<name>.npz` in the run's folder, so that refining
or smoothing never overwrites the search's result. Frames missing from a track are gaps. A derived track keeps a digest
of its source, which shows whether the run has changed since (`best_track`).
"""

import hashlib
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, read_archive
from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.foreign_files import foreign_file
from studio.foundations.typed_decoding import decode_json
from studio.search.trackers.tracker import TRACKING_STATES
from studio.sessions.atomic_files import write_bytes, writing
from studio.sessions.names import checked_name, is_name
from studio.sessions.stored_run import StoredRun

Plain = Any
"""What JSON can hold."""

RAW, SIDES, REFINED, SMOOTHED = "raw", "sides", "refined", "smoothed"
BEST = "best"
"""Names the best track available (`best_track`)."""
SOURCE, SOURCE_DIGEST = "from", "from_digest"
"""Entries of `made_by`: the source track, and its digest."""
FOLDER, ENDING = "tracks", ".npz"
SCHEMA_VERSION = 1
ENTRIES = ("frames", "poses", "confidence", "states", "made_by", "schema")
KNOWN_STATES = (*TRACKING_STATES, "")


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The poses of a run's frames, tracked or derived.

    name : "raw", "refined", "smoothed", …
    frames : (K,) ascending; a missing number is a gap.
    poses : (K, D) radians and mm.
    confidence : (K,) 0 to 1, NaN unknown (of the search: how well the silhouettes agree, f_s).
    states : K words of `search.trackers.tracker.TRACKING_STATES`, "" unknown.
    made_by : "verb", "from" and the settings; {} for raw.
    """

    name: str
    frames: NDArray[np.int64]
    poses: Array
    confidence: Array
    states: tuple[str, ...]
    made_by: Mapping[str, Plain] = field(default_factory=dict[str, Plain])


def track_names(run: StoredRun) -> tuple[str, ...]:
    """The run's tracks, raw first, the others by name."""
    stems = (path.stem for path in (run.folder / FOLDER).glob(f"*{ENDING}"))
    return (RAW, *sorted(name for name in stems if is_name(name) and name != RAW))


@dataclass(frozen=True, slots=True)
class BestTrack:
    """The best track of a run. name : "smoothed", else "refined", else "sides", else "raw". outdated : better ones
    whose run or source track has changed since.
    """

    name: str
    outdated: tuple[str, ...] = ()

    @property
    def note(self) -> str:
        """A sentence on the outdated tracks; "" for none."""
        if not self.outdated:
            return ""
        names = " and ".join(f"'{name}'" for name in self.outdated)
        one = len(self.outdated) == 1
        return (
            f"Track{'' if one else 's'} {names} {'was' if one else 'were'} made before the run changed: '{self.name}'"
            f" is taken. Make {'it' if one else 'them'} again, or name {'it' if one else 'one'}."
        )


def best_track(run: StoredRun, among: Sequence[str] = (SMOOTHED, REFINED, SIDES)) -> BestTrack:
    """The first existing track of `among` (by default smoothed, refined, sides), else the raw one. Tracks whose source
    has changed since do not count. Raises SessionError if one is damaged.
    """
    names, outdated = track_names(run), list[str]()
    for name in among:
        if name in names:
            if _up_to_date(run, read_track(run, name), names):
                return BestTrack(name, tuple(outdated))
            outdated.append(name)
    return BestTrack(RAW, tuple(outdated))


def track_digest(track: Track) -> str:
    """A digest (24 hex digits) of a track's frames and poses."""
    made = hashlib.sha256(track.frames.tobytes())
    made.update(track.poses.tobytes())
    return made.hexdigest()[:24]


def track_named(run: StoredRun, name: str) -> str:
    """The name of a track; for BEST that of the best one."""
    return best_track(run).name if name == BEST else name


def _up_to_date(run: StoredRun, track: Track, names: tuple[str, ...]) -> bool:
    """Whether the track's sources, down to the raw one, are unchanged. Without a digest a track counts as up to date
    while it reaches the raw track's end.
    """
    seen = {track.name}
    while track.name != RAW:
        source, digest = track.made_by.get(SOURCE, RAW), track.made_by.get(SOURCE_DIGEST)
        if source not in names or source in seen or digest is None:
            last = read_track(run, RAW).frames[-1:].tolist()
            return set(last) <= {*track.frames.tolist(), *track.made_by.get("left_out", ())}
        made_from = read_track(run, source)
        if track_digest(made_from) != digest:
            return False
        track = made_from
        seen.add(track.name)
    return True


def read_track(run: StoredRun, name: str = RAW, *, blobs: bool = True) -> Track:
    """A track by its name, BEST for the best. blobs : of the search's own, as `ResultsReader.damaged`. Raises
    NotFoundError if there is none, SessionError if it is damaged.
    """
    name = track_named(run, name)
    if name == RAW:
        return _raw_track(run, blobs)
    path = _path(run, name)
    if not path.is_file():
        raise NotFoundError(
            f"Run '{run.name}' has no track '{name[:64]}'.",
            f"It has: {', '.join(track_names(run))}. Make others with 'studio refine' or 'studio smooth'.",
        )
    what = f"the track '{name}' of run '{run.name}'"
    with foreign_file(path, SessionError, what, "Make it again with 'studio refine' or 'studio smooth'."):
        arrays = read_archive(path)
        entries = {entry: arrays[entry] for entry in ENTRIES}
        track = _from_entries(name, entries)
        _check(track, len(run.record.parameters))
        return track


def pose_in_track(run: StoredRun, name: str, frame: int) -> Array:
    """(D,) the pose of a track in a frame. Raises NotFoundError for no such track or a gap there."""
    track = read_track(run, name)
    row = int(np.searchsorted(track.frames, frame))
    if row == len(track.frames) or track.frames[row] != frame:
        raise NotFoundError(
            f"Track '{name}' of run '{run.name}' has no frame {frame}.", "Choose a frame that it has."
        )
    return track.poses[row]


def track_stamp(run: StoredRun, name: str) -> int:
    """A number that changes when a derived track is written again; 0 where there is none."""
    try:
        return _path(run, name).stat().st_mtime_ns
    except FileNotFoundError:
        return 0


def write_track(run: StoredRun, track: Track, *, replace: bool = False) -> Path:
    """Store a track with the run's others, atomically; returns its file.

    replace : overwrite a derived track of that name. Raises SessionError for "raw", a name that is taken, or arrays
    that do not fit each other or the run.
    """
    if track.name.lower() in (RAW, BEST):
        what = (
            "the search's own and cannot be changed"
            if track.name.lower() == RAW
            else "reserved for the best one"
        )
        raise SessionError(f"Track '{track.name}' is {what}.", "Choose another name with --into.")
    path = _path(run, track.name)
    try:
        _check(track, len(run.record.parameters))
    except ValueError as error:
        raise SessionError(
            f"Track '{track.name}' does not fit run '{run.name}': {error}.", "Give one row a frame."
        ) from None
    if path.exists() and not replace:
        raise SessionError(
            f"Run '{run.name}' has a track '{track.name}' already.", "Choose another name, or replace it."
        )
    stream = io.BytesIO()
    np.savez_compressed(
        stream,
        schema=np.array(SCHEMA_VERSION),
        frames=np.asarray(track.frames, dtype="<i8"),
        poses=np.asarray(track.poses, dtype="<f8"),
        confidence=np.asarray(track.confidence, dtype="<f8"),
        states=np.array([KNOWN_STATES.index(state) for state in track.states], dtype="|u1"),
        made_by=np.array(msgspec.json.encode(dict(track.made_by)).decode()),
    )
    with writing("The track", path):
        path.parent.mkdir(exist_ok=True)
    write_bytes(path, stream.getvalue())
    return path


def drop_track(run: StoredRun, name: str) -> None:
    """Remove a derived track, if there is one. Raises StudioError where that is not allowed."""
    path = _path(run, name)
    with writing("The track", path):
        path.unlink(missing_ok=True)


def _path(run: StoredRun, name: str) -> Path:
    return run.folder / FOLDER / f"{checked_name(name, 'track')}{ENDING}"


def _raw_track(run: StoredRun, blobs: bool) -> Track:
    """The track in the results store; empty for a run without frames."""
    with run.results() as results:
        frames, poses = results.poses(blobs=blobs)
        timeline = results.timeline(blobs=blobs)
    recorded = dict(
        zip(timeline.frames.tolist(), zip(timeline.overlaps, timeline.tracking, strict=True), strict=True)
    )
    known = [recorded.get(frame, (math.nan, "")) for frame in frames.tolist()]
    return Track(
        RAW,
        frames,
        poses if len(frames) else np.zeros((0, len(run.record.parameters))),
        np.array([entry[0] for entry in known], dtype=np.float64),
        tuple(entry[1] for entry in known),
    )


def _from_entries(name: str, entries: Mapping[str, NDArray[Any]]) -> Track:
    """A track from its file's arrays. Raises ValueError, DecodeError."""
    if int(entries["schema"]) > SCHEMA_VERSION:
        raise ValueError(f"schema version {int(entries['schema'])} is newer than this studio")
    codes: list[int] = entries["states"].tolist()
    if any(code >= len(KNOWN_STATES) for code in codes):
        raise ValueError("an unknown state")
    return Track(
        name,
        entries["frames"].astype(np.int64),
        entries["poses"].astype(np.float64),
        entries["confidence"].astype(np.float64),
        tuple(KNOWN_STATES[code] for code in codes),
        decode_json(str(entries["made_by"]).encode(), dict[str, Any]),
    )


def _check(track: Track, dimension: int) -> None:
    """Raises ValueError where the arrays do not fit each other or the body."""
    count = len(track.frames)
    if track.poses.shape != (count, dimension):
        raise ValueError(f"poses of shape {track.poses.shape} for {count} frames of {dimension} parameters")
    if track.confidence.shape != (count,) or len(track.states) != count:
        raise ValueError("confidence and states need one entry a frame")
    if np.any(np.diff(track.frames) <= 0):
        raise ValueError("frames do not ascend")
    if not np.isfinite(track.poses).all():
        raise ValueError("a pose has a number that is not finite")
    if any(state not in KNOWN_STATES for state in track.states):
        raise ValueError("an unknown state")
