"""A measured source written as a session: into a hidden folder beside its place, then renamed into it."""

import math
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from studio.body.catalogue import body_file_text, load_body, packaged_bodies
from studio.body.motion_files.trc import MarkerMotion, read_trc, write_trc
from studio.body.motion_files.truth_files import ANY_WORLD, read_truth
from studio.body.scale import longest_side
from studio.body.subject import DEFAULT_BODY, Subject, fit_subject, read_subject, write_subject
from studio.footage.calibration.carried_points import carried
from studio.footage.capture.calibration_files import (
    Calibration,
    find_calibrations,
    read_calibration,
    write_calibration,
)
from studio.footage.capture.calibration_toml import is_canonical
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.footage.capture.pictures import list_pictures
from studio.foundations.errors import NoPointsError, SessionError, StudioError
from studio.foundations.progress import Progress
from studio.sessions.atomic_files import write_text
from studio.sessions.importers.mask_forms import write_meant_masks
from studio.sessions.importers.measuring import MeasuredSource
from studio.sessions.importers.plan import SourcePlan
from studio.sessions.importers.points_of_tools import ToolPoints
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.named_rows import (
    check_radians,
    named_columns,
    read_pose,
    read_sigma,
    write_pose,
    write_sigma,
)
from studio.sessions.names import free_name, name_from

COPY_CHUNK = 8_000_000
SPARE_BYTES = 50_000_000


@dataclass(frozen=True, slots=True)
class CheckedPerson:
    """The subject's data, read once and checked. notes : of the subject's fit. size_mm : the body's longest extent."""

    body: str
    parameters: tuple[str, ...]
    notes: tuple[str, ...]
    size_mm: float = 0.0


def check_person(
    plan: SourcePlan, usual: str = DEFAULT_BODY, body_folders: tuple[Path, ...] = ()
) -> CheckedPerson:
    """Read everything about the person and the truth.

    usual : the body of a source that names none.
    body_folders : searched for bodies after the source's own.

    Raises BodyError, TruthError.
    """
    subject = plan.subject
    if subject is None and plan.subject_file is not None:
        subject = read_subject(plan.subject_file, "")
    folders = (*((plan.source / "bodies",) if plan.bodies else ()), *body_folders)
    body = load_body(_body_of(plan, subject, usual, folders), folders)
    if subject is not None:
        subject = msgspec.structs.replace(subject, body=body.name)
    notes: tuple[str, ...] = ()
    if subject is not None:
        fitted, notes = fit_subject(body, subject, folders)
    else:
        fitted = body
    names = tuple(entry.name for entry in body.parameters)
    if plan.start_pose_file is not None:
        check_radians(plan.start_pose_file, body, read_pose(plan.start_pose_file, names))
    if plan.sigma_file is not None:
        read_sigma(plan.sigma_file, names, 1.0)
    for path in plan.truth:
        # Others are read by `carried_truth`, before anything is written: their times need the footage's rate.
        if path.suffix.lower() not in ANY_WORLD:
            read_trc(path)
    return CheckedPerson(body.name, names, notes, longest_side(fitted))


def _body_of(plan: SourcePlan, subject: Subject | None, usual: str, folders: tuple[Path, ...]) -> str:
    """The body that a source names; where it names none the usual one, or the first that has the dimensions of its
    subject and the parameters of its start pose.
    """
    if subject is not None and subject.body:
        return subject.body
    own = set(subject.dimensions_mm) | set(subject.ratios) if subject is not None else set[str]()
    columns = set(named_columns(plan.start_pose_file)) if plan.start_pose_file is not None else None
    for name in (usual, DEFAULT_BODY, *packaged_bodies()):
        body = load_body(name, folders)
        posed = columns is None or {entry.name for entry in body.parameters} <= columns
        if own <= set(body.dimensions) and posed:
            return name
    return usual


