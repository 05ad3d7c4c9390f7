"""Changes a session's calibration after the import, atomically; the earlier one is kept.

calibration/cameras.toml              the one in use
calibration/original…                 the files it was read from, byte for byte
calibration/cameras.report.json, …    the report of the board calibration
calibration/earlier/<time>/           each earlier one, complete, named by its time of replacement (UTC)

Runs keep their own copy; which of them were tracked with another one is computed from that.
"""

import dataclasses
import datetime
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from studio.footage.calibration.report import write_calibrated
from studio.footage.calibration.verbs import Calibrated
from studio.footage.capture.calibration_files import (
    AssumedCrop,
    Calibration,
    read_calibration,
    write_calibration,
)
from studio.footage.capture.footage_fit import NO_BARS, Margins, black_margins, fit_camera
from studio.footage.capture.footage_source import CameraSource
from studio.footage.capture.naming import CameraMatch, listed, match_names
from studio.foundations.errors import CalibrationError, FootageError, NotFoundError, SessionError
from studio.foundations.foreign_files import LARGEST_RECORD, read_file
from studio.foundations.geometry.camera import Camera
from studio.foundations.typed_decoding import decode_json, is_list, is_table
from studio.sessions import atomic_files, provenance
from studio.sessions.file_checksums import forget_files
from studio.sessions.manifest import SessionManifest
from studio.sessions.names import inside
from studio.sessions.run_record import CAMERAS_NAME
from studio.sessions.session import CAMERAS_PATH, THUMBNAIL_NAME, Session, check_unchanged, redescribe
from studio.sessions.work_under_way import one_at_a_time

EARLIER = "earlier"
REPORT_NAME = "cameras.report.json"
OWN_PARTS = ("original", "cameras.")
MOVED_MM = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class NewCalibration:
    """A session's new calibration. cameras : named and sized as its footage (`calibration_fit`). source : its origin,
    as text. originals : name → content of the files it was read from. crops, matching, notes : of the fit. calibrated
    : the board calibration, None for a file. floor : how the floor of the cameras in use was set again, "" for other
    cameras.
    """

    cameras: tuple[Camera, ...]
    source: str
    originals: Mapping[str, bytes] = field(default_factory=dict[str, bytes])
    crops: Mapping[str, AssumedCrop] = field(default_factory=dict[str, AssumedCrop])
    matching: tuple[CameraMatch, ...] = ()
    notes: tuple[str, ...] = ()
    calibrated: Calibrated | None = None
    floor: str = ""


@dataclass(frozen=True, slots=True)
class CalibrationChange:
    """A change of calibration. session : after it. notes : its consequences. stale_runs : runs with another
    calibration. kept : path of the earlier one, None if there was none.
    """

    session: Session
    notes: tuple[str, ...]
    stale_runs: tuple[str, ...]
    kept: Path | None


def replace_calibration(session: Session, new: NewCalibration) -> CalibrationChange:
    """Put another calibration in use.

    Raises SessionError while a run is being tracked, CalibrationError where a camera of the footage is missing.
    """
    with one_at_a_time(session.path):
        check_unchanged(session, "footage", "calibration_changed")
        return _replaced(session, new)


def _replaced(session: Session, new: NewCalibration) -> CalibrationChange:
    session.check_idle()
    names = {camera.name for camera in new.cameras}
    missing = [source.name for source in session.manifest.footage.cameras if source.name not in names]
    if missing or not new.cameras:
        raise CalibrationError(
            f"The calibration has no camera {listed(missing)}.", "Give one of all cameras that have footage."
        )
    provenance.adopt(session)
    place = session.path / CAMERAS_PATH
    before = read_calibration(place).cameras if _readable(place) else ()
    place.parent.mkdir(exist_ok=True)
    kept = _keep(place.parent) if place.exists() else None
    # The earlier originals lie with the calibration that is kept; here they are not lost but replaced.
    forget_files(
        session.path, (part.relative_to(session.path).as_posix() for part in _own_parts(place.parent))
    )
    _write(place, new)
    manifest = _describe(session.manifest, new)
    (session.path / THUMBNAIL_NAME).unlink(missing_ok=True)
    changed = redescribe(session, manifest)
    stale = stale_runs(changed)
    return CalibrationChange(changed, tuple(_consequences(changed, before, new.cameras, stale)), stale, kept)


