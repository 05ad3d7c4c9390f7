"""A clothed person who moves as a tracked body: what its twin's pictures show.

The person is the renderer's own (`drawing_footage.flesh`), with the body's bones: its surface is nobody's cones, so
that what comes of cones that do not fit is in the errors of whoever tracks it.
"""

import numpy as np

from studio.body.forward_kinematics import joint_frames, marker_points
from studio.body.model import BodyModel
from studio.body.person import MARKERS, SIDES, PersonMotion
from studio.foundations.arrays import Array
from studio.foundations.geometry.rotations import frames_along
from studio.runs.learning.targets import POINTING, of_poses, skeleton_of_body

BEGINS = {"upper_arm": "Shoulder", "forearm": "Elbow", "thigh": "Hip", "shin": "Knee"}
"""The marker at which each segment of a side begins; its joint turns the segment."""
ENDS = {"upper_arm": "Elbow", "forearm": "Wrist", "thigh": "Knee", "shin": "Ankle"}


def is_person(body: BodyModel) -> bool:
    """Whether a body has the markers that a person's bones are taken from."""
    return set(MARKERS) <= {marker.name for marker in body.markers} and not body.meshes


def person_of_poses(body: BodyModel, poses: Array, fps: float) -> PersonMotion:
    """The person whose joints are where the body's markers are in poses (F, D)."""
    with_rest = np.concatenate([body.neutral[None], poses])
    names, skeleton = tuple(marker.name for marker in body.markers), skeleton_of_body(body)
    places, pointing = marker_points(body, with_rest), of_poses(body, with_rest).directions
    points = {name: places[:, names.index(name)] for name in MARKERS}
    trunk = points["Neck"] - points["Hip"]
    hips, shoulders = points["LHip"] - points["RHip"], points["LShoulder"] - points["RShoulder"]
    turns = {"pelvis": _frames_across(hips, trunk), "thorax": frames_along(trunk, shoulders)}
    head = points["Head"] - points["Neck"]
    facing = pointing.get("head")
    turns["head"] = frames_along(head, shoulders if facing is None else np.cross(head, facing))
    frames = joint_frames(body, with_rest)
    joints = {marker.name: marker.joint for marker in body.markers}
    for index, side in enumerate(SIDES):
        letter = side[0].upper()
        shoulder = points[f"{letter}Shoulder"] - points["Neck"]
        offset = _rest_shoulder(skeleton.shoulder[index], side)
        turns[f"{side}_clavicle"] = _turned_to(turns["thorax"], offset, shoulder)
        for segment, begin in BEGINS.items():
            along = points[f"{letter}{begin}"] - points[f"{letter}{ENDS[segment]}"]
            turned = frames[:, joints[f"{letter}{begin}"], :, :3]
            rest_left = turned[0].T @ (shoulders[0] / np.linalg.norm(shoulders[0]))
            turns[f"{side}_{segment}"] = frames_along(along, turned @ rest_left)
        for tip, carrier in (("hand", "forearm"), ("foot", "shin")):
            turns[f"{side}_{tip}"] = _tip(turns[f"{side}_{carrier}"], pointing.get(f"{side} {tip}"), tip)
    return PersonMotion(skeleton, fps, points["Hip"][1:], {name: turn[1:] for name, turn in turns.items()})


def _frames_across(left: Array, up: Array) -> Array:
    """(F, 3, 3) frames with y along `left` and z as close to `up` as that allows."""
    y: Array = left / np.linalg.norm(left, axis=1, keepdims=True)
    x: Array = np.cross(y, up)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _rest_shoulder(offset: tuple[float, float, float], side: str) -> Array:
    forward, out, up = offset
    return np.array([forward, out if side == "left" else -out, up])


def _turned_to(frames: Array, offset: Array, wanted: Array) -> Array:
    """(F, 3, 3) frames turned the shortest way so that `offset` (3,) in them points along `wanted` (F, 3)."""
    now: Array = frames @ (offset / np.linalg.norm(offset))
    then: Array = wanted / np.linalg.norm(wanted, axis=1, keepdims=True)
    axis, cosine = np.cross(now, then), np.sum(now * then, axis=1)
    cross = np.zeros((len(axis), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
    cross -= np.swapaxes(cross, 1, 2)
    # Rodrigues' formula; the two are never opposite.
    turn = np.eye(3) + cross + cross @ cross / (1.0 + np.maximum(cosine, -0.99))[:, None, None]
    return turn @ frames


def _tip(carrier: Array, pointing: Array | None, tip: str) -> Array:
    """(F, 3, 3) frames of a hand or a foot: those of what carries it, turned to where the body's own points."""
    axis = np.array(POINTING[f"left {tip}"])
    return carrier if pointing is None else _turned_to(carrier, axis, pointing)