def carried_truth(
    plan: SourcePlan, calibration: Calibration, fps: float, frame_count: int, unit: str
) -> tuple[Mapping[str, MarkerMotion], tuple[str, ...]]:
    """The truths that are in a world or unit of their own, by their files' names, in the session's world; and notes on
    them.

    That world is of a calibration beside them (truth/*.toml and the like), else of the source's calibration as its file
    has it.

    frame_count : of the footage.
    unit : of that calibration, as requested.

    Raises TruthError, CalibrationError.
    """
    truths: dict[str, MarkerMotion] = {}
    notes: list[str] = []
    if plan.points is not None and plan.calibration is not None:
        path = plan.points.path
        try:
            own = read_calibration(plan.calibration, unit)
            truths[path.stem], more_notes = _of_tool(plan.points, own, calibration, fps, frame_count)
            notes += more_notes
        except StudioError as problem:
            notes.append(f"The points '{path.name}' were not taken for the truth: {problem}")
    for path in plan.truth:
        if path.suffix.lower() not in ANY_WORLD:
            motion = read_truth(path, fps, frame_count)
            notes += motion.notes
            if motion.notes:
                # What it means is kept, so that nothing has to be judged again.
                truths[path.stem] = motion
            continue
        if plan.calibration is None:
            continue
        beside = find_calibrations(path.parent)
        place = beside[0] if beside else plan.calibration
        own = read_calibration(place) if beside else read_calibration(place, unit)
        try:
            motion = read_truth(path, fps, frame_count)
        except NoPointsError as problem:
            notes.append(f"'truth/{path.name}' was left out: {problem}")
            continue
        if not motion.unit and own.mm > 1.0 and _spread(motion) < MOST_METRES:
            motion = _in_unit_of(own, motion, place.name)
        notes += motion.notes
        positions, missed = carried(motion.positions, own.cameras, calibration.cameras)
        truths[path.stem] = replace(motion, positions=positions, unit="mm")
        notes.append(
            f"The points of '{path.name}' were taken from the world of '{place.name}' into the session's by where the"
            f" cameras see them ({missed:.1f} px off in the median)."
        )
    return truths, tuple(notes)


MOST_METRES = 10.0
"""A body's points are within so many m, and not within so few mm."""


def _of_tool(
    points: ToolPoints, own: Calibration, calibration: Calibration, fps: float, frame_count: int
) -> tuple[MarkerMotion, list[str]]:
    """The points that a tool left, in the session's world, and notes. own : the calibration as its file has it.

    Raises TruthError, CalibrationError.
    """
    path = points.path
    # Pose2Sim and OpenCap always turn the calibration's z up to a TRC's y.
    motion = read_truth(path, fps, frame_count, "y" if path.suffix.lower() == ".trc" else "")
    if not points.placed:
        note = (
            f"The points '{path.name}' were taken for the truth. Their world is not the calibration's: measure with"
            " --align rigid."
        )
        return replace(motion, unit="mm"), [*motion.notes, note]
    if not motion.unit:
        motion = _in_unit_of(own, motion, own.label)
    positions, missed = carried(motion.positions, own.cameras, calibration.cameras)
    note = f"The points '{path.name}' were taken for the truth ({missed:.1f} px off in the median)."
    return replace(motion, positions=positions, unit="mm"), [*motion.notes, note]


def _in_unit_of(own: Calibration, motion: MarkerMotion, name: str) -> MarkerMotion:
    """Points of a table that names no unit, read as mm, in the calibration's."""
    if own.mm == 1.0:
        return motion
    note = f"The points name no unit: they were taken to be in that of '{name}' ({own.mm:g} mm)."
    return replace(motion, positions=motion.positions * own.mm, notes=(*motion.notes, note))


def _spread(motion: MarkerMotion) -> float:
    """How far a frame's points lie apart along an axis, in the median."""
    known = np.isfinite(motion.positions).sum(axis=2) == 3
    positions = motion.positions[known.sum(axis=1) > 0]
    if not len(positions):
        return math.inf
    return float(np.median(np.nanmax(positions, axis=1) - np.nanmin(positions, axis=1), axis=0).max())


