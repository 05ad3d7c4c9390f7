"""Makes a session from a recording of live cameras: offsets follow from the times of the pictures."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from studio.footage.capture.calibration_files import read_calibration
from studio.footage.capture.live_cameras import APART, SpreadFigures, furthest, spread_figures
from studio.footage.capture.stream_files import mend_recording
from studio.footage.capture.timestamps import read_timestamps
from studio.foundations.arrays import Array
from studio.foundations.errors import FootageError
from studio.foundations.progress import Progress, no_progress
from studio.foundations.words import sentence
from studio.sessions.importers.importing import ImportReport, import_source
from studio.sessions.manifest import FILE_NAME as MANIFEST_NAME
from studio.sessions.names import is_name
from studio.sessions.session import CAMERAS_PATH, Session, redescribe
from studio.sessions.workspace import Workspace

TIMES_NAME = "timestamps.csv"
LATE_SECONDS = 1e-6


def calibration_given(place: str | Path, workspace: Workspace | None = None) -> Path:
    """The calibration's file or folder; of a session, by its folder or (with a workspace) its name, its own.

    Raises FootageError where there is none.
    """
    path = Path(place).expanduser()
    if not path.exists() and workspace is not None and is_name(str(place)):
        path = workspace.root / str(place)
    if (path / CAMERAS_PATH).is_file():
        return path / CAMERAS_PATH
    if (path / MANIFEST_NAME).is_file():
        raise FootageError(
            f"Session '{place}' has no calibration.", "Calibrate it, or give another session or a file."
        )
    if not path.exists():
        raise FootageError(
            f"There is no calibration '{place}'.",
            "Give its file or folder, or a session that has one, by its name or folder.",
        )
    return path


def check_cameras(calibration: Path, names: Sequence[str]) -> None:
    """Raises FootageError where a camera to be recorded is not in the calibration; before an hour is recorded."""
    known = [camera.name for camera in read_calibration(calibration).cameras]
    for name in names:
        if name not in known:
            raise FootageError(
                f"Camera {name} is not in '{calibration.name}'.",
                f"Name cameras as it does: {', '.join(known)}.",
            )


def import_recording(
    folder: Path, into: Path, calibration: Path, notes: Sequence[str] = (), progress: Progress = no_progress
) -> tuple[ImportReport, SpreadFigures]:
    """Make a session at `into` from a recording, which is then removed; an interrupted recording is repaired first.

    Also returns the time spread of a frame's pictures. Raises StudioError; then the recording stays.
    """
    for path in sorted((folder / "videos").glob("*.mp4")):
        mend_recording(path)
    place = folder / "calibration"
    if place.exists():
        shutil.rmtree(place)
    if calibration.is_dir():
        shutil.copytree(calibration, place)
    else:
        place.mkdir()
        shutil.copyfile(calibration, place / calibration.name)
    report = import_source(folder, into, progress=progress)
    spreads = spreads_of(folder / TIMES_NAME, report.session)
    shutil.copyfile(folder / TIMES_NAME, report.session.path / TIMES_NAME)
    spread_note = f"{sentence(spreads.in_words)}."
    manifest = report.session.manifest
    described = redescribe(
        report.session,
        msgspec.structs.replace(
            manifest,
            title=into.name,
            imported_from="live cameras",
            notes=(*manifest.notes, "Recorded from live cameras.", spread_note),
            warnings=(*manifest.warnings, *notes, *((spread_note,) if spreads.apart else ())),
        ),
    )
    shutil.rmtree(folder, ignore_errors=True)
    imported = ImportReport(
        described, report.matching, (*report.notes, spread_note), (*report.warnings, *notes), report.layout
    )
    return imported, spreads


def spreads_of(path: Path, session: Session) -> SpreadFigures:
    """The time spread of the pictures of a frame, from a recorder's times and the session's offsets."""
    source = session.manifest.footage
    times = read_timestamps(path)
    cut = {
        camera.name: times[camera.name][camera.offset : camera.offset + source.frame_count]
        for camera in source.cameras
        if camera.name in times
    }
    count = min(map(len, cut.values()), default=0)
    return figures_of({name: moments[:count] for name, moments in cut.items()}, source.fps)


def figures_of(times: dict[str, Array], fps: float) -> SpreadFigures:
    """The time spread of frames whose pictures came at these times (K,) by camera, seconds."""
    rows = np.stack(list(times.values()), axis=1) if times else np.zeros((0, 1))
    spreads = rows.max(axis=1) - rows.min(axis=1) if len(rows) else np.zeros(0)
    late = [
        furthest(dict(zip(times, row.tolist(), strict=True))) if spread > APART / fps + LATE_SECONDS else ""
        for row, spread in zip(rows, spreads, strict=True)
    ]
    return spread_figures(spreads, late)
