"""Motion files of Acclaim: a skeleton (ASF) and the angles of its bones frame by frame (AMC).

A bone begins where its parent ends and turns about axes of its own (`axis`): turn = C M C^-1, C from the axis angles,
M from the frame's angles, both applied about fixed axes in the order written. Here every bone is a joint at its
beginning; ends without children become joints `..._end`. y is up, people face z.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from studio.body.motion_files.recorded_motion import (
    UP_FROM_Y_UP,
    RecordedMotion,
    at_line,
    moved_skeleton,
    numbers,
    text_lines,
)
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.geometry.rotations import axis_turn

INCH = 25.4
CMU_RATE = 120.0
ROOT = "root"
ROOT_ORDER = ["tx", "ty", "tz", "rx", "ry", "rz"]
REMEDY = "Correct the line, or fetch the file again."


@dataclass(slots=True)
class _Bone:
    """direction, length : of the bone in the rest pose, file units. axis : degrees and the order of their letters.
    angles : axis numbers of its degrees of freedom in order.
    """

    name: str
    direction: list[float] = field(default_factory=list[float])
    length: float = -1.0
    axis: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    order: str = "XYZ"
    angles: list[int] = field(default_factory=list[int])


@dataclass(slots=True)
class _Skeleton:
    """unit : mm a unit of length. parents : bone name to its parent's, in the file's order."""

    unit: float = INCH
    degrees: bool = True
    bones: dict[str, _Bone] = field(default_factory=dict[str, _Bone])
    parents: dict[str, str] = field(default_factory=dict[str, str])


def read_acclaim(motion: Path, skeleton: Path | None = None) -> RecordedMotion:
    """The motion in an AMC file on the skeleton of an ASF file.

    skeleton : by default the one beside it that is named after the subject ("05_01.amc": "05.asf") or the motion,
    upper case or lower. AMC files hold no rate; CMU's is 120. Raises StudioError naming file, line and remedy.
    """
    beside = skeleton or _skeleton_beside(motion)
    if not beside.is_file():
        raise StudioError(
            f"The skeleton of '{motion.name}', '{beside.name}', is missing.", "Name its ASF file."
        )
    tree = _read_skeleton(beside)
    root, angles = _read_frames(motion, tree)
    names, parents, offsets = _joints(beside, tree)
    local = np.tile(np.eye(3), (len(root), len(names), 1, 1))
    to_radians = np.pi / 180.0 if tree.degrees else 1.0
    local[:, 0] = _turns([0, 1, 2], to_radians * root[:, 3:])
    for index, name in enumerate(names[1:], start=1):
        bone = tree.bones.get(name)
        if bone is None or not bone.angles:
            continue
        frame = _turns(["XYZ".index(letter) for letter in bone.order], to_radians * np.array([bone.axis]))[0]
        local[:, index] = frame @ _turns(bone.angles, to_radians * angles[name]) @ frame.T
    return moved_skeleton(
        names,
        parents,
        offsets,
        local,
        root[:, :3],
        fps=CMU_RATE,
        source=motion.name,
        axes=UP_FROM_Y_UP,
        scale=tree.unit,
    )


def _skeleton_beside(motion: Path) -> Path:
    """The ASF beside an AMC: the subject's or the motion's own name, its ending in any case."""
    names = [f"{motion.stem.split('_')[0]}.asf", f"{motion.stem}.asf"]
    skeletons = {path.name.lower(): path for path in motion.parent.iterdir() if path.suffix.lower() == ".asf"}
    return next(
        (skeletons[name.lower()] for name in names if name.lower() in skeletons), motion.with_name(names[0])
    )


def _turns(axes: list[int], angles: Array) -> Array:
    """(F, 3, 3) turns about fixed axes one after the other; angles (F, len(axes)) radians."""
    turn = np.tile(np.eye(3), (len(angles), 1, 1))
    for column, axis in enumerate(axes):
        turn = axis_turn(axis, angles[:, column]) @ turn
    return turn


def _joints(path: Path, tree: _Skeleton) -> tuple[tuple[str, ...], tuple[int, ...], Array]:
    """Names, parents and offsets of the joints, parents first."""
    names, parents, offsets = [ROOT], [-1], [np.zeros(3)]
    ends = {ROOT: np.zeros(3)}
    for name, bone in tree.bones.items():
        ends[name] = bone.length * np.array(bone.direction)
    waiting = dict(tree.parents)
    while waiting:
        ready = [name for name, parent in waiting.items() if parent in names]
        if not ready:
            raise StudioError(
                f"'{path.name}': bone '{next(iter(waiting))}' does not hang on the root.",
                "Correct :hierarchy.",
            )
        for name in ready:
            parent = waiting.pop(name)
            parents.append(names.index(parent))
            names.append(name)
            offsets.append(ends[parent])
    for name in [name for name in names if name != ROOT and name not in tree.parents.values()]:
        parents.append(names.index(name))
        names.append(f"{name}_end")
        offsets.append(ends[name])
    return tuple(names), tuple(parents), np.array(offsets)


def _read_skeleton(path: Path) -> _Skeleton:
    tree, section, bone = _Skeleton(), "", None
    for line, text in enumerate(text_lines(path), start=1):
        words = text.split("#")[0].split()
        if not words:
            continue
        if words[0].startswith(":"):
            section = words[0]
        elif section == ":units":
            _unit(path, line, words, tree)
        elif section == ":root":
            _root(path, line, words)
        elif section == ":hierarchy":
            _parents(path, line, words, tree)
        elif section == ":bonedata" and words[0] == "begin":
            bone = _Bone("")
        elif section == ":bonedata" and words[0] == "end" and bone is not None:
            if not bone.name or not bone.direction or bone.length < 0.0:
                raise at_line(path, line, f"bone '{bone.name}' lacks name, direction or length", REMEDY)
            tree.bones[bone.name], bone = bone, None
        elif section == ":bonedata" and bone is not None:
            _entry(path, line, words, bone)
    missing = set(tree.bones) ^ set(tree.parents)
    if not tree.bones or missing:
        named = f"bone '{min(missing)}' is in only one of :bonedata and :hierarchy" if missing else "no bones"
        raise StudioError(f"'{path.name}': {named}.", "Give a complete ASF file.")
    return tree


def _unit(path: Path, line: int, words: list[str], tree: _Skeleton) -> None:
    if words[0] == "length":
        (length,) = numbers(path, line, words[1:2]) or [0.0]
        if length <= 0.0:
            raise at_line(path, line, f"a unit of length of {length:g} is not above 0", REMEDY)
        tree.unit = INCH / length
    elif words[0] == "angle":
        tree.degrees = words[1:] == ["deg"]


def _root(path: Path, line: int, words: list[str]) -> None:
    """CMU's root is written in one way; others are refused, not misread."""
    lower = [word.lower() for word in words[1:]]
    if words[0] == "order" and lower != ROOT_ORDER:
        raise at_line(
            path, line, f"the root's order is {' '.join(lower)}, not {' '.join(ROOT_ORDER)}", REMEDY
        )
    if words[0] == "axis" and lower != ["xyz"]:
        raise at_line(path, line, f"the root's axis is {' '.join(lower)}, not xyz", REMEDY)
    if words[0] in ("position", "orientation") and any(numbers(path, line, words[1:])):
        raise at_line(
            path, line, f"the root's {words[0]} is not 0 0 0", "Take a skeleton based at the origin."
        )


