"""A start pose gone over limb by limb on the silhouettes, and refined.

The search for a start pose judges poses as a whole, with the weighting that is asked for; where the room is full of
edges it likes an arm before the chest, whose edges there explain everything. What the silhouettes show beside the trunk
then stays bare. So the pose goes down to the silhouettes' borders, and limbs that they deny are drawn anew, as in the
frames that follow (`tracking.frame_refinement`).
"""

import numpy as np
from numpy.typing import NDArray

from studio.body.branches import within_limits
from studio.body.model import BodyModel
from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.frame_evidence import FrameEvidence
from studio.geometry.camera import Camera
from studio.tracking.agreement import Agreement
from studio.tracking.frame_refinement import Hypothesis, SeenFrame, redrawn
from studio.tracking.refinement import RefinementSettings, Refiner

Array = NDArray[np.float64]

ROUNDS = 3
"""A limb may be found only where another one has left."""


def limbs_put_right(
    body: BodyModel,
    cameras: tuple[Camera, ...],
    evidence: FrameEvidence,
    pose: Array,
    seed: int,
    *,
    draw: bool = True,
) -> Hypothesis:
    """The pose (D,) with its limbs where a frame's masks show them, and what still disagrees. draw : whether limbs may
    be drawn anew; else the pose stays as it is.
    """
    refiner = Refiner(body, cameras, RefinementSettings())
    frame = SeenFrame(refiner, Agreement(body, cameras), silhouette_distances(evidence))
    if not draw:
        return frame.hypothesis(pose)
    rng = np.random.default_rng(np.random.SeedSequence((seed, 0x11B5)))
    found = frame.hypothesis(refiner.refine(within_limits(body, pose), frame.silhouettes).pose)
    for _ in range(ROUNDS):
        found, _ = redrawn(rng, found, frame)
    return found
