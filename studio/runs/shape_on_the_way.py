"""The subject's shape from the first frames of a run: all radii, and the lengths that no tape measures.

Cones that are too thin or too thick for the clothed body pull joints along (arms ride up by centimetres), hands, feet
and head end where the silhouettes say. So a run's first frames are tracked, the shape is fitted to the most different
of them (`tracking.shape_refinement`), and the run begins again with it. Known bone lengths are kept: a fit of all of
them is unsafe, as silhouettes hardly tell a knee ten millimetres higher from one that is bent a little more.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.body.shape_space import ShapeSpace, shape_space
from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.frame_evidence import FrameEvidence
from studio.geometry.camera import Camera
from studio.tracking.shape_prior import ShapePrior, ShapeSpreads
from studio.tracking.shape_refinement import ShapeRefiner
from studio.weighting.shape_silhouettes import ShapePrograms

Array = NDArray[np.float64]

FIRST_FRAMES, FITTED_FRAMES = 30, 8
"""Frames that are tracked before the fit, and the most different ones of them that it looks at."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedShape:
    """body : with the shape. poses : (F, D) of the frames with it. sizes : group to mm, before and after."""

    body: BodyModel
    poses: Array
    sizes: dict[str, tuple[float, float]]


def fitted_shape(
    body: BodyModel,
    cameras: tuple[Camera, ...],
    frames: Sequence[FrameEvidence],
    poses: Array,
    seed: int = 0,
) -> FittedShape:
    """The shape of a body on some frames' masks, from its poses there (F, D), which are in the right valley."""
    space = shape_space(body, lengths="ends")
    prior = ShapePrior(space, ShapeSpreads(), None)
    borders = [silhouette_distances(frame) for frame in frames]
    found = ShapeRefiner(ShapePrograms(space), cameras, borders, prior).refine(
        np.zeros(len(space.groups)), poses, seed
    )
    return FittedShape(space.body_of(found.shape), found.poses, _sizes(space, found.shape))


def _sizes(space: ShapeSpace, shape: Array) -> dict[str, tuple[float, float]]:
    before, after = space.sizes(np.zeros_like(shape)), space.sizes(shape)
    return {
        name: (float(one), float(other)) for name, one, other in zip(space.names, before, after, strict=True)
    }
