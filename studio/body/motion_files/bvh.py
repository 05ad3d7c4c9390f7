"""Motion files in Biovision's BVH: a hierarchy of joints with offsets and channels, then a row of numbers a frame.

What programs write differently is read as it is meant: blanks in names, six channels on every joint where no joint
leaves its offset, another number of frames than is announced (`notes`), blank lines, upper-case endings and any text
encoding. Unknown input is refused with its line. `read_bvh_file` gives the file's content in its own unit and
axes. As a recording (`read_bvh`) the rest pose is that of all angles zero, y up and facing z, as in the CMU
clips, and only the root may move. BVH names no unit; the CMU clips' is 25.4 / 0.45 mm.
"""

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studio.body.motion_files.recorded_motion import (
    UP_FROM_Y_UP,
    RecordedMotion,
    at_line,
    followed,
    moved_skeleton,
    numbers,
    text_lines,
)
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.geometry.rotations import axis_turn

CMU_UNIT = 25.4 / 0.45
CHANNELS = {f"{axis}{kind}": (kind, "XYZ".index(axis)) for axis in "XYZ" for kind in ("position", "rotation")}
STRETCH = 0.01
"""Bones whose ends move by less than this share of the longest offset keep their length: numbers are rounded."""
REMEDY = "Correct the line, or export the file again."


