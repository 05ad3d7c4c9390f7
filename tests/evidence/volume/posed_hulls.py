"""Hulls made of points in a body's own cones, each limb in a colour of its own: the result of a perfect
reconstruction."""

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.evidence.volume.blob_acquisition import Profiles, blobs_of
from studio.evidence.volume.blob_model import BlobModel, cone_blobs
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.tracking_space import Box

Array = np.ndarray


def limb_colours(body: BodyModel, seed: int = 4) -> Array:
    """(L, 3) a colour for each drawn limb."""
    return np.random.default_rng(seed).uniform(30.0, 220.0, (len(body.drawn), 3))


def plain(body: BodyModel) -> Callable[[int, Array], Array]:
    """Every limb in one colour from end to end."""
    colours = limb_colours(body)
    return lambda limb, along: np.repeat(colours[limb][None], len(along), axis=0)


def hull_of(
    body: BodyModel,
    pose: Array,
    *,
    spacing: float = 20.0,
    colour: Callable[[int, Array], Array] | None = None,
    noise: float = 4.0,
    seed: int = 0,
) -> Hull:
    """The voxels of a grid in the cones of a pose (D,), each in the first limb that has it.

    colour : (limb, share of its length (K,)) to colours (K, 3). noise : standard deviation of the colours, levels.
    """
    paint = colour or plain(body)
    rng = np.random.default_rng(seed)
    shapes, frames = kinematic_tables(body).limb_shape, limb_frames(body, pose[None])[0]
    ends = np.concatenate([frames[:, :, 3], frames[:, :, 3] + frames[:, :, 2] * shapes[:, :1]])
    low, high = ends.min(axis=0) - 250.0, ends.max(axis=0) + 250.0
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    colours, free = np.zeros((len(grid), 3)), np.ones(len(grid), dtype=bool)
    tree = cKDTree(grid)
    for limb, ((length, start, end, sx, sy), frame) in enumerate(zip(shapes, frames, strict=True)):
        reach = np.hypot(0.5 * length, max(start, end) * max(sx, sy))
        near_by = np.array(tree.query_ball_point(frame[:, 3] + 0.5 * length * frame[:, 2], reach))
        near_by = near_by[free[near_by]]
        own = (grid[near_by] - frame[:, 3]) @ frame[:, :3]
        along = own[:, 2] / length
        across = np.hypot(own[:, 0] / sx, own[:, 1] / sy)
        inside = (along >= 0.0) & (along <= 1.0) & (across <= start + along * (end - start))
        colours[near_by[inside]] = paint(limb, along[inside])
        free[near_by[inside]] = False
    centres, colours = grid[~free], colours[~free]
    colours = np.clip(colours + rng.normal(0.0, noise, colours.shape), 0.0, 255.0).astype(np.float32)
    edges = np.full(len(centres), spacing)
    return Hull(centres, edges, colours, colours[:, None], 7, Box(low, high))


def empty_hull() -> Hull:
    """No voxel."""
    none = np.zeros((0, 3), dtype=np.float32)
    return Hull(np.zeros((0, 3)), np.zeros(0), none, none[:, None], 7, Box(np.zeros(3), np.full(3, 2000.0)))


def near(body: BodyModel, pose: Array, seed: int, frames: float = 2.0, fps: float = 30.0) -> Array:
    """A pose so many frames' largest movement away, limits kept."""
    rng = np.random.default_rng(seed)
    step = np.array([entry.max_step for entry in body.parameters]) / fps
    lower = np.array([entry.lower for entry in body.parameters])
    upper = np.array([entry.upper for entry in body.parameters])
    return np.clip(pose + frames * step * rng.uniform(-1.0, 1.0, len(pose)), lower, upper)


def learn_blobs(body: BodyModel, hulls: list[Hull], poses: Array) -> BlobModel:
    """The blobs after all of these frames' hulls and poses (F, D), in this order; empty hulls add nothing."""
    profiles, model = Profiles.none(body), cone_blobs(body)
    for hull, pose in zip(hulls, poses, strict=True):
        if len(hull.centres):
            profiles = profiles.with_frame(body, model, hull, pose)
            model = blobs_of(body, profiles, 12.0)
    return model
