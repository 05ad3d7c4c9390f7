# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false
# h5py and SciPy's reader of MATLAB files have no types for what they find.
"""Points in space that other programs keep as arrays.

    .h5    DeepLabCut's table as pandas stores it (either way), SLEAP's analysis file
    .nwb   pose estimates of ndx-pose
    .npy   FreeMoCap's raw data, (frames, points, 3): MediaPipe's points in its order
    .mat   label3d's hand-labelled points (labelData, frames as it counts them), DANNCE's predictions (pred)

Native parsers run in a process of their own (`isolated`). HDF5 files may refer to other files: such entries are not
followed. What pandas pickles is read without running it. HDF5 needs the extra `labs`.
"""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from studio.body.motion_files.points_csv import LAST_FRAME, MOST_NUMBERS
from studio.body.motion_files.trc import MM_PER_UNIT, UNIT_WORDS, MarkerMotion, check_reach, without_zeros
from studio.foundations.arrays import Array, read_array
from studio.foundations.errors import TruthError
from studio.foundations.extras import load_extra
from studio.foundations.foreign_files import LARGEST, check_regular, foreign_file, read_file
from studio.foundations.foreign_pickles import read_plain_pickle
from studio.foundations.isolated import isolated
from studio.foundations.typed_decoding import is_list, is_table

