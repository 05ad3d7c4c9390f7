"""Reading a BVH that the studio wrote: enough of the format to check every number of it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studio.errors import ExportError
from studio.geometry.rotations import axis_turn

Array = NDArray[np.float64]

AXES = "XYZ"


@dataclass(frozen=True, slots=True, eq=False)
class BvhFile:
    """Joints in the order of the file. moves (N, J, 3), turns (N, J, 3, 3) in the parent's frame, in the file's unit
    and axes. step : seconds a frame.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    moves: Array
    turns: Array
    step: float

    def followed(self) -> tuple[Array, Array]:
        """Places (N, J, 3) and turns (N, J, 3, 3) of the joints in the file's world."""
        places, turned = self.moves.copy(), self.turns.copy()
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                turned[:, joint] = turned[:, parent] @ self.turns[:, joint]
                step = (turned[:, parent] @ self.moves[:, joint][..., None])[..., 0]
                places[:, joint] = places[:, parent] + step
        return places, turned


def read_bvh(path: Path) -> BvhFile:
    """The joints and their motion. Raises ExportError where the file is not complete."""
    words = path.read_text(encoding="ascii").split("MOTION")
    if len(words) != 2:
        raise ExportError(f"'{path.name}' has no motion.", "Export it again.")
    names, parents, offsets, channels = _joints(words[0].split())
    lines = words[1].strip().splitlines()
    count, step = int(lines[0].split()[1]), float(lines[1].split()[2])
    table = np.array([[float(word) for word in line.split()] for line in lines[2:]])
    if table.shape != (count, sum(map(len, channels))):
        raise ExportError(
            f"'{path.name}' announces {count} frames and holds a table of {table.shape}.", "Export it again."
        )
    moves = np.broadcast_to(np.array(offsets), (count, len(names), 3)).copy()
    turns = np.broadcast_to(np.eye(3), (count, len(names), 3, 3)).copy()
    column = 0
    for joint, kinds in enumerate(channels):
        for kind in kinds:
            axis, values = AXES.index(kind[0]), table[:, column]
            column += 1
            if kind.endswith("position"):
                moves[:, joint, axis] = values
            else:
                turns[:, joint] = turns[:, joint] @ axis_turn(axis, np.radians(values))
    return BvhFile(tuple(names), tuple(parents), moves, turns, step)


def _joints(words: list[str]) -> tuple[list[str], list[int], list[list[float]], list[list[str]]]:
    """Names, parents, offsets and channels of the joints; end sites are passed over."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[list[str]] = []
    open_joints: list[int] = []
    at = 0
    while at < len(words):
        word = words[at]
        if word in ("ROOT", "JOINT"):
            parents.append(open_joints[-1] if open_joints else -1)
            open_joints.append(len(names))
            names.append(words[at + 1])
        elif word == "End":
            open_joints.append(-1)
        elif word == "OFFSET" and open_joints[-1] >= 0:
            offsets.append([float(number) for number in words[at + 1 : at + 4]])
        elif word == "CHANNELS":
            channels.append(words[at + 2 : at + 2 + int(words[at + 1])])
        elif word == "}":
            open_joints.pop()
        at += 1
    return names, parents, offsets, channels