def restore_calibration(session: Session, name: str, source: str) -> CalibrationChange:
    """Restore an earlier calibration, byte for byte with its other files; the current one is kept.

    name : one of `earlier_calibrations`. source : its origin, as text. Raises NotFoundError, SessionError
    while a run is being tracked, CalibrationError where it lacks a camera of the footage.
    """
    with one_at_a_time(session.path):
        return _restored(session, earlier_calibration(session, name), source)


def _restored(session: Session, folder: Path, source: str) -> CalibrationChange:
    place = session.path / CAMERAS_PATH
    before = read_calibration(place).cameras if _readable(place) else ()
    read = read_calibration(folder / CAMERAS_PATH.name)
    change = replace_calibration(session, NewCalibration(read.cameras, source, crops=read.crops))
    for path in _own_parts(folder):
        if path.is_dir():
            atomic_files.copy_part(path, place.parent / path.name)
        else:
            atomic_files.write_bytes(place.parent / path.name, read_file(path))
    stale = stale_runs(change.session)
    notes = tuple(_consequences(change.session, before, read.cameras, stale))
    return dataclasses.replace(change, stale_runs=stale, notes=notes)


def stale_runs(session: Session) -> tuple[str, ...]:
    """Names of the runs that were tracked with another calibration than the session's."""
    place = session.path / CAMERAS_PATH
    if not place.is_file():
        return ()
    now = session.calibration_of_footage()
    return tuple(run.name for run in session.runs() if _content(run.folder / CAMERAS_NAME) not in (b"", now))


def earlier_calibrations(session: Session) -> tuple[str, ...]:
    """The names of the earlier calibrations, newest first."""
    folder = session.path / CAMERAS_PATH.parent / EARLIER
    if not folder.is_dir():
        return ()
    names = [path.name for path in folder.iterdir() if (path / CAMERAS_PATH.name).is_file()]
    return tuple(sorted((name for name in names if name[0] != "."), reverse=True))


def earlier_calibration(session: Session, name: str) -> Path:
    """The folder of an earlier calibration. Raises NotFoundError, NameRefused."""
    folder = inside(session.path / CAMERAS_PATH.parent / EARLIER, name, "calibration")
    if not (folder / CAMERAS_PATH.name).is_file():
        raise NotFoundError(
            f"Session '{session.name}' kept no calibration '{name}'.",
            "Choose one of its earlier calibrations.",
        )
    return folder


def _keep(folder: Path) -> Path:
    """Copy everything of the calibration in use to a folder of its own."""
    now = datetime.datetime.now(datetime.UTC)
    place = folder / EARLIER / now.strftime("%Y%m%d-%H%M%S-%f")
    with atomic_files.made_whole(place, parents=False) as made:
        for path in _own_parts(folder):
            atomic_files.copy_part(path, made / path.name)
    return place


def _write(place: Path, new: NewCalibration) -> None:
    """Replace the canonical file atomically, then the files beside it."""
    made = atomic_files.new_folder_beside(place, parents=False)
    try:
        if new.calibrated is not None and new.calibrated.rig is not None:
            rig = dataclasses.replace(new.calibrated.rig, cameras=new.cameras)
            write_calibrated(
                dataclasses.replace(new.calibrated, rig=rig), made / CAMERAS_PATH.name, anyway=True
            )
        write_calibration(new.cameras, made / CAMERAS_PATH.name, dict(new.crops))
        single = len(new.originals) == 1
        for name, content in new.originals.items():
            ending = ".qca.txt" if name.lower().endswith(".qca.txt") else Path(name).suffix
            target = made / f"original{ending}" if single else made / "original" / Path(name).name
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(content)
        atomic_files.write_bytes(place, read_file(made / CAMERAS_PATH.name))
        if new.floor:
            _correct_report(place.with_name(REPORT_NAME), new)
            return
        for path in _own_parts(place.parent):
            if path.is_dir():
                shutil.rmtree(path)
            elif path != place:
                path.unlink()
        for path in made.iterdir():
            if path.name != place.name:
                path.rename(place.parent / path.name)
    finally:
        atomic_files.discard(made)


def _correct_report(path: Path, new: NewCalibration) -> None:
    """The board calibration of the same cameras, with their places in the new world."""
    try:
        report = decode_json(read_file(path, LARGEST_RECORD), dict[str, object])
    except (OSError, SessionError, msgspec.DecodeError):
        return
    places = {camera.name: np.round(camera.centre, 3).tolist() for camera in new.cameras}
    entries = report.get("cameras")
    for entry in entries if is_list(entries) else ():
        if is_table(entry) and entry.get("name") in places:
            entry["position_mm"] = places[str(entry["name"])]
    report["floor"] = new.floor
    atomic_files.write_bytes(path, msgspec.json.format(msgspec.json.encode(report), indent=2))


