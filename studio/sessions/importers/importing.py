"""Importing: any source that an importer knows, checked as a whole, becomes a session, is added to one, or nothing."""

import datetime
import math
import shutil
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from pydantic import Field

from studio.footage.calibration.checks import blocking, check_calibration
from studio.footage.calibration.rig_checks import has_room, room_findings
from studio.footage.capture.calibration_files import (
    UNIT_PATTERN,
    Calibration,
    is_calibration,
    read_calibration,
)
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.footage.capture.naming import CameraMatch, listed
from studio.footage.capture.pictures import check_picture, is_picture, list_pictures
from studio.footage.capture.video import VIDEO_SUFFIXES, probe_video
from studio.foundations.declaring import Terminal, Web
from studio.foundations.errors import CalibrationError, FootageError, SessionError
from studio.foundations.foreign_files import MANIFEST_NAME, leads_out
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.sessions.archives import FOOTAGE_PARTS, folder_of, is_archive
from studio.sessions.atomic_files import discard, made_whole, new_folder_beside, taken
from studio.sessions.background_files import (
    MASKS_GONE,
    forget_unused_masks,
    has_made_masks,
    without_made_masks,
)
from studio.sessions.file_checksums import forget_files, note_files
from studio.sessions.importers.bodytrack import is_bodytrack, plan_bodytrack
from studio.sessions.importers.folder_layout import plan_folder
from studio.sessions.importers.measuring import (
    SAME_RATE,
    MeasuredSource,
    check_counts,
    different_rates,
    measure_source,
)
from studio.sessions.importers.plan import SourcePlan
from studio.sessions.importers.writing import (
    carried_truth,
    check_person,
    check_room,
    write_calibrations,
    write_footage,
    write_person,
    write_session,
)
from studio.sessions.manifest import FASTEST, SessionManifest
from studio.sessions.names import free_name
from studio.sessions.provenance import adopt
from studio.sessions.session import (
    CAMERAS_PATH,
    SUBJECT_NAME,
    THUMBNAIL_NAME,
    Session,
    check_unchanged,
    redescribe,
)
from studio.sessions.stroke_files import OUTDATED, STROKES_NAME
from studio.sessions.work_under_way import check_alone, one_at_a_time, working_on

OWN_PARTS = ("videos", "pictures", "masks", "background")
PERSON_PARTS = ("calibration", "subject.toml", "start_pose.csv", "sigma.csv", "truth", "bodies")


Place = Annotated[str | None, Field(max_length=4096)]
Turn = Literal[0, 90, 180, 270]
Offsets = Annotated[
    Mapping[str, int] | None,
    Field(
        max_length=64,
        description="By camera: the frame of its footage that was taken with frame 0 of the others.",
    ),
    Terminal("--offset", "CAMERA=FRAMES"),
]
Rotations = Annotated[
    Mapping[str, int] | None,
    Field(
        max_length=64,
        description="By camera: degrees clockwise (0, 90, 180 or 270) by which its pictures are turned.",
    ),
    Terminal("--rotate", "CAMERA=DEGREES"),
    Web(kind=dict[str, Turn]),
]

