"""Offsets and turns of a session's cameras, changed after the import.

The footage's files are unchanged; only the manifest changes. Runs keep their own frame numbers, which count frames
before the change: `stale_runs` names these runs by their creation time.
"""

import dataclasses
import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from studio.footage.capture.footage import camera_reader
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.footage.capture.frame_pairing import paired_by_time
from studio.footage.capture.interlacing import times_of_fields
from studio.footage.capture.naming import listed, match_names
from studio.footage.capture.pictures import list_pictures
from studio.footage.capture.synchrony import MOST_SECONDS, Synchrony, estimate_synchrony
from studio.footage.capture.timestamps import TimedOffsets, offsets_from_times, read_timestamps
from studio.footage.capture.video import measure_video, probe_video
from studio.foundations.arrays import Array
from studio.foundations.errors import FootageError, SessionError
from studio.foundations.progress import Progress, no_progress
from studio.sessions.background_files import (
    MASKS_GONE,
    forget_unused_masks,
    has_made_masks,
    without_made_masks,
)
from studio.sessions.importers.measuring import checked_turn, in_step
from studio.sessions.provenance import adopt
from studio.sessions.run_record import FILE_NAME as RUN_FILE_NAME
from studio.sessions.session import THUMBNAIL_NAME, Session, check_unchanged, redescribe, start_pose_files
from studio.sessions.stored_run import StoredRun
from studio.sessions.stroke_files import OUTDATED, STROKES_NAME
from studio.sessions.work_under_way import one_at_a_time


@dataclass(frozen=True, slots=True)
class FootageChange:
    """A change of offsets or turns. session : after it. notes : sentences. stale_runs : names of runs."""

    session: Session
    notes: tuple[str, ...]
    stale_runs: tuple[str, ...]


def change_footage(
    session: Session, offsets: Mapping[str, int] | None = None, rotations: Mapping[str, int] | None = None
) -> FootageChange:
    """Set cameras' offsets (the file's frame that was taken with the others' frame 0) and turns (degrees
    clockwise); cameras that are not named keep theirs. Frame 0 becomes the first one that all cameras have.

    Raises FootageError where no common frame is left, masks are too few, or a turned picture is not of the calibrated
    size; SessionError while a run is being tracked.
    """
    session.check_idle()
    if not session.has_footage:
        raise SessionError(f"Session '{session.name}' has no footage yet.", "Add it first.")
    before = session.manifest.footage
    return _use(session, before, _change(session, before, dict(offsets or {}), dict(rotations or {})))


def pair_by_time(
    session: Session, timestamps: Path | None = None, progress: Progress = no_progress
) -> FootageChange:
    """Pair a session's frames by their times from its frame 0 on: a recorder's, else those of its videos.

    Raises FootageError where there are none, masks are too few, SessionError while a run is being tracked.
    """
    session.check_idle()
    before = session.manifest.footage
    recorded = {} if timestamps is None else _recorded_times(session, timestamps)
    times: dict[str, Array] = {}
    for camera in before.cameras:
        own = recorded.get(camera.name)
        place = session.path / camera.path
        if own is None and camera.kind == "video":

            def report(done: int, total: int, name: str = camera.name) -> None:
                progress(f"times of {name}", done, total)

            own = measure_video(place, report).times
        if own is not None and camera.fields:
            own = times_of_fields(own, camera.frame_count)
        if own is None or len(own) < 2:
            own = np.arange(camera.frame_count) / before.fps
        times[camera.name] = own[camera.offset : camera.frame_count]
    steps, count = paired_by_time(times, before.fps)
    cameras = tuple(dataclasses.replace(camera, steps=steps[camera.name]) for camera in before.cameras)
    if any(camera.steps != old.steps for camera, old in zip(cameras, before.cameras, strict=True)):
        cameras = without_made_masks(session, cameras)
    for camera in cameras:
        _check_mask_count(session, camera, camera.file_frame(count - 1) + 1)
    return _use(session, before, dataclasses.replace(before, cameras=cameras, frame_count=count))


def _use(session: Session, before: FootageSource, after: FootageSource) -> FootageChange:
    """Make a description the session's."""
    if after == before:
        return FootageChange(session, ("Nothing changes.",), stale_runs(session))
    with one_at_a_time(session.path):
        check_unchanged(session, "footage")
        adopt(session)
        manifest = msgspec.structs.replace(
            session.manifest, footage=after, footage_changed=datetime.datetime.now(datetime.UTC).isoformat()
        )
        (session.path / THUMBNAIL_NAME).unlink(missing_ok=True)
        changed = redescribe(session, manifest)
        forget_unused_masks(changed)
    stale = stale_runs(changed)
    return FootageChange(changed, tuple(_consequences(changed, before, after, stale)), stale)


def stale_runs(session: Session) -> tuple[str, ...]:
    """Names of the runs that were made before the footage's offsets or turns were last changed."""
    if not session.manifest.footage_changed:
        return ()
    changed = datetime.datetime.fromisoformat(session.manifest.footage_changed)
    return tuple(run.name for run in session.runs() if _made_before(run, changed))


def synchrony_of(
    session: Session, progress: Progress | None = None, most_seconds: float = MOST_SECONDS
) -> Synchrony:
    """Offsets of a session's cameras estimated from motion; changes nothing. Raises FootageError."""
    source = session.manifest.footage
    if not source.cameras:
        raise SessionError(f"Session '{session.name}' has no footage yet.", "Add it first.")
    readers = [camera_reader(camera, session.path) for camera in source.cameras]
    try:
        return estimate_synchrony(source, lambda index: readers[index].read, progress, most_seconds)
    finally:
        for reader in readers:
            reader.close()


