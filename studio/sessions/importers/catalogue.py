"""Importing: any source that one of the importers knows, checked as a whole, becomes a session or nothing."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from studio.capture.calibration_files import Calibration, read_calibration
from studio.errors import FootageError, SessionError
from studio.progress import Cancelled, Progress, watched
from studio.sessions.archives import FOOTAGE_PARTS, folder_of, is_archive
from studio.sessions.atomic_files import discard, move_into_place, new_folder_beside
from studio.sessions.file_checksums import note_files
from studio.sessions.importers.bodytrack import is_bodytrack, plan_bodytrack
from studio.sessions.importers.checking import check_rig
from studio.sessions.importers.folder_layout import plan_folder
from studio.sessions.importers.measuring import measure_source
from studio.sessions.importers.plan import SourcePlan
from studio.sessions.importers.writing import check_person, check_room, write_session
from studio.sessions.manifest import CameraMatch, SessionManifest
from studio.sessions.session import Session

FASTEST = 10_000.0


@dataclass(frozen=True, slots=True, eq=False)
class ImportReport:
    """What became of a source. layout : whose layout it was taken for. matching : footage to cameras, shown to the
    user. warnings : what to check.
    """

    session: Session
    matching: tuple[CameraMatch, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    layout: str = ""

    @property
    def matches(self) -> tuple[CameraMatch, ...]:
        """The matching."""
        return self.matching


def import_source(
    source: Path,
    into: Path,
    *,
    calibration: Path | str | None = None,
    fps: float | None = None,
    copy: bool = True,
    trial: str | None = None,
    offsets: Mapping[str, int] | None = None,
    rotations: Mapping[str, int] | None = None,
    unit: str = "",
    up: str = "z",
    despite_findings: bool = False,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> ImportReport:
    """Make a session at `into` from a source folder, or an archive of one; `known_layouts`, `folder_layout` and
    `bodytrack` say what is understood.

    calibration : which one to take where there are several. fps : frame rate, before any other. copy : False
    refers to the footage where it lies. trial : which one of several. offsets : by camera (or its footage's name), the
    file's frame that was taken with the others' frame 0; rotations : degrees clockwise by which its pictures are
    turned; both go before what the source says. unit, up : of the calibration, as in `read_calibration`.
    despite_findings : import a calibration that would make results wrong (z not up, a wrong unit, …), with a warning.
    cancelled : asked often; True stops the import with WorkCancelledError.
    All is checked before anything is written; whatever fails, nothing is left and nothing that was stored is
    touched. Raises StudioError.
    """
    report = import_watched(progress, cancelled)
    check_request(source, fps, copy)
    if into.exists():
        raise _taken(into)
    try:
        with folder_of(source.resolve(), FOOTAGE_PARTS, into) as opened:
            plan = _plan(opened, calibration, trial)
            plan = replace(plan, offsets={**plan.offsets, **(offsets or {})})
            plan = replace(plan, rotations={**plan.rotations, **(rotations or {})})
            assert plan.calibration is not None
            read = read_calibration(plan.calibration, unit, up)
            manifest = _written(plan, read, into, fps, copy, despite_findings, report)
    except FileExistsError:
        raise _taken(into) from None
    except OSError as problem:
        raise SessionError(
            f"The import into '{into.name}' failed: {problem}.", "Check the disk's room and permissions."
        ) from None
    return ImportReport(Session(into), manifest.matching, manifest.notes, manifest.warnings, plan.layout)


def _written(
    plan: SourcePlan,
    read: Calibration,
    into: Path,
    fps: float | None,
    copy: bool,
    despite_findings: bool,
    report: Progress,
) -> SessionManifest:
    """The session of a plan, once all of it was read and measured."""
    person = check_person(plan)
    if copy:
        check_room(plan, into)
    measured = measure_source(plan, read, fps, report)
    doubts = check_rig(tuple(entry.camera for entry in measured.cameras), despite_findings)
    measured = replace(measured, warnings=(*measured.warnings, *doubts))
    folder = new_folder_beside(into)
    try:
        manifest = write_session(folder, into.name, plan, read, measured, person, copy=copy, progress=report)
        report("finishing", 1, 1)
        note_files(folder)
        move_into_place(folder, into)
    finally:
        discard(folder)
    return manifest


def _plan(source: Path, calibration: Path | str | None, trial: str | None) -> SourcePlan:
    """The parts of the source, by the importer that knows its layout."""
    if is_bodytrack(source) and trial is None:
        return plan_bodytrack(source, calibration)
    return plan_folder(source, calibration, trial)


def check_request(source: Path, fps: float | None, copy: bool) -> None:
    """What can be refused before looking into the source. Raises FootageError."""
    packed = source.is_file() and is_archive(source)
    if not source.is_dir() and not packed:
        raise FootageError(
            f"There is no folder '{source}', nor an archive.",
            "Give the folder that holds the footage and its calibration, or a zip or tar of it.",
        )
    if packed and not copy:
        raise FootageError(
            f"Footage in '{source.name}' cannot stay where it is.", "Unpack it, or let it be copied."
        )
    if fps is not None and not (math.isfinite(fps) and 0.0 < fps <= FASTEST):
        raise FootageError(f"{fps:g} is no frame rate.", "Give frames per second, such as --fps 60.")


def import_watched(progress: Progress | None, cancelled: Cancelled | None) -> Progress:
    """A progress callback that also stops a cancelled import."""
    return watched(progress, cancelled, "The import")


def _taken(into: Path) -> SessionError:
    return SessionError(
        f"There is something at '{into}' already.", "Choose another name, or delete that session first."
    )