Unit = Annotated[
    str,
    Field(
        pattern=UNIT_PATTERN,
        max_length=30,
        description="The calibration's unit, mm, cm, m or in, or board=MM: the mm that are 1 in the file (a square);"
        " default: what the file says or its size.",
    ),
    Terminal(metavar="UNIT"),
    Web(kind=str),
]
Up = Annotated[
    Literal["x", "y", "z", "-x", "-y", "-z"],
    Field(description="The axis of the calibration's world that points up."),
]


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """How footage is read into a session. Offsets and rotations, by camera or footage name, override the source's."""

    calibration: Annotated[
        str | Path | None,
        Field(description="Which calibration to take, where there are several."),
        Terminal(kind=Path),
        Web(kind=Place),
    ] = None
    fps: Annotated[
        float | None,
        Field(gt=0, le=10_000, description="Frames per second, where the footage does not say (pictures)."),
    ] = None
    trial: Annotated[
        str | None,
        Field(description="Which trial, where a folder holds several."),
        Terminal(metavar="NAME"),
        Web(kind=Place),
    ] = None
    offsets: Offsets = None
    rotations: Rotations = None
    by_time: Annotated[
        bool,
        Field(
            description="Pair frames by their times, not by their numbers: cameras of other rates, drift, lost frames."
        ),
    ] = False
    masks: Annotated[
        Literal["", "inverted"],
        Field(
            description="How the footage's masks mark the person; default: white, labels, or opaque alpha."
        ),
    ] = ""
    fields: Annotated[
        Literal["", "auto", "top", "bottom"],
        Field(
            description="Interlaced videos: make a frame of each field, twice as many; auto sees which field is the"
            " earlier, top or bottom says it."
        ),
    ] = ""
    unit: Unit = ""
    up: Up = "z"
    replace: Annotated[bool, Field(description="Forget all cameras that the source does not name.")] = False
    allow_inconsistent: Annotated[
        bool,
        Field(
            description="Take a calibration that would make results wrong (z not up, metres taken for millimetres) with"
            " a warning. A unit that is named is believed without this: a doubt of it only warns."
        ),
    ] = False
    copy: Annotated[
        bool,
        Field(description="Copy the footage, or refer to it where it lies."),
        Terminal("--copy/--reference"),
    ] = True


