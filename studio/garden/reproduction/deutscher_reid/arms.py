"""The planar arms of Deutscher & Reid (2005), section 6: one camera facing the plane, a silhouette of a known pose.

Only the joints' ranges are known before the search (Fig. 12a: the first cloud is uniform over them), so the largest
expected movement is the whole range and σ0 of Eq. 13 is half of it.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, kinematic_tables
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.results.drawing_footage.arm_footage import arm_outlines, filled
from studio.runs.hierarchy import hierarchy_of
from studio.runs.search_space import search_space
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.tracker import FilterState, FrameLikelihood, FrameResult, LayerRecord, SearchSpace

PICTURE = (160, 120)
FOCAL_PIXELS = 400.0
# The arm, stretched out in any direction, fills this share of the picture's smaller half.
FILLED = 0.9
# True poses lie within this part of the joints' ranges, so that no answer lies on the search's border.
TRUE_PART = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class TemplateArm:
    """An arm of the body catalogue, weighed by rendered templates against its silhouette."""

    name: str
    body: BodyModel
    camera: Camera
    space: SearchSpace
    likelihood: Any

    def observed(self, pose: Array) -> FrameLikelihood:
        """The silhouette of pose (D,), as a function of poses."""
        mask = silhouette(self.body, self.camera, pose)
        picture = np.repeat(mask[:, :, None], 3, axis=2)
        view = ViewEvidence(self.camera.name, picture, mask, np.zeros_like(mask))
        return self.likelihood.problem(FrameEvidence(0, (view,)))


def template_arm(body_name: str) -> TemplateArm:
    """A planar body before its camera. Raises BodyError for an unknown body."""
    body = load_body(body_name)
    camera = facing_camera(body)
    weighting = WEIGHTINGS["template"]
    likelihood = weighting.prepare(body, (camera,), weighting.settings_type())
    half_range = np.array([(entry.upper - entry.lower) / 2.0 for entry in body.parameters])
    return TemplateArm(body_name, body, camera, search_space(body, half_range), likelihood)


def facing_camera(body: BodyModel) -> Camera:
    """A camera whose picture plane is parallel to the plane that the body moves in, and which sees all of it."""
    limits = np.array([(entry.lower, entry.upper) for entry in body.parameters])
    poses = np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (500, len(limits)))
    ends = limb_ends(body, poses).reshape(-1, 3)
    root = limb_ends(body, body.neutral[None])[0, 0, 0]
    # The plane's normal is the direction in which the ends do not vary.
    normal = np.linalg.svd(ends - root, full_matrices=False)[2][2]
    across = np.cross(normal, [0.0, 0.0, 1.0])
    right = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-9 else np.array([1.0, 0.0, 0.0])
    rotation = np.stack([right, np.cross(normal, right), normal]).astype(np.float64)
    seen = (ends - root) @ rotation.T
    middle = (seen[:, :2].max(axis=0) + seen[:, :2].min(axis=0)) / 2.0
    extent = (
        seen[:, :2].max(axis=0)
        - seen[:, :2].min(axis=0)
        + 2.0 * kinematic_tables(body).limb_shape[:, 1].max()
    )
    width, height = PICTURE
    distance = FOCAL_PIXELS * float(np.max(extent / np.array(PICTURE))) / FILLED
    matrix = np.array([[FOCAL_PIXELS, 0, (width - 1) / 2], [0, FOCAL_PIXELS, (height - 1) / 2], [0, 0, 1.0]])
    translation = -rotation @ root + np.array([-middle[0], -middle[1], distance])
    return Camera("front", width, height, matrix, np.zeros(5), rotation, translation)


def silhouette(body: BodyModel, camera: Camera, pose: Array) -> NDArray[np.uint8]:
    """(H, W) 255 where a pixel's centre lies inside the outline of a limb, else 0; pose (D,)."""
    return filled(arm_outlines(body, pose[None], camera)[0], camera.width, camera.height)


def true_pose(space: SearchSpace, seed: int) -> Array:
    """(D,) the pose to be found: uniform over the middle TRUE_PART of the joints' ranges, keyed by the seed."""
    middle, half = (space.lower + space.upper) / 2.0, (space.upper - space.lower) / 2.0
    draws = np.random.default_rng((seed, 1)).uniform(-TRUE_PART, TRUE_PART, len(middle))
    return middle + draws * half


@dataclass(frozen=True, slots=True, eq=False)
class AbsoluteAngles:
    """Poses whose angles are measured from the picture's axis instead of from the link before, as functions of a frame.

    before : (D,) the parameter of the link before, -1 at the root.
    """

    problem: FrameLikelihood
    before: NDArray[np.int64]

    def relative(self, poses: Array) -> Array:
        """(N, D) absolute angles to the body's own."""
        return poses - np.where(self.before >= 0, poses[:, self.before], 0.0)

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights."""
        return self.problem.log_likelihood(self.relative(poses), stage)

    def fitness(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights."""
        return self.problem.fitness(self.relative(poses), stage)

    def feasible(self, poses: Array, *, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether the body can take them."""
        return self.problem.feasible(self.relative(poses), limbs_apart=limbs_apart)


def links_before(body: BodyModel) -> NDArray[np.int64]:
    """(D,) the parameter of the link before each parameter's, -1 at the root: of planar arms, link after link."""
    depth = hierarchy_of(body).depth
    # Ranks grow along an arm, to 2 at most, and begin anew with the next arm.
    follows = np.concatenate([[False], np.diff(depth) >= 0])
    return np.where(follows, np.arange(len(depth)) - 1, -1)


def absolute(values: Array, before: NDArray[np.int64]) -> Array:
    """(D,) values of the links added up from the root outwards."""
    angles = np.array(values, dtype=np.float64)
    for index, parent in enumerate(before):
        if parent >= 0:
            angles[index] += angles[parent]
    return angles


def localise_absolute(scene: TemplateArm, seed: int, **changes: Any) -> Array:  # noqa: ANN401
    """(D,) the pose found by the search of `localise` over absolute angles, as the body's own angles. Limits are the
    sums of the joints', and σ0 is half of each range as there.
    """
    before, tracker = links_before(scene.body), TRACKERS["annealed"]
    lower, upper = (absolute(ends, before) for ends in (scene.space.lower, scene.space.upper))
    space = replace(scene.space, lower=lower, upper=upper, sigma=(upper - lower) / 2.0)
    problem = AbsoluteAngles(scene.observed(true_pose(scene.space, seed)), before)
    settings = tracker.settings_type(**changes)
    result = search_frame(
        tracker, problem, FilterState(None), space, seed=seed, frame=0, settings_source=lambda: (1, settings)
    )
    return problem.relative(result.estimate.pose[None])[0]


def localise(scene: TemplateArm, seed: int, **changes: Any) -> tuple[FrameResult, list[LayerRecord], Array]:  # noqa: ANN401
    """Search one picture with the annealed filter: the result, its layers, and the true pose (D,).

    changes : knobs of `AnnealedSettings` that differ from the defaults.
    """
    tracker = TRACKERS["annealed"]
    settings = tracker.settings_type(**changes)
    truth = true_pose(scene.space, seed)
    records: list[LayerRecord] = []
    result = search_frame(
        tracker,
        scene.observed(truth),
        FilterState(None),
        scene.space,
        seed=seed,
        frame=0,
        settings_source=lambda: (1, settings),
        on_layer=records.append,
    )
    return result, records, truth
