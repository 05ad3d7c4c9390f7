"""Landmarks of a subject that a person clicked in single views of a few frames.

They are a CSV file with the columns frame, camera, landmark, x and y: pixels of the picture as the footage gives it,
(0, 0) the centre of its top-left pixel. A session keeps its own as `landmarks.csv`.
"""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from studio.footage.capture.footage_source import CameraSource
from studio.foundations.csv_text import as_csv
from studio.foundations.errors import FootageError
from studio.foundations.foreign_files import foreign_file, read_foreign_text
from studio.foundations.words import sentence
from studio.sessions.atomic_files import write_text
from studio.sessions.session import Session
from studio.sessions.stroke_files import missing_view, sources_by_name
from studio.sessions.work_under_way import one_at_a_time

LANDMARKS_NAME = "landmarks.csv"
COLUMNS = ("frame", "camera", "landmark", "x", "y")
FORMAT = f"Write the columns {','.join(COLUMNS)} and a row a click, x and y in pixels: 0,cam1,Nose,412.5,230."
SEPARATORS = (",", ";", "\t")
MOST_CLICKS = 100_000
BESIDE = 0.1
"""Share of a picture's longer side by which a click may lie outside it."""


@dataclass(frozen=True, slots=True)
class LandmarkClick:
    """One landmark in one view of one frame. x, y : pixels of the picture as the footage gives it."""

    frame: int
    camera: str
    landmark: str
    x: float
    y: float


def clicks_of_file(session: Session, path: Path) -> tuple[LandmarkClick, ...]:
    """The clicks of a file. Raises FootageError for one that cannot be read or does not fit the session."""
    clicks = _read(path)
    _check(session, clicks, f"'{path.name}': ")
    return clicks


def stored_clicks(session: Session) -> tuple[LandmarkClick, ...]:
    """The clicks that the session keeps, without those that its footage has no camera, frame or place for any more
    since it was changed; none where there is no file. Raises FootageError.
    """
    path = session.path / LANDMARKS_NAME
    if not path.exists():
        return ()
    sources, count = sources_by_name(session), session.manifest.frame_count
    return tuple(one for one in _read(path) if not _misfit(one, sources, count))


def keep_clicks(session: Session, clicks: Sequence[LandmarkClick]) -> None:
    """Keep these clicks in place of the session's. Raises FootageError for clicks that do not fit it."""
    _check(session, clicks, "")
    path = session.path / LANDMARKS_NAME
    with one_at_a_time(session.path):
        if not clicks:
            path.unlink(missing_ok=True)
            return
        rows = [(one.frame, one.camera, one.landmark, f"{one.x:.2f}", f"{one.y:.2f}") for one in clicks]
        write_text(path, as_csv([COLUMNS, *rows]))


def _read(path: Path) -> tuple[LandmarkClick, ...]:
    with foreign_file(path, FootageError, "a CSV file of clicked landmarks", FORMAT):
        lines = read_foreign_text(path, wrong=FootageError).splitlines()
        first = next((line for line in lines if line.strip()), "")
        separator = max(SEPARATORS, key=first.count)
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator, strict=True)]
    heads, *rows = [row for row in rows if any(row)] or [[]]
    missing = [name for name in COLUMNS if heads.count(name) != 1]
    if missing:
        raise FootageError(f"'{path.name}' has no column '{missing[0]}', or several.", FORMAT)
    places = [heads.index(name) for name in COLUMNS]
    return tuple(_click(path, row, len(heads), places) for row in rows)


def _click(path: Path, row: Sequence[str], width: int, places: Sequence[int]) -> LandmarkClick:
    try:
        if any(row[width:]):
            raise ValueError
        frame, camera, landmark, x, y = ([*row, *[""] * width][place] for place in places)
        return LandmarkClick(int(frame), camera, landmark, float(x), float(y))
    except ValueError:
        words = ",".join(row)[:80]
        raise FootageError(f"'{path.name}' has a row that is no click: {words}.", FORMAT) from None


def _check(session: Session, clicks: Sequence[LandmarkClick], where: str) -> None:
    if len(clicks) > MOST_CLICKS:
        raise FootageError(f"{where}{len(clicks)} clicks are too many.", f"Give {MOST_CLICKS} at most.")
    sources, count = sources_by_name(session), session.manifest.frame_count
    places = set[tuple[int, str, str]]()
    for click in clicks:
        place = (click.frame, click.camera, click.landmark)
        if wrong := _misfit(click, sources, count):
            raise FootageError(f"{where}{wrong}." if where else sentence(f"{wrong}."), FORMAT)
        if place in places:
            raise FootageError(
                f"{where}'{click.landmark}' is given twice in {click.camera}, frame {click.frame}.",
                "Keep one click of a landmark in a view.",
            )
        places.add(place)


def _misfit(click: LandmarkClick, sources: Mapping[str, CameraSource], count: int) -> str:
    """Why a click does not fit the footage, "" if it does. count : of frames."""
    if missing := missing_view(click.camera, click.frame, sources, count):
        return missing
    source = sources[click.camera]
    if not click.landmark:
        return f"a click in {click.camera}, frame {click.frame}, names no landmark"
    beside = BESIDE * max(source.width, source.height)
    inside = -beside <= click.x <= source.width + beside and -beside <= click.y <= source.height + beside
    if math.isfinite(click.x) and math.isfinite(click.y) and inside:
        return ""
    where = f"{click.x:g}, {click.y:g}"
    return f"{where} lies outside the picture of {click.camera}, {source.width}x{source.height}"
