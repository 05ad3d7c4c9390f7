"""A start pose gone over limb by limb on the silhouettes, and refined.

The search for a start pose judges poses as a whole, with the weighting that is asked for; where the room is full of
edges it likes an arm before the chest, whose edges there explain everything. What the silhouettes show beside the trunk
then stays uncovered. So each limb is looked for in all its range (`tracking.lost_limbs`), the pose that comes out goes
down to the silhouettes' borders (`tracking.refinement`), and it is taken where the silhouettes agree better with it.
"""

import numpy as np
from numpy.typing import NDArray

from studio.body.branches import within_limits
from studio.body.model import BodyModel
from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.frame_evidence import FrameEvidence
from studio.geometry.camera import Camera
from studio.tracking.lost_limbs import lost_limbs_found
from studio.tracking.refinement import RefinementSettings, Refiner
from studio.weighting.outlines import OutlineProjector
from studio.weighting.silhouette_areas import HALF, Silhouettes

Array = NDArray[np.float64]

TRIES = 4096
"""Places of a limb."""


def limbs_put_right(
    body: BodyModel, cameras: tuple[Camera, ...], evidence: FrameEvidence, pose: Array, seed: int
) -> Array:
    """The pose (D,) with its limbs where a frame's masks show them; the same pose where that agrees no better."""
    silhouettes = Silhouettes(evidence, HALF)
    projector = OutlineProjector.of_body(body, cameras)

    def agreement(poses: Array) -> Array:
        """f_s (Fleischmann et al. 2012, section 2.2), the mean over the views: (N, D) to (N,)."""
        return silhouettes.areas(projector.blocks(poses), len(poses)).fitness().mean(axis=1)

    def of_frames(tried: Array) -> Array:
        return agreement(tried.reshape(-1, tried.shape[-1])).reshape(tried.shape[:2])

    limbs = dict.fromkeys(entry.limb for entry in body.parameters)
    moved = lost_limbs_found(
        np.random.default_rng(np.random.SeedSequence((seed, 0x11B5))),
        of_frames,
        within_limits(body, pose)[None],
        [np.flatnonzero([entry.limb == limb for entry in body.parameters]) for limb in limbs],
        np.array([[entry.lower for entry in body.parameters], [entry.upper for entry in body.parameters]]),
        body.neutral,
        TRIES,
    )[0]
    refined = Refiner(body, cameras, RefinementSettings()).refine(moved, silhouette_distances(evidence)).pose
    offered = np.stack([pose, moved, refined])
    return offered[int(np.argmax(agreement(offered)))]
