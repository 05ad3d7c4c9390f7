"""Footage added to a session that is there already: with its own calibration, with the source's, or before any."""

import dataclasses
import datetime
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec
import numpy as np

from studio.capture.calibration_files import Calibration, read_calibration
from studio.capture.footage_source import FootageSource
from studio.capture.pictures import check_picture, list_pictures
from studio.capture.video_probe import probe_video
from studio.errors import FootageError, SessionError
from studio.geometry.camera import Camera
from studio.progress import Progress
from studio.sessions.archives import FOOTAGE_PARTS, folder_of
from studio.sessions.atomic_files import discard, new_folder_beside
from studio.sessions.importers.bodytrack import is_bodytrack, plan_bodytrack
from studio.sessions.importers.catalogue import check_request, import_watched
from studio.sessions.importers.checking import check_rig
from studio.sessions.importers.folder_layout import plan_folder
from studio.sessions.importers.measuring import MeasuredSource, measure_source, part_name
from studio.sessions.importers.placing import cameras_that_stay, forget_old, take_in
from studio.sessions.importers.plan import SourcePlan
from studio.sessions.importers.writing import (
    check_person,
    check_room,
    write_calibrations,
    write_footage,
    write_person,
)
from studio.sessions.made_from import adopt
from studio.sessions.manifest import CameraMatch, SessionManifest
from studio.sessions.session import CAMERAS_PATH, Session, described_anew


@dataclass(frozen=True, slots=True)
class FootageWish:
    """How footage is to be added; entries as of `import_source`. replaced : forget all cameras that the source does
    not name.
    """

    calibration: Path | str | None = None
    fps: float | None = None
    copy: bool = True
    trial: str | None = None
    offsets: Mapping[str, int] = field(default_factory=dict)
    rotations: Mapping[str, int] = field(default_factory=dict)
    unit: str = ""
    up: str = "z"
    despite_findings: bool = False
    replaced: bool = False


@dataclass(frozen=True, slots=True)
class AddedFootage:
    """What became of a source. session : as it is now. calibrated : whether its calibration was taken over."""

    session: Session
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    layout: str
    matching: tuple[CameraMatch, ...]
    calibrated: bool