def check_room(plan: SourcePlan, into: Path) -> None:
    """Raises SessionError if the disk has no room for a copy of the footage."""
    parts = (*plan.footage, *plan.masks, *plan.backgrounds)
    files = [file for part in parts for file in (list_pictures(part) if part.is_dir() else (part,))]
    needed = sum(file.stat().st_size for file in files) + SPARE_BYTES
    parent = next(folder for folder in into.absolute().parents if folder.exists())
    free = shutil.disk_usage(parent).free
    if free < needed:
        raise SessionError(
            f"The copy needs {needed / 1e6:.0f} MB and the disk has {free / 1e6:.0f} MB.",
            "Make room, or refer to the footage with --reference.",
        )


def write_session(
    folder: Path,
    name: str,
    plan: SourcePlan,
    calibration: Calibration,
    measured: MeasuredSource,
    person: CheckedPerson,
    *,
    truths: Mapping[str, MarkerMotion],
    notes: tuple[str, ...],
    copy: bool,
    progress: Progress,
) -> SessionManifest:
    """Fill `folder` with a session named `name`; the manifest comes last. truths, notes : of `carried_truth`."""
    footage = write_footage(folder, measured, copy, progress)
    write_calibrations(folder, calibration, measured)
    write_person(folder, plan, person, truths)
    crops = [entry.crop.words(entry.camera.name) for entry in measured.cameras if entry.crop is not None]
    manifest = SessionManifest(
        name=name,
        title=plan.source.name,
        created=now(),
        body=person.body,
        footage=footage,
        tracker=plan.tracker,
        weighting=plan.weighting,
        calibration_source=calibration.label,
        imported_from=str(plan.source),
        assumptions=(calibration.unit_note, *crops),
        notes=(
            calibration.unit_note,
            *calibration.notes,
            *plan.notes,
            *measured.notes,
            *person.notes,
            *notes,
        ),
        layout=plan.layout,
        warnings=measured.warnings,
        matching=measured.matching,
    )
    write_manifest(folder, manifest)
    return manifest


def write_footage(folder: Path, measured: MeasuredSource, copy: bool, progress: Progress) -> FootageSource:
    """Copy or refer to all footage, masks and backgrounds; returns their description."""
    sources: list[CameraSource] = []
    taken: set[str] = set()
    files: set[str] = set()
    for entry in measured.cameras:
        plain = free_name(name_from(entry.camera.name, "camera"), taken)
        taken.add(plain)
        is_folder = entry.footage.is_dir()
        own = _file_name(entry.footage, plain)
        if own.lower() in files:
            own = f"{plain}{entry.footage.suffix.lower()}"
        files.add(own.lower())
        place = f"pictures/{plain}" if is_folder else f"videos/{own}"
        masks = background = ""
        if entry.masks is not None and entry.mask_form is not None and not entry.mask_form.usual:
            masks = f"masks/{plain}"

            def report(done: int, total: int, name: str = entry.masks.name) -> None:
                progress(f"writing masks {name}", done, total)

            write_meant_masks(entry.masks, entry.mask_count, entry.mask_form, folder / masks, report)
        elif entry.masks is not None:
            suffix = "" if entry.masks.is_dir() else entry.masks.suffix.lower()
            masks = _copy_in(entry.masks, folder, f"masks/{plain}{suffix}", copy, progress)
        if entry.background is not None:
            target = f"background/{plain}{entry.background.suffix.lower()}"
            background = _copy_in(entry.background, folder, target, copy, progress)
        sources.append(
            CameraSource(
                entry.camera.name,
                "pictures" if is_folder else "video",
                _copy_in(entry.footage, folder, place, copy, progress),
                *entry.size,
                entry.measure.frame_count,
                masks,
                background,
                entry.offset,
                entry.turned,
                entry.steps,
                entry.fields,
            )
        )
    return FootageSource(measured.fps, measured.frame_count, tuple(sources))


