"""The exports in a run's folder: `exports/<file>`, each with its report."""

import datetime
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
from pydantic import FiniteFloat

from studio.footage.capture.calibration_files import CALIBRATION_FORMATS
from studio.foundations.declaring import Web
from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.knobs import Knob, knobs_of
from studio.foundations.progress import Progress, no_progress
from studio.results.export.exporting import ExportReport, export_run, options_for
from studio.results.export.formats import FORMATS, ExportFormat, format_of
from studio.results.export.options import ExportOptions
from studio.runs.setup.workflow import ExportedFile
from studio.runs.tracks import BEST, RAW, best_track, read_track, track_digest, track_names
from studio.sessions.atomic_files import discard, new_folder_beside, writing
from studio.sessions.record_files import RecordFile
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

FOLDER = "exports"
SAID = ".said.json"


class KeptExport(msgspec.Struct, frozen=True):
    """An export.

    file : its name in the folder.
    made : UTC, ISO 8601.
    checked, notes : as in `ExportReport`.
    track, content : the track that was written and a digest of its poses then; "" for a file without poses, or an
        unknown one.
    """

    file: str
    format: str
    made: str
    bytes: int
    frames: int
    fps: FiniteFloat
    checked: str
    notes: tuple[str, ...]
    options: dict[str, str | int | float | bool]
    track: str = ""
    content: Annotated[str, Web(left_out=True)] = ""
    schema: Annotated[int, Web(left_out=True)] = 1


class ExportLine(KeptExport, frozen=True):
    """A finished export.

    checked : what reading the file back showed.
    notes : on gaps, names and axes.
    stale : why it does not hold its track as it is now.
    """

    stale: str = ""


@dataclass(frozen=True, slots=True)
class RunExports:
    """A run's exports, newest first, and its tracks and cameras to choose among.

    best : the track that is written unless another is chosen.
    note : on better ones that are out of date.
    """

    exports: tuple[ExportLine, ...]
    tracks: tuple[str, ...]
    best: str
    note: str
    cameras: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ExportChoices:
    """The formats and options of an export.

    calibrations : writers by the ending of their files.
    """

    formats: tuple[ExportFormat, ...]
    options: tuple[Knob, ...]
    calibrations: dict[str, list[str]]


_RECORD = RecordFile(
    KeptExport, "the report of an export", "Export it again.", ("There is no such export.", "Export it.")
)


def export_choices() -> ExportChoices:
    """The formats, what opens them, and the options that they take."""
    calibrations: dict[str, list[str]] = {}
    for name, writer in CALIBRATION_FORMATS.items():
        calibrations.setdefault(writer.suffix, []).append(name)
    return ExportChoices(tuple(FORMATS.values()), knobs_of(ExportOptions), calibrations)


def exports_of(run: StoredRun) -> RunExports:
    """A run's exports, and the choices for the next one."""
    lines = (
        ExportLine(**msgspec.structs.asdict(kept), stale=stale_export(run, kept))
        for kept in kept_exports(run)
    )
    best, cameras = best_track(run), tuple(camera.name for camera in run.cameras())
    return RunExports(tuple(lines), track_names(run), best.name, best.note, cameras)


def requested_format(name: str, options: Mapping[str, object]) -> ExportFormat:
    """The format of a request. Raises ExportError, SettingsError for an unknown format or option."""
    form = format_of(name)
    options_for(form, options)
    return form


def filmed_frames(run: StoredRun, first: int | None, last: int | None, most: int) -> tuple[int, ...]:
    """The stored frames of a run, half open, at most so many. Raises NotFoundError for none."""
    with run.results() as results:
        stored = results.timeline().frames.tolist()
    begin, end = first or 0, max(stored, default=-1) + 1 if last is None else last
    frames = tuple(frame for frame in stored if begin <= frame < end)[:most]
    if not frames:
        raise NotFoundError(f"There are no frames from {begin} to {end}.", "Choose others.")
    return frames


def export_into_run(
    session: Session,
    run: StoredRun,
    form: ExportFormat,
    requested: Mapping[str, str | int | float | bool],
    *,
    progress: Progress = no_progress,
) -> KeptExport:
    """Export a run into its own folder; several files become one zip. The same request replaces its file.

    Raises what `exporting.export_run` raises.
    """
    folder = run.folder / FOLDER
    folder.mkdir(exist_ok=True)
    report = export_run(
        session,
        run,
        form,
        requested,
        folder / f"{_stem(session, run, form, requested)}.{form.name}",
        progress=progress,
        pack=True,
    )
    content = _content(run, report.track) if report.track else ""
    kept = msgspec.structs.replace(_kept_export(report, requested), track=report.track, content=content)
    _RECORD.write(folder / f"{kept.file}{SAID}", kept)
    return kept


