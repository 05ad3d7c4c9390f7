"""A set of problems in one file: arrays in a zip archive (NumPy's, no pickles), the rest as JSON inside it.

Problems of one frame share its maps: arrays of frame F are `F.V.mask`, `F.V.edges` (of view V), those of problem P are
`P/start` and so on. The bundled set, `problems.npz` beside this module, is made by `python -m studio.garden.arena_set`.
"""

import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import read_archive
from studio.foundations.foreign_files import foreign_file
from studio.foundations.geometry.camera import Camera
from studio.foundations.typed_decoding import decode_json
from studio.results.arena.problem import (
    EASY,
    HARD,
    ArenaError,
    Definition,
    FrameMaps,
    KnownBest,
    Prior,
    ViewMaps,
)
from studio.sessions.atomic_files import write_bytes
from studio.sessions.names import is_name

KIND, VERSION = "studio arena problems", 1
LARGEST_SET = 20_000_000
"""Bytes of a written set."""
SUFFIX = ".npz"
BUNDLED = Path(__file__).with_name("problems.npz")
MOST_PROBLEMS, MOST_VIEWS = 100, 64
CAMERA_PARTS = {"matrix": (3, 3), "distortion": (5,), "rotation": (3, 3), "translation": (3,)}
REMEDY = "Export it again with `studio arena export`."

Arrays = Mapping[str, NDArray[Any]]


