"""Frame times as recorders write them beside their videos: Caliscope's `timestamps.csv` and similar files.

A line a frame: the camera (`cam_id`, formerly `port`), its time in seconds (`frame_time`) and perhaps the frame's
number in the video (`frame_index`); without it, lines of a camera are counted in the order of their times. From them
follow each camera's offset and the time spread of a frame's pictures.
"""

import csv
import io
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.footage.capture.naming import listed, natural_key
from studio.foundations.arrays import Array
from studio.foundations.errors import FootageError
from studio.foundations.foreign_files import foreign_file, read_file

OLDER_NAME = "frame_time_history.csv"
TIMESTAMP_NAMES = ("timestamps.csv", "frame_timestamps.csv", OLDER_NAME)
CAMERA_COLUMNS, TIME_COLUMNS, INDEX_COLUMNS = (
    ("cam_id", "port", "camera"),
    ("frame_time", "timestamp"),
    ("frame_index",),
)
LARGEST_FILE = 200_000_000
APART = 0.5
"""Pictures more than this share of a frame's duration apart are reported."""


@dataclass(frozen=True, slots=True)
class TimedOffsets:
    """Offsets and rate from times. offsets : each camera's frame that belongs to frame 0, the smallest being 0.

    fps : frames per second. apart : largest distance of pictures with one number, in frames. notes : for the user,
    sentences.
    """

    offsets: dict[str, int]
    fps: float
    apart: float
    notes: tuple[str, ...]


def read_timestamps(path: Path) -> dict[str, Array]:
    """Times of every camera's frames by the camera's number or name, seconds; frames without a line are filled in
    between their neighbours. Frames before the first line count back at an even rate.

    Raises FootageError naming file and line.
    """
    with foreign_file(path, FootageError, "a table of times", "Copy it again."):
        text = read_file(path, LARGEST_FILE, FootageError).decode("utf-8-sig")
        rows = csv.DictReader(io.StringIO(text, newline=""))
        columns = [_column(path, rows.fieldnames or (), names) for names in (CAMERA_COLUMNS, TIME_COLUMNS)]
        # The older file counts frames from the stream's begin, not the video's.
        numbered = () if path.name == OLDER_NAME else rows.fieldnames or ()
        index_column = next((name for name in INDEX_COLUMNS if name in numbered), "")
        by_camera: dict[str, list[tuple[int, float]]] = {}
        for number, row in enumerate(rows, 2):
            camera = (row[columns[0]] or "").strip()
            moment = _number(path, number, row[columns[1]])
            index = round(_number(path, number, row[index_column])) if index_column else -1
            by_camera.setdefault(camera, []).append((index, moment))
    if not by_camera:
        raise FootageError(f"'{path.name}' holds no times.", "Copy it again, or give the offsets by hand.")
    return {name: _times(path, name, by_camera[name]) for name in sorted(by_camera, key=natural_key)}


def offsets_from_times(times: dict[str, Array]) -> TimedOffsets:
    """Offsets of cameras with frames at these times (s). Raises FootageError for no overlap or different rates."""
    rates = {name: 1.0 / float(np.median(np.diff(moments))) for name, moments in times.items()}
    fps = float(np.median(list(rates.values())))
    # A short take's times scatter: what matters is that the cameras fall a frame apart.
    apart_at_end = [abs(rate - fps) * float(np.ptp(times[name])) for name, rate in rates.items()]
    if any(abs(rate / fps - 1.0) > 0.02 for rate in rates.values()) and max(apart_at_end) > 1.0:
        words = ", ".join(f"{name}: {rate:.2f}" for name, rate in rates.items())
        raise FootageError(
            f"By their times the cameras have different frame rates ({words}).",
            "Resample the footage to one rate, so that frames belong together.",
        )
    start = max(float(moments[0]) for moments in times.values())
    if any(moments[-1] <= start for moments in times.values()):
        raise FootageError("The times of the cameras do not overlap.", "Give footage of the same take.")
    offsets = {name: int(np.argmin(np.abs(moments - start))) for name, moments in times.items()}
    offsets = _nearest_throughout(times, offsets, fps)
    apart = _apart(times, offsets) * fps
    notes: list[str] = []
    if apart > APART:
        notes.append(
            f"Pictures of one frame were taken up to {apart:.1f} frames apart by the recorded times: cameras drift or"
            " frames were lost."
        )
    return TimedOffsets(offsets, fps, apart, tuple(notes))


def _nearest_throughout(times: dict[str, Array], offsets: dict[str, int], fps: float) -> dict[str, int]:
    """Offsets by which pictures lie nearest over the whole take, not only at its begin, where they may have come late;
    the smallest is 0. Cameras are compared with the middle one of them.
    """
    count = min(len(times[name]) - offset for name, offset in offsets.items())
    cut = np.stack([times[name][offset : offset + count] for name, offset in offsets.items()])
    late = np.median(cut - np.median(cut, axis=0), axis=1) * fps
    late = np.median(cut - cut[np.argmin(np.abs(late))], axis=1) * fps
    moved = {
        name: offset - round(float(frames))
        for (name, offset), frames in zip(offsets.items(), late, strict=True)
    }
    least = min(moved.values())
    moved = {name: offset - least for name, offset in moved.items()}
    # An offset must leave frames to compare.
    return moved if all(offset < len(times[name]) for name, offset in moved.items()) else offsets


def _apart(times: dict[str, Array], offsets: dict[str, int]) -> float:
    """The largest distance between two cameras' pictures with one number, seconds."""
    count = min(len(times[name]) - offsets[name] for name in times)
    cut = [times[name][offset : offset + count] for name, offset in offsets.items()]
    return max((float(np.abs(a - b).max()) for a, b in itertools.combinations(cut, 2)), default=0.0)


def _column(path: Path, given: Sequence[str], names: tuple[str, ...]) -> str:
    column = next((name for name in names if name in given), "")
    if not column:
        raise FootageError(
            f"'{path.name}' has no column '{names[0]}' but {listed(given)}.",
            "Caliscope writes the columns cam_id and frame_time.",
        )
    return column


def _number(path: Path, line: int, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise FootageError(
            f"'{path.name}' line {line} holds '{(text or '')[:40]}' where a number should be.",
            "Correct the line.",
        )
    return value


def _times(path: Path, camera: str, lines: list[tuple[int, float]]) -> Array:
    """(F,) seconds of a camera's frames 0 … F-1. Raises FootageError if they do not rise."""
    if lines[0][0] < 0:
        lines = [(index, moment) for index, moment in enumerate(sorted(moment for _, moment in lines))]
    lines = sorted(lines)
    numbers, moments = np.array([n for n, _ in lines]), np.array([moment for _, moment in lines])
    if len(lines) < 2 or np.any(np.diff(numbers) <= 0) or np.any(np.diff(moments) <= 0.0) or numbers[0] < 0:
        raise FootageError(
            f"The times of camera {camera} in '{path.name}' do not rise from frame to frame.",
            "Copy the file again, or give the offsets by hand.",
        )
    if numbers[-1] > 100 * len(lines):
        raise FootageError(
            f"Camera {camera} in '{path.name}' has {len(lines)} times for {numbers[-1] + 1} frames.",
            "Copy the file again, or give the offsets by hand.",
        )
    step = float(np.median(np.diff(moments) / np.diff(numbers)))
    first, last = int(numbers[0]), int(numbers[-1])
    before = float(moments[0]) - step * np.arange(first, 0, -1)
    after = np.interp(np.arange(first, last + 1), numbers, moments)
    return np.concatenate([before, after], dtype=np.float64)
