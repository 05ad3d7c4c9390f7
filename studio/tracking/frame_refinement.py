"""Refinement inside the loop: each frame's pose is moved onto the silhouettes, and the next frame starts from there.

The search finds the valley, the local descent (`refinement`) its floor; neither does without the other. Measured on the
choosing half of the generalisation suite (`studio reproduce generalisation`).
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.distance_maps import distances_of
from studio.evidence.frame_evidence import FrameEvidence
from studio.geometry.camera import Camera
from studio.knobs import knob
from studio.tracking.refinement import RefinementSettings, Refiner
from studio.tracking.tracker import Carried, FrameProblem, FrameResult

Array = NDArray[np.float64]

POSE, CLOUD = "pose", "cloud"


@dataclass(frozen=True, slots=True)
class FrameRefinementSettings:
    """The knobs of refining each frame where the search ended, the same for every tracker."""

    title = "Refinement of each frame"

    refine_frames: bool = knob(
        True, label="refine each frame", takes_effect="next frame",
        help="Move each frame's pose onto the silhouettes after its search, and start the next frame from there.",
    )  # fmt: skip
    refine_frame_steps: int = knob(
        10, 1, 100, 1, label="refinement steps", unit="steps", takes_effect="next frame",
        help="Most steps of the local descent of a frame.",
    )  # fmt: skip
    refine_frame_points: int = knob(
        150, 20, 1000, 10, label="border points", takes_effect="next frame",
        help="Points of each view's silhouette border that the descent looks at.",
    )  # fmt: skip
    next_frame_from: str = knob(
        POSE, choices=(POSE, CLOUD), label="next frame starts from", takes_effect="next frame",
        help="Where every particle of the next frame starts: at the refined pose, or in the cloud moved with it.",
    )  # fmt: skip


class FrameRefiner:
    """Refines the frames of one body; refiners are kept by the cameras that see a frame."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...]) -> None:
        self._body, self._cameras = body, {camera.name: camera for camera in cameras}
        self._refiners: dict[tuple[object, ...], Refiner] = {}

    def refined(
        self,
        result: FrameResult,
        evidence: FrameEvidence,
        problem: FrameProblem,
        settings: FrameRefinementSettings,
    ) -> FrameResult:
        """The result with its pose refined, and what the next frame starts from; as it is where it shall not be refined
        or no mask shows anything.
        """
        if not settings.refine_frames or not any(view.mask.any() for view in evidence.views):
            return result
        silhouettes = [distances_of(view.mask, settings.refine_frame_points) for view in evidence.views]
        refiner = self._refiner(tuple(view.camera for view in evidence.views), settings)
        found = refiner.refine(result.estimate.pose, silhouettes)
        weight = float(problem.weigh(found.pose[None])[0])
        estimate = dataclasses.replace(
            result.estimate, pose=found.pose, searched=result.estimate.pose, log_weight=weight
        )
        carried = _carried(result, found.pose, settings.next_frame_from, refiner)
        return dataclasses.replace(result, estimate=estimate, carried=carried)

    def _refiner(self, names: tuple[str, ...], settings: FrameRefinementSettings) -> Refiner:
        key = (names, settings.refine_frame_steps)
        if key not in self._refiners:
            cameras = tuple(self._cameras[name] for name in names)
            knobs = RefinementSettings(refinement_steps=settings.refine_frame_steps)
            self._refiners[key] = Refiner(self._body, cameras, knobs)
        return self._refiners[key]


def _carried(result: FrameResult, pose: Array, start: str, refiner: Refiner) -> Carried:
    """What the next frame starts from: the set at the frame's end, moved to the refined pose."""
    particles = result.carried.particles
    if particles is not None and start == POSE:
        particles = dataclasses.replace(particles, poses=np.repeat(pose[None], len(particles.poses), axis=0))
    elif particles is not None:
        moved = particles.poses + (pose - result.estimate.pose)
        particles = dataclasses.replace(particles, poses=np.clip(moved, refiner.lower, refiner.upper))
    return dataclasses.replace(result.carried, particles=particles, estimate=pose)
