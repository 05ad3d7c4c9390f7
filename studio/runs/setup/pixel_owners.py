"""Whose each pixel is, of several bodies in one camera's picture: by where their limbs are, and by their colours.

A pixel speaks for a body by how well the body's limb there (outside its silhouette: the nearest one) explains the
pixel's colour, and by how near that limb is; of limbs that hide one another the front one is likelier. Colours are
learnt of each limb in each camera where the body is alone, so that it does not matter that two have the same hair.

What another body's pixels hide is no evidence against a body that stands behind: there its own silhouette stays in its
mask, and where its mask says nothing of it is kept beside the mask (`ViewEvidence.unknown`). In front of the other it
would be seen: there it does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.runs.drawing.overlay_drawing import projected_silhouette
from studio.search.likelihood.overlay import ViewOverlay

FADES = 15.0
"""mm (of a person: `scale_of`) from a body's silhouette over which it explains a pixel e times less."""
MOST_BY_COLOUR = 4.0
"""Log-likelihood by which a colour speaks for one body and against another, at most."""
BEHIND = 1.5
"""Log-likelihood by which a limb speaks less for a pixel where another body's limb is in front of it."""
SURE = 2.0
"""Log-likelihood by which another body must explain a pixel better before a body's silhouette is denied it."""
SMOOTH = 1.2
"""Pixels over which what speaks for a body is averaged."""
LEARNT, FEWEST = 0.2, 8
"""Share of a frame's colours in what is known of a limb; pixels that it takes."""
LEAST_DEVIATION = 6.0
"""Grey levels."""

Floats32 = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class LimbMap:
    """A body in a camera's picture. inside : (H, W). limb : (H, W) the front one, the nearest outside. apart : (H, W)
    pixels from the silhouette. depth : (H, W) mm from the camera to that limb. fades : pixels.
    """

    inside: NDArray[np.bool_]
    limb: NDArray[np.int64]
    apart: Floats32
    depth: Floats32
    fades: float