@dataclass(frozen=True, slots=True, eq=False)
class ImportReport:
    """The result of an import.

    session : after the import.
    matching : footage to cameras.
    notes : what was assumed.
    warnings : what to check.
    layout : the recognised layout.
    calibrated : whether the source's calibration was used.
    """

    session: Session
    matching: tuple[CameraMatch, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    layout: str = ""
    calibrated: bool = True


def import_source(
    source: Path, into: Path, options: ImportOptions | None = None, *, progress: Progress = no_progress
) -> ImportReport:
    """Make a session at `into` from a source folder, or an archive of one; see `folder_layout` and
    `bodytrack` for the layouts.

    All is checked before anything is written; whatever fails, nothing is left and nothing that was stored is touched.
    Raises StudioError.
    """
    options = options or ImportOptions()
    _check_request(source, options)
    if into.exists():
        raise taken(into)
    source = source.resolve()
    try:
        with _staying(source, into), folder_of(source, FOOTAGE_PARTS, into) as opened:
            plan = _plan(opened, options)
            assert plan.calibration is not None
            read = read_calibration(plan.calibration, options.unit, options.up)
            person = check_person(plan)
            if options.copy:
                check_room(plan, into)
            measured = _checked_rig(
                measure_source(plan, read, options.fps, progress, by_time=options.by_time),
                options,
                person.size_mm,
            )
            truths, notes = carried_truth(plan, read, measured.fps, measured.frame_count, options.unit)
            with made_whole(into) as folder:
                manifest = write_session(
                    folder,
                    into.name,
                    plan,
                    read,
                    measured,
                    person,
                    truths=truths,
                    notes=notes,
                    copy=options.copy,
                    progress=progress,
                )
                progress("finishing", 1, 1)
                note_files(folder)
    except FileNotFoundError as problem:
        raise SessionError(f"The file '{problem.filename}' does not exist.", "Check the folder.") from None
    except OSError as problem:
        raise SessionError(
            f"The import into '{into.name}' failed: {problem}.", "Check the disk's room and permissions."
        ) from None
    return ImportReport(Session(into), manifest.matching, manifest.notes, manifest.warnings, plan.layout)


def _staying(source: Path, into: Path) -> AbstractContextManager[None]:
    """Inside, a source that is a session beside the one that is made or added to stays where it is."""
    beside = source.parent == into.parent.resolve() and (source / MANIFEST_NAME).is_file()
    return working_on(source, "import") if beside else nullcontext()


def add_footage(
    session: Session, source: Path, options: ImportOptions | None = None, *, progress: Progress = no_progress
) -> ImportReport:
    """Add the footage (with masks and backgrounds) of a folder, or of an archive of one, to a session.

    A session that is calibrated keeps its calibration, which has to name every camera; else the source's is taken
    over where it has one (and subject, start pose and truth, where the session has none). The session keeps its body,
    unless the subject that is taken over names another. An existing camera gets the new footage. All is read before
    anything changes, and no other work in the session is under way then; on failure the session is unchanged. Raises
    StudioError.
    """
    options = options or ImportOptions()
    _check_request(source, options)
    session.check_idle()
    check_alone(session.path)
    source = source.resolve()
    with _staying(source, session.path), folder_of(source, FOOTAGE_PARTS, session.path / "take") as folder:
        return _add(session, folder, options, progress)


def _add(session: Session, source: Path, options: ImportOptions, report: Progress) -> ImportReport:
    plan = _plan(source, options, bare=True)
    takes_over = plan.calibration is not None and not session.is_calibrated
    if not takes_over:
        plan = plan.without_person()
    elif (session.path / SUBJECT_NAME).exists():
        plan = replace(plan, subject=None, subject_file=None)
    person = check_person(plan, session.manifest.body, session.body_folders)
    if takes_over and person.body != session.manifest.body:
        before = session.manifest.body
        note = f"The imported subject is of body '{person.body}', which takes the place of '{before}'."
        plan = replace(plan, notes=(*plan.notes, note))
    if options.copy:
        check_room(plan, session.path)
    read = _cameras_of(session, plan, options)
    measured = measure_source(plan, read, options.fps, report, by_time=options.by_time)
    truths, carried_notes = carried_truth(plan, read, measured.fps, measured.frame_count, options.unit)
    if takes_over:
        measured = _checked_rig(measured, options, person.size_mm)
    staged = new_folder_beside(session.path / "take", parents=False)
    try:
        footage = write_footage(staged, measured, options.copy, report)
        stay = _cameras_that_stay(session, footage, plan, options.replace)
        if takes_over:
            write_calibrations(staged, read, measured)
            write_person(staged, plan, person, truths)
        report("finishing", 1, 1)
        with one_at_a_time(session.path):
            check_alone(session.path)
            check_unchanged(session, "footage", "calibration_changed")
            adopt(session)
            placed = _moved_in(session, staged, footage, without_made_masks(session, stay))
            manifest = _describe(session, plan, read, measured, placed, person.body if takes_over else "")
            changed = redescribe(session, manifest)
            _forget_old(changed, session.manifest.footage)
            forget_unused_masks(changed)
    except OSError as problem:
        raise SessionError(
            f"The footage could not be added to '{session.name}': {problem}.",
            "Check the disk's room and permissions.",
        ) from None
    finally:
        discard(staged)
    gone = (MASKS_GONE,) if any(map(has_made_masks, session.manifest.footage.cameras)) else ()
    if session.has_footage and (session.path / STROKES_NAME).exists():
        gone = (*gone, OUTDATED)
    notes = (*plan.notes, *measured.notes, *(person.notes if takes_over else ()), *carried_notes, *gone)
    return ImportReport(changed, manifest.matching, notes, measured.warnings, plan.layout, takes_over)


def _check_request(source: Path, options: ImportOptions) -> None:
    """Check the options before the source is opened. Raises FootageError."""
    packed = source.is_file() and is_archive(source)
    if source.is_file() and not packed:
        raise _single_file(source)
    if not source.is_dir() and not packed:
        raise FootageError(
            f"There is no folder '{source}', nor an archive.",
            "Give the folder that holds the footage and its calibration, or a zip or tar of it.",
        )
    if packed and not options.copy:
        raise FootageError(
            f"Footage in '{source.name}' cannot be used in place.", "Unpack it, or let it be copied."
        )
    if options.fps is not None and not (math.isfinite(options.fps) and 0.0 < options.fps <= FASTEST):
        raise FootageError(f"{options.fps:g} is no frame rate.", "Give frames per second, such as --fps 60.")


def _single_file(source: Path) -> FootageError:
    """Why a file that is no archive is no source, with what to give instead."""
    if source.suffix.lower() in VIDEO_SUFFIXES:
        kind = "one camera's video"
        remedy = "Give the folder that holds a video a camera, with a calibration in it or with --calibration FILE."
    elif is_picture(source):
        kind = "a picture"
        remedy = "Give the folder that holds one folder of pictures a camera, and a calibration."
    elif is_calibration(source):
        kind = "a calibration"
        remedy = f"Give the folder that holds the footage, and this file with it: --calibration {source}."
    else:
        kind = "a file"
        remedy = "Give the folder that holds the footage and its calibration, or a zip or tar of it."
    return FootageError(f"'{source}' is {kind}, and no folder of footage.", remedy)


def _plan(source: Path, options: ImportOptions, *, bare: bool = False) -> SourcePlan:
    if is_bodytrack(source) and options.trial is None:
        plan = plan_bodytrack(source, options.calibration)
    else:
        plan = plan_folder(source, options.calibration, options.trial, bare=bare)
    return replace(
        plan,
        offsets={**plan.offsets, **(options.offsets or {})},
        rotations={**plan.rotations, **(options.rotations or {})},
        masks_inverted=options.masks == "inverted",
        split=options.fields,
    )


def _checked_rig(measured: MeasuredSource, options: ImportOptions, size_mm: float) -> MeasuredSource:
    """The plan with findings on its cameras as warnings: faults that a reprojection error cannot show.
    size_mm : of the body. A rig around a body that has room in it is of the right unit, however small; a unit that is
    named is believed, and doubts are warnings.

    Raises CalibrationError with the first finding that would make results wrong, unless `allow_inconsistent`.
    """
    cameras = tuple(entry.camera for entry in measured.cameras)
    findings = check_calibration(cameras, up=options.up)
    if has_room(cameras, size_mm):
        findings = tuple(finding for finding in findings if finding.code != "scale")
    elif options.unit:
        findings = tuple(
            replace(finding, severity="warns") if finding.code == "scale" else finding for finding in findings
        )
    if not any(finding.code == "scale" for finding in findings):
        findings = (*findings, *room_findings(cameras, size_mm))
    wrong = blocking(findings)
    if wrong and not options.allow_inconsistent:
        raise CalibrationError(
            wrong[0].message, f"{wrong[0].remedy} To import it unchanged: --allow-inconsistent."
        )
    return replace(measured, warnings=(*measured.warnings, *map(str, findings)))


def _cameras_of(session: Session, plan: SourcePlan, options: ImportOptions) -> Calibration:
    if session.is_calibrated:
        known = read_calibration(session.path / CAMERAS_PATH)
        return replace(known, label=session.manifest.calibration_source or known.label)
    if plan.calibration is not None:
        return read_calibration(plan.calibration, options.unit, options.up)
    names = [plan.part_name(path) for path in plan.footage]
    twice = sorted(name for name in names if names.count(name) > 1)
    if twice:
        raise FootageError(
            f"There are two cameras '{twice[0]}'.", "Give each camera's footage a name of its own."
        )
    cameras = tuple(_stand_in(name, path) for name, path in zip(names, plan.footage, strict=True))
    return Calibration("", cameras, "", (), sizes_known=False)


def _stand_in(name: str, footage: Path) -> Camera:
    """A camera of which only name and size are known; the footage is not decoded for it."""
    if footage.is_dir():
        width, height = check_picture(list_pictures(footage)[0])
    else:
        probe = probe_video(footage)
        width, height = probe.width, probe.height
    matrix = np.array(
        [[float(width), 0.0, (width - 1) / 2], [0.0, float(width), (height - 1) / 2], [0.0, 0.0, 1.0]]
    )
    return Camera(name, width, height, matrix, np.zeros(5), np.eye(3), np.zeros(3))


def _cameras_that_stay(
    session: Session, added: FootageSource, plan: SourcePlan, replaced: bool
) -> tuple[CameraSource, ...]:
    """The unchanged cameras beside the added ones. Raises FootageError if the two do not fit together."""
    names = {camera.name for camera in added.cameras}
    before = session.manifest.footage
    stay = () if replaced else tuple(camera for camera in before.cameras if camera.name not in names)
    if stay:
        if abs(before.fps / added.fps - 1.0) > SAME_RATE:
            raise different_rates({"the session": before.fps, listed(names): added.fps})
        known = bool(plan.offsets) or any(camera.offset for camera in stay)
        check_counts({camera.name: camera.last for camera in (*stay, *added.cameras)}, known)
    return stay


def _moved_in(
    session: Session, staged: Path, added: FootageSource, stay: tuple[CameraSource, ...]
) -> FootageSource:
    """Move the new files into the session; returns the footage after that."""
    prefix = ""
    if any((session.path / part).exists() for part in OWN_PARTS):
        prefix = free_name("take-2", {path.name for path in session.path.iterdir()})
    place = session.path / prefix if prefix else session.path
    place.mkdir(exist_ok=True)
    for parts, target in ((OWN_PARTS, place), (PERSON_PARTS, session.path)):
        for part in parts:
            if (staged / part).exists() and not (target / part).exists():
                (staged / part).rename(target / part)
    cameras = (*stay, *(_place(camera, prefix) for camera in added.cameras))
    names = [camera.name for camera in session.manifest.footage.cameras]
    ranked = sorted(
        cameras, key=lambda camera: names.index(camera.name) if camera.name in names else len(names)
    )
    return FootageSource(added.fps, min(camera.last for camera in ranked), tuple(ranked))


def _place(camera: CameraSource, prefix: str) -> CameraSource:
    """A camera's source where it lies in the session; places elsewhere stay."""
    if not prefix:
        return camera
    moved = {
        name: f"{prefix}/{path}"
        for name in ("path", "masks", "background")
        if (path := getattr(camera, name)) and not Path(path).is_absolute()
    }
    return replace(camera, **moved)


def _forget_old(session: Session, before: FootageSource) -> None:
    """Remove files of the session's own that no camera refers to any more, and the small picture."""
    (session.path / THUMBNAIL_NAME).unlink(missing_ok=True)
    used = {path for camera in session.manifest.footage.cameras for path in camera.places}
    before_it = {path for camera in before.cameras for path in camera.places}
    forgotten = [path for path in before_it - used if path and not Path(path).is_absolute()]
    # Else what was removed on purpose would be taken for lost.
    forget_files(session.path, forgotten)
    for path in forgotten:
        place = session.path / path
        if leads_out(place):
            continue
        if place.is_dir() and not place.is_symlink():
            shutil.rmtree(place, ignore_errors=True)
        else:
            place.unlink(missing_ok=True)


def _describe(
    session: Session,
    plan: SourcePlan,
    read: Calibration,
    measured: MeasuredSource,
    footage: FootageSource,
    body: str,
) -> SessionManifest:
    """The manifest with the new footage. body : of the imported subject, "" for none."""
    before = session.manifest
    names = {camera.name for camera in footage.cameras}
    known = session.is_calibrated or plan.calibration is not None
    fresh = measured.matching if known else ()
    kept = names - {match.camera for match in fresh}
    return msgspec.structs.replace(
        before,
        body=body or before.body,
        footage=footage,
        footage_changed=datetime.datetime.now(datetime.UTC).isoformat() if session.has_footage else "",
        calibration_source=before.calibration_source or (read.label if known else ""),
        imported_from=str(plan.source),
        assumptions=before.assumptions or ((read.unit_note,) if read.unit_note else ()),
        notes=(*before.notes, *plan.notes, *measured.notes),
        warnings=measured.warnings,
        matching=(*(match for match in before.matching if match.camera in kept), *fresh),
        layout=plan.layout,
    )