class _Camera(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    name: str
    width: int
    height: int
    quarter_turns: int = 0


class _Frame(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    number: int
    body_name: str
    body: str
    cameras: tuple[_Camera, ...]
    weighting: str
    knobs: dict[str, bool | int | float | str]


class _Problem(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """best, evaluations, hash : of the heaviest known pose. frame : number of its maps in the file."""

    name: str
    kind: str
    about: str
    frame: int
    microseconds: float
    best: float
    evaluations: int
    hash: str


class _Head(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    kind: str
    version: int
    frames: tuple[_Frame, ...]
    problems: tuple[_Problem, ...]


def write_problems(definitions: Sequence[Definition], path: Path) -> Path:
    """Write a set; returns the file. Raises ArenaError for problems without a known best, names that are not unique,
    and more than LARGEST_SET bytes; SessionError where it cannot be written.
    """
    if path.suffix != SUFFIX:
        raise ArenaError(f"'{path.name}' does not end in {SUFFIX}.", f"Call it {path.stem}{SUFFIX}.")
    names = [one.name for one in definitions]
    if not names or len(set(names)) < len(names) or not all(map(is_name, names)):
        raise ArenaError(
            "A set needs problems, each with its own name of letters, digits, - and _.", "Rename them."
        )
    maps = list(dict.fromkeys(one.maps for one in definitions))
    arrays = dict[str, NDArray[Any]]()
    for number, frame in enumerate(maps):
        arrays |= _arrays_of_frame(str(number), frame)
    problems = list[_Problem]()
    for one in definitions:
        best = one.best
        if best is None:
            raise ArenaError(f"Problem '{one.name}' has no known best.", "Search it for long first.")
        arrays |= {f"{one.name}/{part}": array for part, array in _arrays_of_problem(one, best).items()}
        problems.append(
            _Problem(
                one.name,
                one.kind,
                one.about,
                maps.index(one.maps),
                one.microseconds,
                best.log_weight,
                best.evaluations,
                best.hash,
            )
        )
    head = _Head(KIND, VERSION, tuple(map(_frame, maps)), tuple(problems))
    stream = io.BytesIO()
    # NumPy's stub takes a keyword for its own option.
    given: dict[str, Any] = {"head": np.frombuffer(msgspec.json.encode(head), np.uint8), **arrays}
    np.savez_compressed(stream, **given)
    content = stream.getvalue()
    if len(content) > LARGEST_SET:
        raise ArenaError(
            f"The set takes {len(content) / 1e6:.0f} MB, more than {LARGEST_SET // 1_000_000}.",
            "Export fewer frames.",
        )
    write_bytes(path, content)
    return path


def read_problems(path: Path) -> tuple[Definition, ...]:
    """The problems in a file. Raises ArenaError for one that is missing, damaged, or was changed since it was made."""
    with foreign_file(path, ArenaError, "a set of arena problems", REMEDY):
        arrays = read_archive(path)
        head = decode_json(arrays["head"].tobytes(), _Head)
        if head.kind != KIND or head.version != VERSION:
            raise ValueError(f"kind '{head.kind[:40]}', version {head.version}")
        if not 1 <= len(head.problems) <= MOST_PROBLEMS:
            raise ValueError(f"{len(head.problems)} problems")
        maps = [_maps(str(number), one, arrays) for number, one in enumerate(head.frames)]
        definitions = tuple(_definition(one, maps, arrays) for one in head.problems)
    for one in definitions:
        best = one.best
        assert best is not None
        if one.hash_of(best.pose, best.log_weight) != best.hash:
            raise ArenaError(
                f"Problem '{one.name}' of '{path.name}' is not what it was made as: its hash differs.", REMEDY
            )
    return definitions


def _frame(maps: FrameMaps) -> _Frame:
    cameras = tuple(_Camera(one.name, one.width, one.height, one.quarter_turns) for one in maps.cameras)
    return _Frame(maps.number, maps.body_name, maps.body, cameras, maps.weighting, dict(maps.knobs))


def _arrays_of_frame(name: str, maps: FrameMaps) -> dict[str, NDArray[Any]]:
    arrays = dict[str, NDArray[Any]]()
    for at, (camera, view) in enumerate(zip(maps.cameras, maps.views, strict=True)):
        parts = {part: getattr(camera, part) for part in CAMERA_PARTS}
        parts |= {"mask": view.mask, "edges": view.edges}
        parts |= {} if view.unknown is None else {"hidden": view.unknown}
        arrays |= {f"{name}.{at}.{part}": np.ascontiguousarray(array) for part, array in parts.items()}
    return arrays


def _arrays_of_problem(one: Definition, best: KnownBest) -> dict[str, NDArray[Any]]:
    prior = one.prior
    parts = {
        "free": one.free,
        "held": one.held,
        "lower": one.lower,
        "upper": one.upper,
        "best": best.pose,
        "start": prior.start,
        "sigma": prior.sigma,
        "poses": prior.poses,
        "log_weights": prior.log_weights,
        "estimate": prior.estimate,
        "previous": prior.previous,
    }
    return {part: np.ascontiguousarray(array) for part, array in parts.items() if array is not None}


def _maps(name: str, one: _Frame, arrays: Arrays) -> FrameMaps:
    """The maps of a frame. Raises ValueError, KeyError where they do not fit the cameras."""
    if not 1 <= len(one.cameras) <= MOST_VIEWS:
        raise ValueError(f"a frame of {len(one.cameras)} cameras")
    cameras, views = list[Camera](), list[ViewMaps]()
    for at, entry in enumerate(one.cameras):
        numbers = [_numbers(arrays, f"{name}.{at}.{part}", shape) for part, shape in CAMERA_PARTS.items()]
        matrix, distortion, rotation, translation = numbers
        size = entry.width, entry.height
        cameras.append(
            Camera(entry.name, *size, matrix, distortion, rotation, translation, entry.quarter_turns)
        )
        pictures = {part: arrays.get(f"{name}.{at}.{part}") for part in ("mask", "edges", "hidden")}
        for part, picture in pictures.items():
            if picture is None and part == "hidden":
                continue
            fits = picture is not None and picture.shape == (entry.height, entry.width)
            if picture is None or not fits or picture.dtype != np.uint8:
                raise ValueError(f"{part} of camera '{entry.name}' is not {entry.width} × {entry.height}")
        views.append(ViewMaps(arrays[f"{name}.{at}.mask"], arrays[f"{name}.{at}.edges"], pictures["hidden"]))
    return FrameMaps(
        one.number, one.body_name, one.body, tuple(cameras), tuple(views), one.weighting, one.knobs
    )


def _definition(one: _Problem, maps: Sequence[FrameMaps], arrays: Arrays) -> Definition:
    """A problem. Raises ValueError, KeyError, IndexError where its parts do not fit."""
    if one.kind not in (EASY, HARD) or not is_name(one.name) or not 0 <= one.frame < len(maps):
        raise ValueError(f"problem '{one.name[:40]}'")
    own = maps[one.frame]
    whole = len(own.model.parameters)

    def part(name: str, *shape: int | None) -> NDArray[np.float64]:
        return _numbers(arrays, f"{one.name}/{name}", shape)

    free = arrays[f"{one.name}/free"].astype(np.int64)
    size = len(free)
    if free.shape != (size,) or not size or np.any(np.diff(free) <= 0) or free[0] < 0 or free[-1] >= whole:
        raise ValueError(f"the parameters of problem '{one.name}'")
    poses = part("poses", None, size)
    last = [part(name, size) if f"{one.name}/{name}" in arrays else None for name in ("estimate", "previous")]
    prior = Prior(
        part("start", size), part("sigma", size), poses, part("log_weights", len(poses)), last[0], last[1]
    )
    best = KnownBest(part("best", size), one.best, one.evaluations, one.hash)
    lower, upper = part("lower", size), part("upper", size)
    within = _is_within((best.pose, prior.start), lower, upper)
    if not len(poses) or np.any(prior.sigma < 0.0) or not np.any(prior.sigma > 0.0) or not within:
        raise ValueError(f"the prior of problem '{one.name}'")
    return Definition(
        one.name,
        one.kind,
        one.about,
        own,
        free,
        part("held", whole),
        lower,
        upper,
        prior,
        best,
        one.microseconds,
    )


def _is_within(
    poses: Iterable[NDArray[np.float64]], lower: NDArray[np.float64], upper: NDArray[np.float64]
) -> bool:
    return all(bool(np.all((lower <= pose) & (pose <= upper))) for pose in poses)


def _numbers(arrays: Arrays, name: str, shape: Sequence[int | None]) -> NDArray[np.float64]:
    """An array of finite numbers. shape : None where any length will do."""
    array = arrays[name]
    fits = array.ndim == len(shape) and all(
        wanted in (None, length) for wanted, length in zip(shape, array.shape, strict=True)
    )
    if not fits or array.dtype.kind != "f" or not np.all(np.isfinite(array)):
        raise ValueError(f"'{name}' of shape {array.shape}")
    return array.astype(np.float64)
