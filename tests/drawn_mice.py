"""A mouse that rears before three cameras."""

import dataclasses

import numpy as np
from drawn_people import ring_of_cameras

from studio.body.catalogue import load_body

SMALL = tuple(
    dataclasses.replace(camera, translation=camera.translation / 10.0)
    for camera in ring_of_cameras(3, 640, 480)
)
"""Around an animal of a hand's length."""


def rearing_mouse(**changed: float) -> np.ndarray:
    """Reared up, the tail on the floor behind it."""
    mouse = load_body("mouse31")
    names = [entry.name for entry in mouse.parameters]
    pose, values = mouse.neutral, {"pitch": -1.2, "pelvis_z": 40.0, "left_haunch_swing": -1.2, **changed}
    for name, value in {"right_haunch_swing": -1.2, "tail_lift": 1.2, "tail_2_wag": 0.6, **values}.items():
        pose[names.index(name)] = value
    return pose