def keep_file(
    run: StoredRun, stem: str, kind: str, fps: float, write: Callable[[Path], int], words: str
) -> KeptExport:
    """Keep a file that was made for a run, such as a film of its scene, among its exports.

    write : makes the file, and returns its number of frames. Another of the same name is replaced.
    """
    folder = run.folder / FOLDER
    folder.mkdir(exist_ok=True)
    place = folder / f"{stem}.{kind}"
    part = new_folder_beside(place)
    try:
        count = write(part / place.name)
        with writing("The file", place):
            os.replace(part / place.name, place)
    finally:
        discard(part)
    made = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
    kept = KeptExport(place.name, kind, made, place.stat().st_size, count, fps, words, (), {})
    _RECORD.write(folder / f"{kept.file}{SAID}", kept)
    return kept


def kept_exports(run: StoredRun) -> tuple[KeptExport, ...]:
    """The run's exports, newest first, without unknown files."""
    exports: list[KeptExport] = []
    for path in (run.folder / FOLDER).glob(f"*{SAID}"):
        try:
            kept = _RECORD.read(path)
        except SessionError:
            continue
        if f"{kept.file}{SAID}" == path.name and (path.parent / kept.file).is_file():
            exports.append(kept)
    return tuple(sorted(exports, key=lambda kept: kept.made, reverse=True))


def stale_export(run: StoredRun, kept: KeptExport) -> str:
    """Why a file is out of date with its track, a clause; "" if it is not, or if that is unknown."""
    if not kept.content:
        return ""
    if kept.track not in track_names(run):
        return f"track '{kept.track}' that it was written from no longer exists"
    if _content(run, kept.track) != kept.content:
        return f"written before track '{kept.track}' changed"
    best = best_track(run).name
    if kept.options.get("track", BEST) == BEST and best != kept.track:
        return f"holds track '{kept.track}', and '{best}' is the best now"
    return ""


def exported_files(run: StoredRun) -> tuple[ExportedFile, ...]:
    """The run's exports, for the guided set-up."""
    return tuple(ExportedFile(kept.file, stale_export(run, kept)) for kept in kept_exports(run))


def kept_file(run: StoredRun, name: str) -> Path:
    """The path of an export by its file's name, which must be one of the list. Raises NotFoundError."""
    known = {kept.file for kept in kept_exports(run)}
    if name not in known:
        raise NotFoundError(f"Run '{run.name}' has no export '{name[:80]}'.", "Export it again.")
    return run.folder / FOLDER / name


def discard_export(run: StoredRun, name: str) -> None:
    """Delete an export; the run can always make it again. Raises NotFoundError."""
    path = kept_file(run, name)
    path.unlink()
    (path.parent / f"{name}{SAID}").unlink(missing_ok=True)


def _stem(
    session: Session, run: StoredRun, form: ExportFormat, requested: Mapping[str, str | int | float | bool]
) -> str:
    """A file name that says what the file holds: session, run, its track unless raw, and unusual options."""
    usual = ExportOptions(track=RAW)
    parts, chosen = [session.name, run.name], dict(requested)
    if "track" in form.takes and chosen.get("track", BEST) == BEST:
        chosen["track"] = best_track(run).name
    for name, value in sorted(chosen.items()):
        if name != "last" and getattr(usual, name, value) != value:
            word = value if isinstance(value, str) else f"{name}{value}"
            parts.append({True: name, False: ""}[value] if isinstance(value, bool) else word)
    if requested.get("last"):
        parts.append(f"to{requested['last']}")
    return "-".join(
        "".join(sign if sign.isalnum() or sign in "_.-" else "_" for sign in part) for part in parts if part
    )


def _content(run: StoredRun, track: str) -> str:
    return track_digest(read_track(run, track))


def _kept_export(report: ExportReport, requested: Mapping[str, str | int | float | bool]) -> KeptExport:
    made = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
    size, file = report.size, report.files[0].name
    return KeptExport(
        file,
        report.format,
        made,
        size,
        report.frames,
        report.fps,
        report.checked,
        report.notes,
        dict(requested),
    )
