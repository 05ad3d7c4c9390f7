"""A layer's particles as a small drawing: where hands, feet and head of the cloud lie in the first camera's view."""

from dataclasses import dataclass

import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, extremities
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

MOST_PARTICLES = 256
"""Of a larger cloud so many, evenly taken, are enough for an ellipse."""


@dataclass(frozen=True, slots=True)
class CloudOutline:
    """ellipses : of each of the body's extremities x, y of the cloud's centre and its covariance xx, xy, yy. figure :
    of each limb the ends x, y, x, y in the cloud's mean pose. All in pixels of the first camera; without what lies
    behind it.
    """

    ellipses: list[list[float]]
    figure: list[list[float]]


def outline_of(body: BodyModel, camera: Camera, poses: Array, mean: Array) -> CloudOutline | None:
    """The outline of a layer's particles (N, D) and their mean (D,); None of a layer without particles."""
    if not len(poses):
        return None
    some = poses[:: -(-len(poses) // MOST_PARTICLES)]
    ends = limb_ends(body, np.concatenate([mean[None], some]))
    figure, _ = project(camera, ends[0])
    points, _ = project(camera, ends[1:, list(extremities(body)), 1])
    ellipses: list[list[float]] = []
    for cloud in points.swapaxes(0, 1):
        seen = cloud[np.isfinite(cloud).all(axis=1)]
        if len(seen):
            centre = seen.mean(axis=0)
            away = seen - centre
            (xx, xy), (_, yy) = away.T @ away / len(seen)
            ellipses.append(_short([*centre, xx, xy, yy]))
    lines = figure.reshape(-1, 4)
    return CloudOutline(ellipses, [_short(line) for line in lines[np.isfinite(lines).all(axis=1)]])


def _short(values: "Array | list[float]") -> list[float]:
    """Tenths of a pixel, which is more than is drawn."""
    return [round(float(value), 1) for value in values]