def _parents(path: Path, line: int, words: list[str], tree: _Skeleton) -> None:
    if words[0] in ("begin", "end"):
        return
    for word in words:
        if word != ROOT and word not in tree.bones:
            raise at_line(path, line, f"there is no bone '{word}'", "Correct :hierarchy or :bonedata.")
    for child in words[1:]:
        tree.parents[child] = words[0]


def _entry(path: Path, line: int, words: list[str], bone: _Bone) -> None:
    """One entry of a bone; limits, masses and the like are passed over."""
    head, rest = words[0], words[1:]
    if head == "name" and rest:
        bone.name = rest[0]
    elif head == "direction":
        bone.direction = _three(path, line, rest)
    elif head == "length":
        (bone.length,) = numbers(path, line, rest[:1]) or [-1.0]
    elif head == "axis":
        bone.axis, bone.order = _three(path, line, rest[:3]), "".join(rest[3:]).upper() or "XYZ"
        if sorted(bone.order) != list("XYZ"):
            raise at_line(path, line, f"'{bone.order}' is no order of axes", REMEDY)
    elif head == "dof":
        unknown = [word for word in rest if word.lower() not in ("rx", "ry", "rz")]
        if unknown:
            what = f"degree of freedom '{unknown[0]}' of bone '{bone.name}' is not rx, ry or rz"
            raise at_line(path, line, what, "Use a skeleton whose bones only rotate.")
        bone.angles = ["xyz".index(word[1].lower()) for word in rest]


def _three(path: Path, line: int, words: list[str]) -> list[float]:
    if len(words) != 3:
        raise at_line(path, line, f"{len(words)} numbers where 3 belong", REMEDY)
    return numbers(path, line, words)


def _read_frames(path: Path, tree: _Skeleton) -> tuple[Array, dict[str, Array]]:
    """(F, 6) of the root and of every turning bone (F, its angles), as in the file."""
    wanted = {ROOT: 6} | {bone.name: len(bone.angles) for bone in tree.bones.values() if bone.angles}
    frames: list[dict[str, list[float]]] = []
    for line, text in enumerate(text_lines(path), start=1):
        words = text.split("#")[0].split()
        if not words or words[0].startswith(":"):
            continue
        if len(words) == 1 and words[0].isdigit():
            _complete(path, line, frames, wanted)
            frames.append({})
        elif not frames:
            raise at_line(path, line, f"'{words[0]}' stands before the first frame", REMEDY)
        elif words[0] not in wanted:
            what = f"the skeleton has no turning bone '{words[0]}'"
            raise at_line(path, line, what, "Give the skeleton that belongs to the motion.")
        elif len(words) - 1 != wanted[words[0]]:
            what = f"bone '{words[0]}' has {len(words) - 1} numbers, not {wanted[words[0]]}"
            raise at_line(path, line, what, "Give the skeleton that belongs to the motion.")
        else:
            frames[-1][words[0]] = numbers(path, line, words[1:])
    if not frames:
        raise StudioError(f"'{path.name}' has no frames.", "Give an AMC file.")
    _complete(path, len(text_lines(path)), frames, wanted)
    return (
        np.array([frame[ROOT] for frame in frames]),
        {name: np.array([frame[name] for frame in frames]) for name in wanted if name != ROOT},
    )


def _complete(path: Path, line: int, frames: list[dict[str, list[float]]], wanted: dict[str, int]) -> None:
    missing = sorted(set(wanted) - set(frames[-1])) if frames else []
    if missing:
        raise at_line(path, line, f"frame {len(frames)} lacks bone '{missing[0]}'", REMEDY)
