"""The tracking space of a body: the common view of the cameras, or the reach of a body that is fixed to the world."""

from collections.abc import Sequence

import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.evidence.volume.alignment import root_parameters
from studio.evidence.volume.tracking_space import Box, box_of
from studio.foundations.geometry.camera import Camera

TRIED = 2000
"""Number of random poses whose limbs span a fixed body's reach."""
MARGIN = 1.1


def space_of(body: BodyModel, cameras: Sequence[Camera]) -> Box:
    """The box in which the body's hull is carved. Raises CalibrationError where the cameras' views do not overlap."""
    if len(root_parameters(body)):
        return box_of(cameras, scale=scale_of(body))
    lower, upper = np.maximum(body.lower, -np.pi), np.minimum(body.upper, np.pi)
    poses = lower + np.random.default_rng(0).random((TRIED, len(lower))) * (upper - lower)
    ends = limb_ends(body, poses).reshape(-1, 3)
    thickest = max(max(limb.radius_start, limb.radius_end) for limb in body.drawn)
    low, high = ends.min(axis=0) - thickest, ends.max(axis=0) + thickest
    middle, half = 0.5 * (low + high), 0.5 * MARGIN * (high - low)
    return Box(middle - half, middle + half)