def _copy_in(source: Path, folder: Path, place: str, copy: bool, progress: Progress) -> str:
    if not copy:
        return str(source.resolve())
    target = folder / place
    if source.is_dir():
        pictures = list_pictures(source)
        target.mkdir(parents=True)
        for number, path in enumerate(pictures, 1):
            shutil.copyfile(path, target / path.name)
            progress(f"copying {source.name}", number, len(pictures))
        return place
    target.parent.mkdir(parents=True, exist_ok=True)
    total, done = source.stat().st_size, 0
    with source.open("rb") as reading, target.open("wb") as writing:
        while chunk := reading.read(COPY_CHUNK):
            writing.write(chunk)
            done += len(chunk)
            progress(f"copying {source.name} (kB)", done // 1000, total // 1000)
    return place


def _file_name(video: Path, plain: str) -> str:
    return video.name if name_from(video.stem) == video.stem else f"{plain}{video.suffix.lower()}"


def write_calibrations(folder: Path, calibration: Calibration, measured: MeasuredSource) -> None:
    """The imported files byte for byte, and the canonical one with the cameras that have footage."""
    place = folder / "calibration"
    place.mkdir()
    sources = calibration.sources
    if len(sources) == 1 and is_canonical(sources[0]):
        # A session imported again: the original is the one that its own import kept.
        kept = [path for path in sources[0].parent.glob("original*") if path.is_file()]
        sources = tuple(kept) or sources
        if (sources[0].parent / "original").is_dir():
            sources = tuple(sorted((sources[0].parent / "original").iterdir()))
    if len(sources) == 1:
        ending = ".qca.txt" if sources[0].name.lower().endswith(".qca.txt") else sources[0].suffix
        shutil.copyfile(sources[0], place / f"original{ending}")
    else:
        (place / "original").mkdir()
        names = [path.name for path in sources]
        for path in sources:
            # OpenCap's lie in folders that are named after their cameras, all under one name.
            own = path.name if names.count(path.name) == 1 else f"{path.parent.name}-{path.name}"
            shutil.copyfile(path, place / "original" / own)
    crops = {entry.camera.name: entry.crop for entry in measured.cameras if entry.crop is not None}
    write_calibration(tuple(entry.camera for entry in measured.cameras), place / "cameras.toml", crops)


def write_person(
    folder: Path, plan: SourcePlan, person: CheckedPerson, truths: Mapping[str, MarkerMotion]
) -> None:
    """Subject, start pose, σ, truth and bodies. truths : of `carried_truth`."""
    if plan.subject is not None:
        write_subject(plan.subject, folder / "subject.toml")
    if plan.start_pose is not None:
        write_pose(folder / "start_pose.csv", person.parameters, plan.start_pose)
    if plan.sigma is not None:
        write_sigma(folder / "sigma.csv", person.parameters, plan.sigma, plan.sigma_fps)
    for path, name in (
        (plan.subject_file, "subject.toml"),
        (plan.start_pose_file, "start_pose.csv"),
        (plan.sigma_file, "sigma.csv"),
    ):
        if path is not None and not (folder / name).exists():
            shutil.copyfile(path, folder / name)
    _write_truths(folder / "truth", plan, truths)
    if plan.bodies:
        (folder / "bodies").mkdir()
    for path in plan.bodies:
        # A robot's file becomes a body file: its meshes stay where they are, and no session needs its reader.
        write_text(folder / "bodies" / f"{path.stem}.toml", body_file_text(str(path)))


def _write_truths(place: Path, plan: SourcePlan, truths: Mapping[str, MarkerMotion]) -> None:
    kept = [path for path in plan.truth if path.suffix.lower() not in ANY_WORLD and path.stem not in truths]
    if kept or truths:
        place.mkdir()
    for path in kept:
        shutil.copyfile(path, place / f"{path.stem}.trc")
    for stem, motion in truths.items():
        taken = {path.stem for path in place.iterdir()}
        write_trc(place / f"{free_name(stem, taken)}.trc", motion)