def recorded_offsets(session: Session, path: Path) -> TimedOffsets:
    """Offsets of a session's cameras by a recorder's times; changes nothing. Raises FootageError."""
    return offsets_from_times(_recorded_times(session, path))


def _recorded_times(session: Session, path: Path) -> dict[str, Array]:
    """Seconds of all cameras' frames by a recorder. Raises FootageError where a camera has none."""
    times = read_timestamps(path)
    names = [camera.name for camera in session.manifest.footage.cameras]
    matches = match_names(list(times), names, f"cameras of {path.name}", FootageError)
    if len(matches) < len(names):
        raise FootageError(
            f"'{path.name}' has times of {len(matches)} of the {len(names)} cameras.",
            "Give the offsets by hand.",
        )
    recorded = {match.camera: times[match.footage] for match in matches}
    split = {camera.name: camera.frame_count for camera in session.manifest.footage.cameras if camera.fields}
    return recorded | {name: times_of_fields(recorded[name], count) for name, count in split.items()}


def _change(
    session: Session, source: FootageSource, offsets: dict[str, int], rotations: dict[str, int]
) -> FootageSource:
    """The footage's description with the change. Raises FootageError."""
    names = [camera.name for camera in source.cameras]
    unknown = sorted({*offsets, *rotations} - set(names))
    if unknown:
        raise FootageError(f"There is no camera '{unknown[0]}'.", f"The cameras are {listed(names)}.")
    placed = in_step({camera.name: offsets.get(camera.name, camera.offset) for camera in source.cameras})
    known = session.cameras() if session.is_calibrated else ()
    sizes = {camera.name: (camera.width, camera.height) for camera in known}
    cameras = tuple(
        dataclasses.replace(
            _turned(camera, rotations.get(camera.name, camera.turned), sizes.get(camera.name)),
            offset=placed[camera.name],
        )
        for camera in source.cameras
    )
    if any(camera.offset != old.offset for camera, old in zip(cameras, source.cameras, strict=True)):
        # What is paired by time counts from the frame 0 of before.
        cameras = tuple(
            dataclasses.replace(camera, steps=()) for camera in without_made_masks(session, cameras)
        )
    count = min(camera.last for camera in cameras)
    if count < 1:
        words = ", ".join(
            f"{camera.name}: {camera.frame_count} from {camera.offset} on" for camera in cameras
        )
        raise FootageError(
            f"With these offsets no frame is left that all cameras have ({words}).", "Correct them."
        )
    for camera in cameras:
        _check_mask_count(session, camera, camera.file_frame(count - 1) + 1)
    return dataclasses.replace(source, cameras=cameras, frame_count=count)


def _check_mask_count(session: Session, camera: CameraSource, needed: int) -> None:
    """Raises FootageError for a camera with fewer masks than that."""
    present = _masks_of(session, camera)
    if 0 < present < needed:
        raise FootageError(
            f"Camera {camera.name} has {present} masks, and with these offsets {needed} are needed.",
            "Import the session again with masks of all frames, or without masks.",
        )


def _made_before(run: StoredRun, changed: datetime.datetime) -> bool:
    """Whether a run is older than a change; records hold whole seconds, within which the file's own time decides."""
    made = datetime.datetime.fromisoformat(run.record.created)
    if made != changed.replace(microsecond=0):
        return made < changed
    return (run.folder / RUN_FILE_NAME).stat().st_mtime < changed.timestamp()


def _masks_of(session: Session, camera: CameraSource) -> int:
    """The number of masks of a camera, 0 if there are none or it is unknown."""
    place = session.path / camera.masks
    if not camera.masks:
        return 0
    return len(list_pictures(place)) if place.is_dir() else probe_video(place).frame_count


def _turned(camera: CameraSource, degrees: int, calibrated: tuple[int, int] | None) -> CameraSource:
    """A camera's footage at another turn. calibrated : (width, height), None before. Raises FootageError."""
    turn = checked_turn(camera.name, degrees)
    width, height = camera.width, camera.height
    if (turn - camera.turned) % 180:
        width, height = height, width
    if calibrated is not None and (width, height) != calibrated:
        raise FootageError(
            f"Turned by {turn} degrees, the pictures of camera {camera.name} are {width}x{height}, and its calibration"
            f" is for {calibrated[0]}x{calibrated[1]}.",
            "Turn it the other way round, or import the session again with a calibration of the turned pictures.",
        )
    return dataclasses.replace(camera, turned=turn, width=width, height=height)


def _consequences(
    session: Session, before: FootageSource, after: FootageSource, stale: tuple[str, ...]
) -> list[str]:
    notes = [f"{after.frame_count} frames are in all cameras (there were {before.frame_count})."]
    moved = any(
        (a.offset, a.steps) != (b.offset, b.steps) for a, b in zip(before.cameras, after.cameras, strict=True)
    )
    if any(map(has_made_masks, before.cameras)) and not any(map(has_made_masks, after.cameras)):
        notes.append(MASKS_GONE)
    if (session.path / STROKES_NAME).exists():
        notes.append(OUTDATED)
    if stale:
        notes.append(
            f"Run {listed(stale)} was tracked before this change: its poses stay, but pictures and overlays now"
            " show other frames. Track again."
        )
    if moved and start_pose_files(session.path):
        notes.append("The start pose belongs to the old frame 0: find it again with 'studio initialise'.")
    if moved and session.truth_path is not None:
        notes.append("The truth counts its time from the old frame 0: check it before you evaluate.")
    return notes
