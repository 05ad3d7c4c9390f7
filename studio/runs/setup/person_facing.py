"""Which way a person faces, by the points of the network that knows people.

A silhouette is alike from the front and from the back. The network tells left from right in a picture, at times
wrongly, so all cameras are asked: how far do the lines from right to left, between the shoulders and between the hips,
point as those of a pose do? A camera that sees the person from the side has short lines and says little.

Measured on the 22 drawn clips of `studio reproduce generalisation` that differ in motion, two frames each: of 44 start
poses three faced the wrong way by their weight (a leap, a cartwheel, boxes before the legs; 290 to 370 mm off). All
three were turned, at -0.50 to -0.97, and no other; of the rest 36 are at 0.7 and more, the lowest, a cartwheel, at 0.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.evidence.person_network import FOUND, Crop, Detection, PersonNetwork
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

SIDES = (("left_upper_arm", "right_upper_arm", 11, 12), ("left_thigh", "right_thigh", 23, 24))
"""Joints of a person's body, left and right, and the network's points of them."""
MARGIN = 1.5
"""Side of the first crop, in extents of the body's joints."""
SAME_SIZE = 2.0
"""Ratio of the sides of the person's crop and the first one beyond which it shows another person."""
NETWORK_ODDS = 6.0
"""Log odds that a person faces as all cameras' points say; set before the three wrong ones above were known."""


def facing_agreement(
    body: BodyModel, cameras: Sequence[Camera], pictures: Mapping[str, Bytes], pose: Array
) -> float:
    """How far a person's pose (D,) faces as pictures (H, W, 3), BGR, by camera show: 1 as all of them say, -1 the other
    way, 0 where the body is no person's or no camera sees one for certain.
    """
    numbers = {joint.name: number for number, joint in enumerate(body.joints)}
    if any(name not in numbers for left, right, *_ in SIDES for name in (left, right)):
        return 0.0
    joints = joint_frames(body, pose)[0, :, :, 3]
    seen, along, length = person_around(PersonNetwork(), cameras, pictures, joints), 0.0, 0.0
    for camera in cameras:
        if camera.name not in seen:
            continue
        one, pixels = seen[camera.name], project(camera, joints)[0]
        for left, right, shown_left, shown_right in SIDES:
            of_pose = (pixels[numbers[left]] - pixels[numbers[right]]) / one.crop.side
            of_picture = (one.points[shown_left] - one.points[shown_right]) / one.crop.side
            along += float(of_pose @ of_picture)
            length += float(np.linalg.norm(of_pose) * np.linalg.norm(of_picture))
    return along / length if length else 0.0


def person_around(
    network: PersonNetwork, cameras: Sequence[Camera], pictures: Mapping[str, Bytes], joints: Array
) -> dict[str, Detection]:
    """Who is seen for certain where a person's joints (J, 3) lie, by camera; without those that see nobody there.

    pictures : (H, W, 3), BGR, by camera.
    """
    found = dict[str, Detection]()
    for camera in cameras:
        pixels, depths = project(camera, joints)
        if camera.name not in pictures or (depths <= 0.0).any() or not np.isfinite(pixels).all():
            continue
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        middle, side = 0.5 * (low + high), MARGIN * float((high - low).max())
        crop = Crop(float(middle[0]), float(middle[1]), side, -0.5 * math.pi * camera.quarter_turns)
        first = network.look(pictures[camera.name], crop)
        if not first.is_person() or abs(math.log(first.next_crop.side / side)) > math.log(SAME_SIZE):
            continue
        seen = network.look(pictures[camera.name], first.next_crop)
        if max(first.presence, seen.presence) >= FOUND and seen.is_person():
            found[camera.name] = seen
    return found
