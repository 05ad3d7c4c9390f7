"""Turns of a body between frames that are faster than it can turn.

Both ends of an animal look alike, and so do the back and the belly of one that stands up. A search that takes one for
the other turns the body half round from one frame to the next, which no animal does.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.evidence.volume.alignment import root_parameters
from studio.foundations.arrays import Array

HALF_WAY = np.pi / 2.0
"""rad: two frames that differ by more are nearer to each other once one is turned half round."""
TURN = 1.0
"""What one impossible turn costs: as the change of sides where they move by twenty times what is usual."""


def turned_too_fast(body: BodyModel, before: Array, after: Array, seconds: Array) -> NDArray[np.bool_]:
    """(N,) whether the body turns farther from poses `before` to poses `after` (N, D) than its file allows, and than
    half way.

    seconds : (N,) between the two.
    """
    root = next(number for number, joint in enumerate(body.joints) if joint.parent < 0)
    began, ended = (joint_frames(body, poses)[:, root, :, :3] for poses in (before, after))
    cosines = 0.5 * (np.einsum("nij,nij->n", ended, began) - 1.0)
    angles = np.arccos(np.clip(cosines, -1.0, 1.0))
    own = root_parameters(body).tolist()
    steps = [
        entry.max_step
        for number, entry in enumerate(body.parameters)
        if number in own and body.angles[number]
    ]
    fastest = max((step for step in steps if np.isfinite(step)), default=0.0)
    return np.asarray(angles > np.maximum(HALF_WAY, fastest * seconds), dtype=np.bool_)


def costs_of_turning(body: BodyModel, both: tuple[Array, Array], seconds: Array) -> Array:
    """(K - 1, 2, 2) TURN for each impossible turn from a row to the next, by which of `both` poses (K, D) each row has.

    seconds : (K - 1,) between the rows.
    """
    costs = np.zeros((len(seconds), 2, 2))
    for before, after in itertools.product((0, 1), repeat=2):
        costs[:, before, after] = TURN * turned_too_fast(body, both[before][:-1], both[after][1:], seconds)
    return costs