def add_footage(
    session: Session,
    source: Path,
    wish: FootageWish | None = None,
    *,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> AddedFootage:
    """Add the footage (with masks and backgrounds) of a folder, or of an archive of one, to a session.

    A session that is calibrated keeps its calibration, which has to name every camera; else the source's is taken
    over where it has one (and subject, start pose and truth, where the session has none). A camera that is there
    already gets the new footage. All is read before anything changes; whatever fails, the session stays as it was.
    Raises StudioError.
    """
    asked, report = wish or FootageWish(), import_watched(progress, cancelled)
    check_request(source, asked.fps, asked.copy)
    _check_idle(session)
    with folder_of(source.resolve(), FOOTAGE_PARTS, session.path / "take") as folder:
        return _added(session, folder, asked, report)


def _added(session: Session, source: Path, asked: FootageWish, report: Progress) -> AddedFootage:
    """`add_footage` from a folder."""
    plan = _plan(session, source, asked)
    person = check_person(plan)
    if asked.copy:
        check_room(plan, session.path)
    read = _cameras_of(session, plan, asked)
    measured = measure_source(plan, read, asked.fps, report)
    takes_over = plan.calibration is not None and not session.is_calibrated
    if takes_over:
        doubts = check_rig(tuple(entry.camera for entry in measured.cameras), asked.despite_findings)
        measured = replace(measured, warnings=(*measured.warnings, *doubts))
    staged = new_folder_beside(session.path / "take")
    try:
        footage = write_footage(staged, measured, asked.copy, report)
        stay = cameras_that_stay(session, footage, plan, asked.replaced)
        if takes_over:
            write_calibrations(staged, read, measured)
            write_person(staged, plan, person)
        report("finishing", 1, 1)
        adopt(session)
        placed = take_in(session, staged, footage, stay)
    except OSError as problem:
        raise SessionError(
            f"The footage could not be added to '{session.name}': {problem}.",
            "Check the disk's room and permissions.",
        ) from None
    finally:
        discard(staged)
    manifest = _described(session, plan, read, measured, placed, person.body if takes_over else "")
    changed = described_anew(session, manifest)
    forget_old(changed, session.manifest.footage)
    notes = (*plan.notes, *measured.notes, *(person.notes if takes_over else ()))
    return AddedFootage(changed, notes, measured.warnings, plan.layout, manifest.matching, takes_over)


def _plan(session: Session, source: Path, wish: FootageWish) -> SourcePlan:
    """The parts of the source that the session can use."""
    if is_bodytrack(source) and wish.trial is None:
        plan = plan_bodytrack(source, wish.calibration)
    else:
        plan = plan_folder(source, wish.calibration, wish.trial, bare=True)
    plan = replace(
        plan, offsets={**plan.offsets, **wish.offsets}, rotations={**plan.rotations, **wish.rotations}
    )
    return plan if plan.calibration and not session.is_calibrated else _without_person(plan)


def _without_person(plan: SourcePlan) -> SourcePlan:
    """A plan of footage alone: start pose and truth belong to a calibration."""
    return replace(
        plan,
        truth=(),
        bodies=(),
        subject=None,
        subject_file=None,
        start_pose=None,
        start_pose_file=None,
        sigma=None,
        sigma_file=None,
    )


def _cameras_of(session: Session, plan: SourcePlan, wish: FootageWish) -> Calibration:
    """The session's calibration, else the source's, else stand-ins named after the footage."""
    if session.is_calibrated:
        known = read_calibration(session.path / CAMERAS_PATH)
        return dataclasses.replace(known, label=session.manifest.calibration_source or known.label)
    if plan.calibration is not None:
        return read_calibration(plan.calibration, wish.unit, wish.up)
    names = [part_name(path) for path in plan.footage]
    twice = sorted(name for name in names if names.count(name) > 1)
    if twice:
        raise FootageError(
            f"There are two cameras '{twice[0]}'.", "Give each camera's footage a name of its own."
        )
    cameras = tuple(_stand_in(name, *_size(path)) for name, path in zip(names, plan.footage, strict=True))
    return Calibration("", cameras, "", (), sizes_known=False)


def _stand_in(name: str, width: int, height: int) -> Camera:
    """A camera of which only name and size are known."""
    matrix = np.array(
        [[float(width), 0.0, (width - 1) / 2], [0.0, float(width), (height - 1) / 2], [0.0, 0.0, 1.0]]
    )
    return Camera(name, width, height, matrix, np.zeros(5), np.eye(3), np.zeros(3))


def _size(path: Path) -> tuple[int, int]:
    """Of footage before it is decoded."""
    if path.is_dir():
        return check_picture(list_pictures(path)[0])
    probe = probe_video(path)
    return probe.width, probe.height


def _described(
    session: Session,
    plan: SourcePlan,
    read: Calibration,
    measured: MeasuredSource,
    footage: FootageSource,
    body: str,
) -> SessionManifest:
    """The manifest with the new footage. body : that of the person who was taken over, "" for none."""
    before = session.manifest
    names = {camera.name for camera in footage.cameras}
    known = session.is_calibrated or plan.calibration is not None
    fresh = tuple(CameraMatch(match.footage, match.camera, match.how) for match in measured.matching if known)
    said = {match.camera for match in fresh}
    kept = tuple(match for match in before.matching if match.camera in names - said)
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
        matching=(*kept, *fresh),
        layout=plan.layout,
    )


def _check_idle(session: Session) -> None:
    for run in session.runs():
        if run.being_tracked():
            raise SessionError(
                f"Run '{run.name}' of session '{session.name}' is being tracked.",
                "Stop it first, or wait for it.",
            )
