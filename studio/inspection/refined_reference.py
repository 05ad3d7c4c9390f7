"""Where a frame's body probably is, when nothing better is known: the found pose moved onto the silhouettes, lost limbs
drawn anew, sides exchanged where that explains the silhouettes clearly better.
"""

import numpy as np

from studio.arrays import Array
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence
from studio.inspection.reading import InspectedRun
from studio.trackers.agreement import Agreement
from studio.trackers.frame_refinement import (
    DOUBTFUL_SHARE,
    REDRAWN,
    REDRAWN_STEPS,
    FrameRefinementSettings,
    SeenFrame,
    redrawn,
)
from studio.trackers.refinement import RefinementSettings, Refiner
from studio.trackers.side_exchange import kinds_of


def refined_pose(
    run: InspectedRun, evidence: FrameEvidence, frame: int, pose: Array, near: Array | None = None
) -> Array:
    """The pose (D,) refined as a run refines its frames, and with the sides that fit best; itself where no silhouette
    shows anything. near : (D,) the body in the next frame, from where limbs that are lost are sought instead of anew.
    """
    points = FrameRefinementSettings().refine_frame_points
    seen = {name: view for name, view in silhouettes_by_camera(evidence, points).items() if len(view.border)}
    cameras = tuple(camera for camera in run.run.cameras() if camera.name in seen)
    if not cameras:
        return pose
    refiner = Refiner(run.body, cameras, RefinementSettings(refinement_steps=REDRAWN_STEPS))
    views = SeenFrame(refiner, Agreement(run.body, cameras), tuple(seen[camera.name] for camera in cameras))
    found = views.hypothesis(refiner.refine(pose, views.silhouettes).pose)
    if near is not None:
        return views.better(found, near).pose
    for kind in kinds_of(run.body):
        found = views.better(found, kind.offered(found.pose))
    if max(found.off.shares().values()) >= DOUBTFUL_SHARE:
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence((0, frame, 0, 0, REDRAWN))))
        found, _ = redrawn(rng, found, views)
    return found.pose
