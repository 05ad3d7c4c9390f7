"""Exports of a run: options checked, the file written in a folder of its own, read back, and only then offered."""

import dataclasses
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from studio.foundations.errors import ExportError
from studio.foundations.knobs import changed
from studio.foundations.progress import Progress, no_progress
from studio.foundations.registry import plugged_in
from studio.results.export.formats import ExportFormat
from studio.results.export.motion import motion_of, no_motion
from studio.results.export.options import AUTO, ExportOptions
from studio.results.export.task import ExportTask, Writer, Written
from studio.runs.tracks import BEST, best_track
from studio.sessions.atomic_files import discard, new_folder_beside, sync_folder
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@dataclass(frozen=True, slots=True)
class ExportReport:
    """The result of an export.

    files : that were written.
    frames : how many are in them.
    checked : what reading the file back showed.
    notes : sentences on gaps, names and axes, and on a better track that was not used.
    track : that was written, "" for none.
    """

    format: str
    files: tuple[Path, ...]
    frames: int
    fps: float
    checked: str
    notes: tuple[str, ...]
    track: str = ""

    @property
    def size(self) -> int:
        return sum(path.stat().st_size for path in self.files)


def options_for(form: ExportFormat, requested: Mapping[str, object]) -> ExportOptions:
    """The options of an export of a format, as requested, with "auto" made what the format has.

    Raises SettingsError for unknown names and values, ExportError for an option that the format does not take, or an
    empty range of frames.
    """
    options = changed(ExportOptions(), requested)
    for name in requested:
        if name not in form.takes and getattr(options, name) != getattr(ExportOptions(), name):
            raise ExportError(
                f"Option '{name}' means nothing to {form.title} ({form.name}).",
                f"It takes {', '.join(form.takes)}.",
            )
    if options.last and options.last <= options.first:
        raise ExportError(
            f"No frame lies from {options.first} to before {options.last}.",
            "Let 'last' be greater than 'first'.",
        )
    unit = form.unit if options.unit == AUTO else options.unit
    up = form.up if options.up == AUTO else options.up
    return dataclasses.replace(options, unit=unit or "mm", up=up or "z")


def with_track(run: StoredRun, options: ExportOptions) -> tuple[ExportOptions, tuple[str, ...]]:
    """The options with the best track by its name, where the best is wanted; and notes on better ones out of date."""
    if options.track != BEST:
        return options, ()
    best = best_track(run)
    return dataclasses.replace(options, track=best.name), (best.note,) if best.note else ()


def export_run(
    session: Session,
    run: StoredRun,
    form: ExportFormat,
    requested: Mapping[str, object],
    place: Path,
    *,
    progress: Progress = no_progress,
    pack: bool = False,
) -> ExportReport:
    """Export a run to `place`, which is replaced only after the new file has been read back and checked.

    requested : options by name. pack : several files become one zip.
    Raises ExportError, and the errors of reading the run.
    """
    options = options_for(form, requested)
    writer: Writer = form.write or plugged_in("scene-recorder")
    notes: tuple[str, ...] = ()
    if "track" in form.takes:
        options, notes = with_track(run, options)
    motion = no_motion(run) if form.what == "cameras" else motion_of(run, options)
    folder = _working_folder(place, run)

    try:
        written = writer(ExportTask(session, run, motion, options, folder / place.name, progress))
        progress("finishing", 1, 1)
        files = _pack(written, place) if pack and len(written.files) > 1 else written.files
        moved = tuple(_in_place(path, place.parent) for path in files)
    except OSError as error:
        raise ExportError(
            f"'{place.name}' cannot be written ({error.strerror or error}).",
            "Check the disk's room and the folder.",
        ) from None
    finally:
        discard(folder)
    sync_folder(place.parent)
    return ExportReport(
        form.name,
        moved,
        len(motion.frames),
        motion.fps,
        written.checked,
        (*notes, *_damage(run), *motion.notes, *written.notes),
        options.track if "track" in form.takes else "",
    )


def _damage(run: StoredRun) -> tuple[str, ...]:
    damage = run.damage()
    return (damage,) if damage else ()


def _working_folder(place: Path, run: StoredRun) -> Path:
    """A hidden folder beside the place. Raises ExportError, SessionError where nothing can be written."""
    if place.is_dir():
        raise ExportError(f"'{place.name}' is a folder.", "Name a file.")
    return new_folder_beside(place, parents=not place.is_relative_to(run.folder))


def _pack(written: Written, place: Path) -> tuple[Path, ...]:
    """The files as one zip, stored as they are: what is in them is packed already."""
    archive = written.files[0].parent / f"{place.stem}-{place.suffix.removeprefix('.')}.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as packed:
        for path in written.files:
            packed.write(path, path.name)
    return (archive,)


def _in_place(path: Path, folder: Path) -> Path:
    place = folder / path.name
    os.replace(path, place)
    return place