@dataclass(frozen=True, slots=True, eq=False)
class BvhFile:
    """A file's content, in its unit and axes.

    names, parents : joints in the file's order, end sites named after their parent with `_end`; is_end : (J,) which
    those are. offsets : (J, 3). moves : (F, J, 3) position channels, 0 where there is none; moved : (J, 3) where there
    is one. turns : (F, J, 3, 3) in the parent's frame. notes : where it differs from what it announces, sentences.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    is_end: NDArray[np.bool_]
    offsets: Array
    moves: Array
    moved: NDArray[np.bool_]
    turns: Array
    fps: float
    notes: tuple[str, ...] = ()

    def followed(self) -> tuple[Array, Array]:
        """Places (F, J, 3) and turns (F, J, 3, 3) of the joints in the file's world, without end sites. A position
        channel stands in the offset's place, as Blender reads it.
        """
        moves = np.where(self.moved, self.moves, self.offsets)
        places, turned = followed(self.parents, moves, self.turns)
        return places[:, ~self.is_end], turned[:, ~self.is_end]


@dataclass(slots=True)
class _Hierarchy:
    """The hierarchy of a file. channels : of each joint the words after their number."""

    names: list[str] = field(default_factory=list[str])
    parents: list[int] = field(default_factory=list[int])
    is_end: list[bool] = field(default_factory=list[bool])
    offsets: list[list[float]] = field(default_factory=list[list[float]])
    channels: list[list[str]] = field(default_factory=list[list[str]])


def read_bvh(path: Path, unit_mm: float = CMU_UNIT) -> RecordedMotion:
    """The motion in a BVH file; end sites become joints. A position channel of the root adds to its offset.

    Raises StudioError naming file, line and remedy.
    """
    content = read_bvh_file(path)
    offsets = _fixed_offsets(path, content)
    motion = moved_skeleton(
        content.names,
        content.parents,
        offsets,
        content.turns,
        content.offsets[0] + content.moves[:, 0],
        fps=content.fps,
        source=path.name,
        axes=UP_FROM_Y_UP,
        scale=unit_mm,
    )
    return replace(motion, notes=content.notes)


def _fixed_offsets(path: Path, content: BvhFile) -> Array:
    """(J, 3) the offsets of joints that keep their distance. Position channels stand in the offset's place (Blender,
    MotionBuilder); some programs write what is added to it, zeros throughout. Raises StudioError for bones that
    stretch.
    """
    offsets = content.offsets.copy()
    reach = max(1.0, float(np.abs(content.offsets).max()))
    for joint in range(1, len(content.names)):
        axes = content.moved[joint]
        if not axes.any():
            continue
        places = content.moves[:, joint, axes]
        middle = np.median(places, axis=0)
        if np.abs(places - middle).max() > STRETCH * reach:
            raise StudioError(
                f"'{path.name}': the position channels of joint '{content.names[joint]}' move it by up to"
                f" {float(np.abs(places - middle).max()):.3g} against its parent: its bone stretches.",
                "Export with fixed bone lengths.",
            )
        if np.abs(middle).max() > STRETCH * reach:
            offsets[joint, axes] = middle
    return offsets


def read_bvh_file(path: Path) -> BvhFile:
    """The joints and their motion as they are written. Raises StudioError naming file, line and remedy."""
    lines = text_lines(path)
    hierarchy, at = _read_hierarchy(path, lines)
    fps, rows, notes = _read_rows(path, lines, at, sum(map(len, hierarchy.channels)))
    count = len(hierarchy.names)
    turns = np.tile(np.eye(3), (len(rows), count, 1, 1))
    moves, moved = np.zeros((len(rows), count, 3)), np.zeros((count, 3), dtype=np.bool_)
    column = 0
    for joint, channels in enumerate(hierarchy.channels):
        for channel in channels:
            kind, axis = CHANNELS[channel]
            values = rows[:, column]
            column += 1
            if kind == "rotation":
                turns[:, joint] = turns[:, joint] @ axis_turn(axis, np.radians(values))
            else:
                moves[:, joint, axis] += values
                moved[joint, axis] = True
    return BvhFile(
        tuple(hierarchy.names),
        tuple(hierarchy.parents),
        np.array(hierarchy.is_end),
        np.array(hierarchy.offsets),
        moves,
        moved,
        turns,
        fps,
        notes,
    )


def _read_hierarchy(path: Path, lines: list[str]) -> tuple[_Hierarchy, int]:
    """The joints, and the number of the line "MOTION" (from 0)."""
    hierarchy, open_joints, pending, is_end = _Hierarchy(), list[int](), "", False
    for index, text in _pieces(lines):
        words = text.split()
        head, line = (words[0] if words else ""), index + 1
        if head == "MOTION":
            if open_joints or not hierarchy.names:
                raise at_line(path, line, "the hierarchy is not complete before MOTION", REMEDY)
            return hierarchy, index
        if head in ("ROOT", "JOINT", "End"):
            if (head == "ROOT") != (not hierarchy.names) or len(words) < 2:
                raise at_line(path, line, f"'{text.strip()}' does not belong here", REMEDY)
            is_end = head == "End"
            pending = (
                _free_name(f"{hierarchy.names[open_joints[-1]]}_end", hierarchy.names)
                if is_end
                else " ".join(words[1:])
            )
        elif head == "{" and pending:
            if pending in hierarchy.names:
                raise at_line(path, line, f"there is a second joint '{pending}'", "Rename one of them.")
            hierarchy.parents.append(open_joints[-1] if open_joints else -1)
            open_joints.append(len(hierarchy.names))
            hierarchy.names.append(pending)
            hierarchy.is_end.append(is_end)
            hierarchy.offsets.append([])
            hierarchy.channels.append([])
            pending = ""
        elif head == "}" and open_joints:
            if not hierarchy.offsets[open_joints[-1]]:
                raise at_line(path, line, f"joint '{hierarchy.names[open_joints[-1]]}' has no OFFSET", REMEDY)
            open_joints.pop()
        elif head == "OFFSET" and open_joints and len(words) == 4:
            hierarchy.offsets[open_joints[-1]] = numbers(path, line, words[1:])
        elif head == "CHANNELS" and open_joints:
            hierarchy.channels[open_joints[-1]] = _channels(path, line, words)
        elif head not in ("HIERARCHY", ""):
            raise at_line(path, line, f"'{text.strip()[:40]}' is not understood", REMEDY)
    raise StudioError(f"'{path.name}' has no MOTION.", "Give a BVH file with its frames.")


def _pieces(lines: list[str]) -> Iterator[tuple[int, str]]:
    """Lines with their numbers (from 0), braces apart from what stands beside them."""
    for index, text in enumerate(lines):
        for piece in re.findall(r"[{}]|[^{}]+", text):
            yield index, piece


def _free_name(name: str, taken: list[str]) -> str:
    """`name`, or with the first number behind it that makes it another than those `taken`."""
    numbered = (f"{name}_{number}" for number in itertools.count(2))
    return name if name not in taken else next(one for one in numbered if one not in taken)


def _channels(path: Path, line: int, words: list[str]) -> list[str]:
    names = [word.capitalize() for word in words[2:]]
    if len(words) < 2 or words[1] != str(len(names)) or not set(names) <= set(CHANNELS):
        raise at_line(path, line, "the channels do not match their number, or one is unknown", REMEDY)
    return names


def _read_rows(path: Path, lines: list[str], at: int, width: int) -> tuple[float, Array, tuple[str, ...]]:
    """Frames a second, (F, width) channel values, and a sentence where another number of frames is announced."""
    written = [number for number in range(at + 1, len(lines)) if lines[number].strip()][:2]
    first, second = (*written, *[len(lines)] * 2)[:2]
    counted, timed = (
        lines[number].replace(":", ": ").split() if number < len(lines) else [] for number in (first, second)
    )
    if len(counted) != 2 or counted[0].lower() != "frames:" or not counted[1].isdigit():
        raise at_line(path, first + 1, "'Frames:' and their number must follow MOTION", REMEDY)
    if len(timed) != 3 or [word.lower() for word in timed[:2]] != ["frame", "time:"]:
        raise at_line(path, second + 1, "'Frame Time:' and the seconds must follow", REMEDY)
    (step,) = numbers(path, second + 1, timed[2:])
    if not 1e-4 <= step <= 1.0:
        raise at_line(path, second + 1, f"a frame time of {step:g} s is not 0.0001 to 1", REMEDY)
    rows: list[list[float]] = []
    for index in range(second + 1, len(lines)):
        words = lines[index].split()
        if words and len(words) != width:
            what = f"a frame has {len(words)} numbers, the hierarchy {width} channels"
            raise at_line(path, index + 1, what, REMEDY)
        if words:
            rows.append(numbers(path, index + 1, words))
    announced = int(counted[1])
    words = f"{announced} frames are announced, {len(rows)} follow"
    # Programs are a frame off in what they announce; a file that was cut lacks many.
    if not rows or announced - len(rows) > max(1, announced // 100):
        raise at_line(path, first + 1, words, "The file was cut short: fetch it again.")
    notes = (f"'{path.name}': {words}, and are taken.",) if announced != len(rows) else ()
    return _rate(1.0 / step), np.array(rows), notes


def _rate(fps: float) -> float:
    """A rate whose frame time was rounded to seven digits: .0083333 s is 120 frames a second."""
    return float(round(fps)) if abs(fps - round(fps)) < 1e-3 * fps / 10.0 else fps