EXTRA = "labs"
MEDIAPIPE = (
    "nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer",
    "left_ear", "right_ear", "mouth_left", "mouth_right", "left_shoulder", "right_shoulder", "left_elbow",
    "right_elbow", "left_wrist", "right_wrist", "left_pinky", "right_pinky", "left_index", "right_index",
    "left_thumb", "right_thumb", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle",
    "left_heel", "right_heel", "left_foot_index", "right_foot_index",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Tracks:
    """What an array file holds. frames : (K,) numbers of the frames, or seconds where timed. places : (K, M, 3) in the
    file's unit, "" where it names none.
    """

    names: tuple[str, ...]
    frames: Array
    places: Array
    unit: str = ""
    timed: bool = False
    notes: tuple[str, ...] = ()


def read_points_h5(path: Path, fps: float) -> MarkerMotion:
    """The points of an HDF5 file (.h5, .nwb), a row for every frame from 0 to its last one, NaN where missing.

    fps : frames per second. Raises TruthError, StudioError without the extra.
    """
    check_regular(path, TruthError)
    load_extra("h5py", EXTRA)
    return _motion(path, isolated(TruthError, _points_h5, path), fps)


def read_points_npy(path: Path, fps: float) -> MarkerMotion:
    """The body's points of FreeMoCap's array. Raises TruthError."""
    with foreign_file(path, TruthError, "an array of points (.npy)", "Export it again."):
        values = read_array(read_file(path, LARGEST, TruthError))
        if values.ndim != 3 or values.shape[2] != 3 or values.dtype.kind not in "fiu":
            raise ValueError(f"an array of shape {values.shape}, not frames, points and 3")
        if values.shape[1] < len(MEDIAPIPE):
            raise ValueError(f"{values.shape[1]} points, not MediaPipe's {len(MEDIAPIPE)} of a body")
        places = np.asarray(values[:, : len(MEDIAPIPE)], dtype=np.float64)
        tracks = _Tracks(MEDIAPIPE, np.arange(len(places), dtype=np.float64), places)
    return _motion(path, tracks, fps)


def read_points_mat(path: Path, fps: float) -> MarkerMotion:
    """The points of a MATLAB file of label3d or DANNCE. Raises TruthError."""
    check_regular(path, TruthError)
    return _motion(path, isolated(TruthError, _points_mat, path), fps)


def _motion(path: Path, tracks: _Tracks, fps: float) -> MarkerMotion:
    """A row for each frame from 0 on."""
    moments = tracks.frames * fps if tracks.timed else tracks.frames
    known = np.isfinite(moments)
    rows = np.round(np.where(known, moments, -1.0)).astype(np.int64)
    if not len(rows) or rows.min() < 0 or rows.max() > LAST_FRAME:
        raise TruthError(
            f"'{path.name}' has no frames, or frames that no footage has.",
            f"Number the frames as the footage has them, up to {LAST_FRAME}.",
        )
    count = int(rows.max()) + 1
    if count * len(tracks.names) > MOST_NUMBERS:
        raise TruthError(
            f"'{path.name}' has {len(tracks.names)} points and {count} frames.", "These are too many to hold."
        )
    if len(set(tracks.names)) < len(tracks.names):
        raise TruthError(f"'{path.name}' names a point twice.", "Give each point its own name.")
    whole = np.asarray(np.isfinite(tracks.places).all(axis=2))
    positions = np.full((count, len(tracks.names), 3), np.nan)
    positions[rows] = np.where(whole[..., None], tracks.places, np.nan)
    positions, notes = without_zeros(path, positions)
    places = positions * MM_PER_UNIT[tracks.unit or "mm"]
    motion = MarkerMotion(
        tracks.names, np.arange(count) / fps, places, tracks.unit, fps, (*tracks.notes, *notes)
    )
    check_reach(path, motion, TruthError)
    return motion


def _points_h5(path: Path) -> _Tracks:
    h5 = load_extra("h5py", EXTRA)
    with (
        foreign_file(path, TruthError, "an HDF5 file of points", "Export it again, or as CSV."),
        h5.File(path, "r") as file,
    ):
        readers = (_sleap, _deeplabcut, _nwb)
        tracks = next((one for reader in readers if (one := reader(h5, file)) is not None), None)
        if tracks is None:
            raise TruthError(
                f"'{path.name}' is no HDF5 file of points that is known.",
                "DeepLabCut's (after triangulation), SLEAP's analysis file and NWB with ndx-pose are read.",
            )
        if tracks.places.ndim != 3 or tracks.places.shape[1:] != (len(tracks.names), 3):
            raise TruthError(
                f"'{path.name}' holds pixels or several bodies, not one body's places in space.",
                "Give the points after triangulation, of one individual.",
            )
        return tracks


def _entry(h5: Any, place: Any, name: str) -> Any:  # noqa: ANN401 - a group or data set, None without
    """What lies in this file itself under a name of a group."""
    if not isinstance(place, h5.Group) or not isinstance(place.get(name, getlink=True), h5.HardLink):
        return None
    return place[name]


def _values(h5: Any, place: Any, name: str) -> Any:  # noqa: ANN401 - an array, None without
    entry = _entry(h5, place, name)
    if not isinstance(entry, h5.Dataset):
        return None
    if entry.external or entry.is_virtual:
        raise ValueError("its numbers lie in another file")
    if math.prod(entry.shape) * max(1, entry.dtype.itemsize // 8) > 3 * MOST_NUMBERS:
        raise ValueError(f"'{name}' has {entry.shape} entries")
    return entry[()]


def _texts(values: Any) -> tuple[str, ...]:  # noqa: ANN401
    flat = np.atleast_1d(values).ravel().tolist()
    return tuple(one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one) for one in flat)


def _sleap(h5: Any, file: Any) -> _Tracks | None:  # noqa: ANN401
    """SLEAP's analysis file: tracks (individuals, 3, points, frames)."""
    tracks, names = _values(h5, file, "tracks"), _values(h5, file, "node_names")
    if tracks is None:
        return None
    if names is None:
        raise ValueError("its points have no names (node_names)")
    if tracks.ndim != 4 or len(tracks) != 1:
        return _Tracks(_texts(names), np.zeros(0), np.zeros(0))
    places = np.asarray(tracks[0], dtype=np.float64).transpose(2, 1, 0)
    return _Tracks(_texts(names), np.arange(len(places), dtype=np.float64), places)


def _deeplabcut(h5: Any, file: Any) -> _Tracks | None:  # noqa: ANN401
    """A pandas table with columns scorer, (individuals), bodyparts, coords."""
    for key in file:
        group = _entry(h5, file, key)
        if not isinstance(group, h5.Group):
            continue
        kind = bytes(group.attrs.get("pandas_type", b""))
        if kind == b"frame_table":
            table = _values(h5, group, "table")
            fields = [] if table is None else [name for name in table.dtype.names or () if name != "index"]
            columns = [
                column
                for name in fields
                for column in _pickled(_entry(h5, group, "table").attrs.get(f"{name}_kind"))
            ]
            if table is None or "index" not in (table.dtype.names or ()):
                raise ValueError("a table without its index")
            blocks = [np.asarray(table[name], dtype=np.float64).reshape(len(table), -1) for name in fields]
            return _of_columns(columns, np.asarray(table["index"]), np.concatenate(blocks, axis=1))
        if kind == b"frame":
            levels = int(group.attrs["block0_items_nlevels"])
            names = [_texts(_values(h5, group, f"block0_items_level{level}")) for level in range(levels)]
            codes = [_values(h5, group, f"block0_items_label{level}") for level in range(levels)]
            columns = [
                [names[level][code] for level, code in enumerate(row)] for row in zip(*codes, strict=True)
            ]
            values = np.asarray(_values(h5, group, "block0_values"), dtype=np.float64)
            return _of_columns(columns, np.asarray(_values(h5, group, "axis1")), values)
    return None


def _pickled(text: Any) -> list[Sequence[str]]:  # noqa: ANN401
    columns = read_plain_pickle(bytes(text)) if text is not None else []
    if not is_list(columns) or not all(is_list(one) and len(one) >= 3 for one in columns):
        raise ValueError("columns that are not scorer, bodyparts and coords")
    return [[str(level) for level in one] for one in columns]


def _of_columns(columns: Sequence[Sequence[str]], index: Any, values: Array) -> _Tracks:  # noqa: ANN401
    """columns : scorer, (individual), point, axis each, of the values (K, columns)."""
    if len(columns) != values.shape[1]:
        raise ValueError(f"{len(columns)} columns and {values.shape[1]} numbers a row")
    if len({column[1] for column in columns if len(column) > 3}) > 1:
        raise TruthError(
            "It has points of several individuals.", "Export one individual a file: a truth is of one body."
        )
    names = tuple(dict.fromkeys(column[-2] for column in columns))
    places = np.full((len(values), len(names), 3), np.nan)
    axes = {column[-1] for column in columns}
    if not {"x", "y", "z"} <= axes:
        raise TruthError(
            f"It holds pixels ({', '.join(sorted(axes))}), not places in space.",
            "Give the table after triangulation (…_DLC_3D.h5).",
        )
    for column, numbers in zip(columns, values.T, strict=True):
        if column[-1] in ("x", "y", "z"):
            places[:, names.index(column[-2]), "xyz".index(column[-1])] = numbers
    numbered = index.dtype.kind in "iuf"
    frames = np.asarray(index, dtype=np.float64) if numbered else np.arange(len(values), dtype=np.float64)
    return _Tracks(names, frames, places)


def _nwb(h5: Any, file: Any) -> _Tracks | None:  # noqa: ANN401
    """The first pose estimate of ndx-pose with three coordinates a point."""
    modules = _entry(h5, file, "processing")
    for module in [] if modules is None else [_entry(h5, modules, name) for name in modules]:
        for name in module if isinstance(module, h5.Group) else ():
            estimate = _entry(h5, module, name)
            if not isinstance(estimate, h5.Group):
                continue
            if _texts(estimate.attrs.get("neurodata_type", "")) != ("PoseEstimation",):
                continue
            series = {one: _entry(h5, estimate, one) for one in estimate}
            series = {one: place for one, place in series.items() if _entry(h5, place, "data") is not None}
            places = [np.asarray(_values(h5, place, "data"), dtype=np.float64) for place in series.values()]
            if not places or len({one.shape for one in places}) > 1:
                raise ValueError("points of different lengths")
            first = next(iter(series.values()))
            unit = _texts(first["data"].attrs.get("unit", ""))[0].lower()
            conversion = float(first["data"].attrs.get("conversion", 1.0))
            times = _values(h5, first, "timestamps")
            if times is None:
                start, begun = _entry(h5, first, "starting_time"), _values(h5, first, "starting_time")
                rate = float(start.attrs["rate"])
                times = float(begun) + np.arange(len(places[0])) / rate
            stacked = np.stack(places, axis=1) * conversion
            unit = UNIT_WORDS.get(unit, unit)
            known = unit if unit in MM_PER_UNIT else ""
            return _Tracks(tuple(series), np.asarray(times, dtype=np.float64), stacked, known, timed=True)
    return None


def _points_mat(path: Path) -> _Tracks:
    with foreign_file(
        path, TruthError, "a MATLAB file of points", "Save it as version 7: save(file, '-v7', …)."
    ):
        wanted = ["labelData", "skeleton", "pred", "data_3D", "framesToLabel"]
        content: Any = io.BytesIO(read_file(path, LARGEST, TruthError))
        variables = scipy.io.loadmat(content, simplify_cells=True, variable_names=wanted)
        if "labelData" in variables:
            labels = variables["labelData"]
            label = (
                labels if is_table(labels) else np.atleast_1d(np.asarray(labels, dtype=object)).tolist()[0]
            )
            if not is_table(label) or not {"data_3d", "data_frame"} <= set(label):
                raise ValueError("labelData without data_3d and data_frame")
            frames = np.array(label["data_frame"], dtype=np.float64).ravel()
            places = np.array(label["data_3d"], dtype=np.float64).reshape(len(frames), -1, 3)
            made = _Tracks((), frames, places)
        elif "data_3D" in variables and "framesToLabel" in variables:
            frames = np.array(variables["framesToLabel"], dtype=np.float64).ravel() - 1.0
            places = np.array(variables["data_3D"], dtype=np.float64).reshape(len(frames), -1, 3)
            made = _Tracks((), frames, places)
        elif "pred" in variables:
            places = np.array(variables["pred"], dtype=np.float64)
            if places.ndim != 3 or places.shape[1] != 3:
                raise ValueError(f"pred of shape {places.shape}, not rows, 3 and points")
            note = (f"'{path.name}' numbers no frames: its rows were counted from 0.",)
            rows = np.arange(len(places), dtype=np.float64)
            made = _Tracks((), rows, places.transpose(0, 2, 1), notes=note)
        else:
            raise TruthError(
                f"'{path.name}' holds no points of label3d (labelData, data_3D) or DANNCE (pred).",
                "Give the file with the labelled or predicted points.",
            )
        return replace(made, names=_names_of(variables.get("skeleton"), made.places.shape[1]))


def _names_of(skeleton: Any, count: int) -> tuple[str, ...]:  # noqa: ANN401
    """The names that label3d's skeleton gives, else numbers."""
    given = skeleton.get("joint_names") if is_table(skeleton) else None
    names = _texts(given) if given is not None else ()
    return names if len(names) == count else tuple(f"point{at}" for at in range(1, count + 1))
