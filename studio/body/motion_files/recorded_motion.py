"""Motion as it was recorded from a person: a tree of joints moving over time, whatever file it came from."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import foreign_file, read_foreign_text

UP_FROM_Y_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Files with y up and people facing z become z up, facing x: (x, y, z) -> (z, x, y), a proper rotation."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedMotion:
    """A recorded person, mm, z up, in the rest pose facing x with y to the left.

    names, parents : joints, parents before children, -1 at the root; ends of limbs count as joints. rest : (J, 3)
    places in the rest pose, in which every rotation is the identity. rotations : (F, J, 3, 3) what turned each
    joint's segment from the rest pose to where it is in the world. positions : (F, J, 3). source : the file's name.
    notes : where the file differs from what it announces, sentences.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    rest: Array
    rotations: Array
    positions: Array
    fps: float
    source: str
    notes: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """From the first frame to the last."""
        return (len(self.positions) - 1) / self.fps

    def index(self, name: str) -> int:
        """Number of the joint called `name`. Raises StudioError where there is none."""
        if name not in self.names:
            raise StudioError(
                f"'{self.source}' has no joint '{name}'.",
                f"Its joints are {', '.join(self.names[:8])}, ...; take a recording with that joint.",
            )
        return self.names.index(name)


def moved_skeleton(
    names: tuple[str, ...],
    parents: tuple[int, ...],
    offsets: Array,
    local: Array,
    root: Array,
    *,
    fps: float,
    source: str,
    axes: Array | None = None,
    scale: float = 1.0,
) -> RecordedMotion:
    """Forward kinematics of a joint tree.

    offsets : (J, 3) from the parent's place, in the parent's frame of the rest pose. local : (F, J, 3, 3) turns in
    the parent's frame. root : (F, 3) place of joint 0 (its offset does not count). axes : (3, 3) what takes the
    file's directions to ours, None where they agree. scale : mm a unit.
    """
    rest, rotations = np.zeros((len(names), 3)), np.zeros_like(local)
    positions = np.zeros((len(local), len(names), 3))
    for joint, parent in enumerate(parents):
        if parent < 0:
            rotations[:, joint], positions[:, joint] = local[:, joint], root
            continue
        rest[joint] = rest[parent] + offsets[joint]
        rotations[:, joint] = rotations[:, parent] @ local[:, joint]
        positions[:, joint] = positions[:, parent] + rotations[:, parent] @ offsets[joint]
    turn = np.eye(3) if axes is None else axes
    return RecordedMotion(
        names=names,
        parents=parents,
        rest=scale * rest @ turn.T,
        rotations=turn @ rotations @ turn.T,
        positions=scale * positions @ turn.T,
        fps=fps,
        source=source,
    )


def followed(parents: Sequence[int], moves: Array, turns: Array) -> tuple[Array, Array]:
    """World places (N, J, 3) and turns (N, J, 3, 3) of joints that are moved and turned in their parents' frames, as
    every reader of a file of joints does it. parents : before their children, -1 at a root.
    """
    places, turned = np.zeros_like(moves), np.zeros_like(turns)
    for joint, parent in enumerate(parents):
        if parent < 0:
            places[:, joint], turned[:, joint] = moves[:, joint], turns[:, joint]
        else:
            step = (turned[:, parent] @ moves[:, joint][..., None])[..., 0]
            places[:, joint] = places[:, parent] + step
            turned[:, joint] = turned[:, parent] @ turns[:, joint]
    return places, turned


def at_line(path: Path, line: int, what: str, remedy: str) -> StudioError:
    """An error in a line of a text file (counted from 1)."""
    return StudioError(f"'{path.name}', line {line}: {what}.", remedy)


def text_lines(path: Path) -> list[str]:
    """The lines of a motion file. Raises StudioError where it cannot be read or is no text."""
    with foreign_file(path, StudioError, "a text file", "Give a motion file as text."):
        return read_foreign_text(path).splitlines()


def numbers(path: Path, line: int, words: list[str]) -> list[float]:
    """Words as finite numbers, with a decimal point or comma. Raises StudioError naming file, line and word."""
    values: list[float] = []
    for word in words:
        try:
            value = float(word.replace(",", ".") if "." not in word else word)
        except ValueError:
            value = float("nan")
        if not math.isfinite(value):
            raise at_line(
                path, line, f"'{word}' is not a number", "Correct the line, or fetch the file again."
            )
        values.append(value)
    return values