def _own_parts(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.name.startswith(OWN_PARTS)]


def _describe(manifest: SessionManifest, new: NewCalibration) -> SessionManifest:
    crops = tuple(crop.words(name) for name, crop in new.crops.items())
    return msgspec.structs.replace(
        manifest,
        calibration_source=new.source,
        calibration_changed=datetime.datetime.now(datetime.UTC).isoformat(),
        assumptions=(*new.notes[:1], *crops),
        matching=new.matching or manifest.matching,
    )


def _consequences(
    session: Session, before: Sequence[Camera], after: Sequence[Camera], stale: tuple[str, ...]
) -> list[str]:
    notes: list[str] = []
    if stale:
        notes.append(
            f"Run {listed(stale)} was tracked with another calibration: it keeps its poses and its own copy. Track"
            " again to use the new one."
        )
    old = {camera.name: camera.centre for camera in before}
    far = [float(np.linalg.norm(camera.centre - old[camera.name])) for camera in after if camera.name in old]
    if not far or max(far) < MOVED_MM:
        return notes
    moved = f"The cameras are up to {max(far):.0f} mm from their earlier places"
    if (session.path / provenance.FILES["start-pose"]).exists():
        notes.append(f"{moved}: check whether the start pose still fits, or find it again.")
    if session.truth_path is not None:
        notes.append(f"{moved}: the truth stays in the old world.")
    return notes


def _readable(place: Path) -> bool:
    if not place.is_file():
        return False
    try:
        return bool(read_calibration(place).cameras)
    except CalibrationError:
        return False


def _content(path: Path) -> bytes:
    return read_file(path) if path.is_file() else b""


@dataclass(frozen=True, slots=True, eq=False)
class FittedCameras:
    """cameras : in the footage's order, or all where there is no footage yet. crops : assumptions that make sizes
    agree. matching : footage to the calibration's own names. warnings : sentences.
    """

    cameras: tuple[Camera, ...]
    crops: dict[str, AssumedCrop]
    matching: tuple[CameraMatch, ...]
    warnings: tuple[str, ...]


def fit_to_session(
    session: Session, cameras: Sequence[Camera], *, sizes_known: bool = True, read: Calibration | None = None
) -> FittedCameras:
    """Match cameras with a session's footage and fit them to its size.

    sizes_known : False where the cameras' sizes stand in for unknown ones. read : the file they are of, for crops that
    it stored. Raises CalibrationError where names or sizes cannot be matched.
    """
    sources = session.manifest.footage.cameras
    if not sources:
        return FittedCameras(tuple(cameras), dict(read.crops) if read else {}, (), ())
    matches = match_names(
        [source.name for source in sources],
        [camera.name for camera in cameras],
        "cameras of the footage",
        CalibrationError,
    )
    known = {camera.name: camera for camera in cameras}
    fitted: list[Camera] = []
    crops: dict[str, AssumedCrop] = {}
    warnings: list[str] = []
    for source, match in zip(sources, matches, strict=True):
        camera = dataclasses.replace(known[match.camera], name=source.name)
        size, crop = (source.width, source.height), None
        if not sizes_known:
            camera = dataclasses.replace(camera, width=size[0], height=size[1])
        elif size != (camera.width, camera.height):
            camera, crop = fit_camera(camera, *size, _bars(session, source))
        if crop is not None:
            warnings.append(
                f"The footage of camera {source.name} is {size[0]}x{size[1]}. {crop.words(source.name)}"
            )
        kept = crop or (read.crops.get(match.camera) if read else None)
        if kept is not None:
            crops[source.name] = kept
        fitted.append(camera)
    left = [camera.name for camera in cameras if camera.name not in {match.camera for match in matches}]
    if left:
        warnings.append(f"Calibrated camera {listed(left)} has no footage and is left out.")
    return FittedCameras(tuple(fitted), crops, matches, tuple(warnings))


def _bars(session: Session, source: CameraSource) -> Margins:
    """The black margins of a camera's footage; none where it cannot be read."""
    try:
        footage = session.footage()
    except FootageError:
        return NO_BARS
    try:
        return black_margins(lambda frame: footage.picture(source.name, frame), footage.frame_count)
    except FootageError:
        return NO_BARS
    finally:
        footage.close()