def limb_map(body: BodyModel, camera: Camera, pose: Array, view: ViewOverlay, scale: float) -> LimbMap | None:
    """Of a pose (D,) and its overlay; None where nothing of it is in the picture. scale : as in `scale_of`."""
    middles = limb_ends(body, pose[None])[0].mean(axis=1)
    depths = project(camera, middles)[1]
    limb = np.full((camera.height, camera.width), -1, dtype=np.int64)
    for number in map(int, np.argsort(-depths, kind="stable")):
        drawn = projected_silhouette((view.contours[number],), camera.height, camera.width) > 0
        limb[drawn] = number
    inside = limb >= 0
    if not inside.any():
        return None
    outside = np.where(inside, np.uint8(0), np.uint8(1))
    apart, labels = cv2.distanceTransformWithLabels(outside, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    nearest = np.asarray(labels, dtype=np.int64)
    of_label = np.zeros(int(nearest.max()) + 1, dtype=np.int64)
    of_label[nearest[inside]] = limb[inside]
    limb = of_label[nearest]
    fades = FADES * scale * float(camera.matrix[0, 0]) / max(float(np.median(depths)), 1.0)
    return LimbMap(inside, limb, np.asarray(apart, np.float32), depths[limb].astype(np.float32), fades)


class LimbColours:
    """The colours of a body's limbs in one camera, learnt frame by frame."""

    def __init__(self, limbs: int) -> None:
        self._known = np.zeros(limbs, dtype=np.bool_)
        self._mean, self._variance = np.zeros((limbs, 3)), np.ones((limbs, 3))
        self._whole: tuple[Array, Array] | None = None

    def learn(self, colours: Floats32, limbs: NDArray[np.int64]) -> None:
        """Learn colours (K, 3) of pixels of limbs (K,)."""
        if len(colours) < FEWEST:
            return
        self._whole = _moments(colours)
        for limb in np.unique(limbs):
            own = colours[limbs == limb]
            if len(own) < FEWEST:
                continue
            mean, variance = _moments(own)
            share = LEARNT if self._known[limb] else 1.0
            self._mean[limb] += share * (mean - self._mean[limb])
            self._variance[limb] += share * (variance - self._variance[limb])
            self._known[limb] = True

    def explains(self, colours: Floats32, limbs: NDArray[np.int64]) -> Array:
        """(K,) log-likelihood of colours (K, 3) of limbs (K,); 0 before anything was learnt."""
        if self._whole is None:
            return np.zeros(len(colours))
        mean, variance = self._mean.copy(), self._variance.copy()
        mean[~self._known], variance[~self._known] = self._whole
        off = (colours - mean[limbs]) ** 2 / variance[limbs]
        return -0.5 * (off + np.log(variance[limbs])).sum(axis=1)


def _moments(colours: Floats32) -> tuple[Array, Array]:
    return colours.mean(axis=0, dtype=np.float64), colours.var(axis=0, dtype=np.float64) + LEAST_DEVIATION**2


@dataclass(frozen=True, slots=True, eq=False)
class Share:
    """A body's part of a mask. mask : (H, W) 0 or 255. hidden : (H, W), 255 where that says nothing of the body."""

    mask: Bytes
    hidden: Bytes


def owners(
    picture: Bytes, whole: Bytes, maps: Sequence[LimbMap | None], colours: Sequence[LimbColours]
) -> list[Share]:
    """Each body's share of a mask of all, `whole` (H, W). picture : (H, W, 3)."""
    nothing = np.zeros(whole.shape, np.uint8)
    empty = Share(nothing, nothing)
    foreground = whole > 0
    seen = [number for number, one in enumerate(maps) if one is not None]
    parts = [empty] * len(maps)
    if not seen or not foreground.any():
        return parts
    visible = [one for one in maps if one is not None]
    soft = _soft(picture)
    by_colour = np.stack(
        [
            colours[k].explains(soft[foreground], one.limb[foreground])
            for k, one in zip(seen, visible, strict=True)
        ]
    )
    by_colour = np.maximum(by_colour - by_colour.max(axis=0), -MOST_BY_COLOUR)
    front = np.stack([np.where(one.inside, one.depth, np.inf) for one in visible]).min(axis=0)
    scores: list[Array] = []
    for one, colour in zip(visible, by_colour, strict=True):
        speaks = np.zeros(whole.shape)
        speaks[foreground] = colour
        speaks -= BEHIND * (one.inside & (one.depth > front))
        scores.append(_smoothed(speaks, foreground) - one.apart / one.fades)
    owner, most = np.argmax(scores, axis=0), np.max(scores, axis=0)
    depth = np.stack([one.depth for one in visible])
    before = np.take_along_axis(depth, owner[None], axis=0)[0]
    for row, (number, one) in enumerate(zip(seen, visible, strict=True)):
        unknown = foreground & (owner != row) & ((before < one.depth) | (scores[row] > most - SURE))
        own = foreground & (owner == row)
        parts[number] = Share(_mask(own | (unknown & one.inside)), _mask(unknown))
    return parts


def learn_colours(
    picture: Bytes, whole: Bytes, maps: Sequence[LimbMap | None], colours: Sequence[LimbColours]
) -> None:
    """Learn the colours of each body where no other is near."""
    soft, foreground = _soft(picture), whole > 0
    for number, one in enumerate(maps):
        if one is None:
            continue
        alone = one.inside & foreground
        for other, beside in enumerate(maps):
            if other != number and beside is not None:
                alone &= beside.apart > 2.0 * beside.fades
        colours[number].learn(soft[alone], one.limb[alone])


def _mask(inside: NDArray[np.bool_]) -> Bytes:
    return np.where(inside, np.uint8(255), np.uint8(0))


def _soft(picture: Bytes) -> Floats32:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.8), dtype=np.float32)


def _smoothed(values: Array, inside: NDArray[np.bool_]) -> Array:
    """Averaged over SMOOTH pixels that are inside."""
    weights = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), SMOOTH)
    return np.asarray(
        cv2.GaussianBlur(np.where(inside, values, 0.0), (0, 0), SMOOTH) / np.maximum(weights, 1e-6)
    )
