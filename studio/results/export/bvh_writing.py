"""Biovision's BVH: the skeleton in its rest pose with offsets, then a row of channels a frame.

The root has three positions and three rotations, every other joint three rotations (a joint that also moves has
positions too). BVH names no unit: the file is in metres unless another one is requested, which Blender takes as they
are. What a frame has no pose for is interpolated: BVH cannot say "missing".
"""

import warnings
from typing import Literal, cast

import numpy as np
from scipy.spatial.transform import Rotation

from studio.body.motion_files.bvh import read_bvh_file
from studio.body.motion_files.recorded_motion import followed
from studio.foundations.arrays import Array
from studio.results.export.naming import joint_names
from studio.results.export.options import Axes
from studio.results.export.skeleton import Skeleton, skeleton_of
from studio.results.export.task import INTERPOLATED, ExportTask, Written, agreed, apart, turned_apart

DECIMALS = {"mm": 4, "cm": 5, "m": 7}
END_SITE = "End Site"
ROWS_A_STEP = 500
Order = Literal["ZXY", "ZYX", "XYZ", "XZY", "YXZ", "YZX"]
"""Of rotation channels, as `ExportOptions.euler` allows them."""


def write_bvh(task: ExportTask) -> Written:
    """Write the motion as BVH and read it back. Raises ExportError where it differs."""
    motion, axes = task.motion, task.axes
    skeleton = skeleton_of(motion.body, task.options.rest)
    names, note = joint_names(skeleton.names, task.options.names)
    moves, turns = skeleton.animated(motion.poses)
    order = cast("Order", task.options.euler)
    angles = smooth_angles(axes.turns(turns), order)
    with task.place.open("w", encoding="ascii", errors="replace", newline="\n") as stream:
        stream.write("\n".join(_hierarchy(skeleton, names, axes, order)))
        stream.write(f"\nMOTION\nFrames: {len(moves)}\nFrame Time: {1.0 / motion.fps:.9f}\n")
        ordered = _depth_first(skeleton.tree.parents)
        still = [not skeleton.tree.moving[joint] for joint in ordered]
        for row, places in enumerate(axes.points(moves)):
            if row % ROWS_A_STEP == 0:
                task.step("writing", row, len(moves))
            stream.write(_row(ordered, still, places, angles[row], DECIMALS[axes.unit]) + "\n")
    task.step("reading back", len(moves), len(moves))
    checked = _read_back(task, skeleton, followed(skeleton.tree.parents, moves, turns))
    notes = [
        f"Rest pose: {skeleton.kind}; lengths in {axes.unit}, {axes.up.upper()} up, rotations {order}.",
        *task.gaps_in_words(INTERPOLATED),
        *([note] if note else []),
    ]
    return Written((task.place,), checked, tuple(notes))


def smooth_angles(turns: Array, order: Order) -> Array:
    """(K, J, 3) degrees of rotations (K, J, 3, 3) in an order of axes, without needless jumps from row to row.

    Of the two Euler triples of a rotation, plus whole turns, the one nearest the row before is taken.
    """
    shape = turns.shape[:2]
    with warnings.catch_warnings():
        # At gimbal lock one of the angles is free; scipy says so and sets it to zero, which is a valid triple.
        warnings.simplefilter("ignore", UserWarning)
        turned = Rotation.from_matrix(turns.reshape(-1, 3, 3))
        first = turned.as_euler(order).reshape(*shape, 3)
    other = np.stack([first[..., 0] + np.pi, np.pi - first[..., 1], first[..., 2] + np.pi], axis=-1)
    chosen = first.copy()
    for row in range(1, len(first)):
        near: list[Array] = [
            entry - 2.0 * np.pi * np.round((entry - chosen[row - 1]) / (2.0 * np.pi))
            for entry in (first[row], other[row])
        ]
        steps = [np.abs(entry - chosen[row - 1]).sum(axis=-1, keepdims=True) for entry in near]
        chosen[row] = np.where(steps[0] <= steps[1], near[0], near[1])
    return np.degrees(chosen)


def _hierarchy(skeleton: Skeleton, names: tuple[str, ...], axes: Axes, order: str) -> list[str]:
    children: dict[int, list[int]] = {}
    for joint, parent in enumerate(skeleton.tree.parents):
        children.setdefault(parent, []).append(joint)
    lines = ["HIERARCHY"]
    # Joints in the order in which their channels follow each other: depth first.
    stack: list[tuple[int, int]] = [(joint, 0) for joint in reversed(children[-1])]
    while stack:
        joint, depth = stack.pop()
        pad = "\t" * depth
        if joint < 0:
            lines.append(f"{pad}}}")
            continue
        lines += [f"{pad}{'JOINT' if depth else 'ROOT'} {names[joint].replace(' ', '_')}", f"{pad}{{"]
        lines += [
            f"{pad}\t{_offset(skeleton.offsets[joint], axes)}",
            f"{pad}\t{_channels(skeleton, joint, order)}",
        ]
        end = skeleton.ends[joint]
        if end is not None:
            lines += [f"{pad}\t{END_SITE}", f"{pad}\t{{", f"{pad}\t\t{_offset(end, axes)}", f"{pad}\t}}"]
        stack.append((-1, depth))
        stack += [(child, depth + 1) for child in reversed(children.get(joint, []))]
    return lines


def _offset(offset: Array, axes: Axes) -> str:
    return "OFFSET " + " ".join(f"{value:.{DECIMALS[axes.unit]}f}" for value in axes.points(offset) + 0.0)


def _channels(skeleton: Skeleton, joint: int, order: str) -> str:
    turns = " ".join(f"{axis}rotation" for axis in order)
    if not skeleton.tree.moving[joint]:
        return f"CHANNELS 3 {turns}"
    return f"CHANNELS 6 Xposition Yposition Zposition {turns}"


def _depth_first(parents: tuple[int, ...]) -> list[int]:
    ordered: list[int] = []
    stack = [joint for joint, parent in reversed(list(enumerate(parents))) if parent < 0]
    while stack:
        joint = stack.pop()
        ordered.append(joint)
        stack += [child for child, parent in reversed(list(enumerate(parents))) if parent == joint]
    return ordered


def _row(ordered: list[int], still: list[bool], places: Array, angles: Array, decimals: int) -> str:
    words: list[str] = []
    for joint, stays in zip(ordered, still, strict=True):
        if not stays:
            words += [f"{value:.{decimals}f}" for value in places[joint] + 0.0]
        words += [f"{value:.6f}" for value in angles[joint] + 0.0]
    return " ".join(words)


def _read_back(task: ExportTask, skeleton: Skeleton, wanted: tuple[Array, Array]) -> str:
    read = read_bvh_file(task.place)
    order = [_depth_first(skeleton.tree.parents).index(joint) for joint in range(len(skeleton.names))]
    places, turns = read.followed()
    points = task.axes.points_back(places[:, order])
    turned = task.axes.turns_back(turns[:, order])
    return agreed(task.place, apart(points, wanted[0]), turned_apart(turned, wanted[1]))
