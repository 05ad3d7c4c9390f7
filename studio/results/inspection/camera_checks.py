"""Whether one camera contradicts the others at a pose: its calibration or its masks.

In each view the body's outlines at the pose are laid over the mask. Their overlap is measured as it is, and after the
best shift, turn and scale of the outlines in the picture. A camera that is turned or moved shows the body's shape in
another place: a shift mends it. Masks that are wrong show another shape: no shift does.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.distance_maps import FOREGROUND
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array, Floats
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.outlines import OutlineProjector

ROWS = 120
"""Height of the pictures that are compared, pixels."""
TURNS = (-6.0, 0.0, 6.0)
SCALES = (0.9, 1.0, 1.1)
FARTHEST = 0.25
"""Largest shift, as a share of the picture's height."""
POOR, VERY_POOR, MENDED = 0.8, 0.65, 0.6
"""A camera contradicts the others where its overlap is less than POOR of their median and a shift brings it MENDED of
the way to what theirs can be (cameras turned by 45 pixels: nine tenths and more), or where it is less than VERY_POOR
and none does (masks cut off: 0.3, of which a shift mends 0.1; poses fitted to markers, whose twists are free: 0.79).
"""


@dataclass(frozen=True, slots=True)
class ViewFit:
    """overlap : intersection over union of mask and outlines. best : the same after the best shift. shift : (x, y)
    pixels of the picture that bring the outlines onto the mask. covered : share of the mask under the body. inside :
    share of the body in the mask.
    """

    camera: str
    overlap: float
    best: float
    shift: tuple[float, float]
    covered: float
    inside: float

    @property
    def distance(self) -> float:
        """Length of the shift, pixels."""
        return float(np.hypot(*self.shift))


@dataclass(frozen=True, slots=True)
class CameraFault:
    """A camera that contradicts the others. kind : "calibration" or "masks". usual : the others' median overlap."""

    kind: str
    fit: ViewFit
    usual: float


def view_fits(
    body: BodyModel, cameras: tuple[Camera, ...], evidence: FrameEvidence, pose: Array
) -> list[ViewFit]:
    """How outlines and masks agree in each camera that has a picture; a view without a body in it is left out."""
    views = {view.camera: view for view in evidence.views}
    seen = tuple(camera for camera in cameras if camera.name in views)
    corners = OutlineProjector.of_body(body, seen).corners(pose[None])[0][0]
    fits: list[ViewFit] = []
    for camera, quads in zip(seen, corners, strict=True):
        mask = views[camera.name].mask
        factor = ROWS / mask.shape[0]
        width = max(1, round(mask.shape[1] * factor))
        small = cv2.resize(
            (mask >= FOREGROUND).astype(np.float32), (width, ROWS), interpolation=cv2.INTER_AREA
        )
        quads = quads[np.isfinite(quads).all(axis=(1, 2))] * factor
        if len(quads):
            fits.append(_fit(camera.name, np.asarray(small, dtype=np.float32), quads, 1.0 / factor))
    return fits


def _fit(name: str, mask: Floats, quads: Array, pixels: float) -> ViewFit:
    """The fit of outlines (L, 4, 2) in a small mask (H, W). pixels : of the picture in one of these."""
    high, wide = (int(size) for size in mask.shape)
    drawn = _draw(quads, high, wide)
    both, body, silhouette = float((drawn * mask).sum()), float(drawn.sum()), float(mask.sum())
    centre, overlap = quads.reshape(-1, 2).mean(axis=0), _share(both, body + silhouette - both)
    best, shift, reach = overlap, (0.0, 0.0), round(FARTHEST * high)
    # Twice the size, so that shifts do not wrap round.
    size = (2 * high, 2 * wide)
    spectrum = np.fft.rfft2(mask, size)
    for turn in TURNS:
        for scale in SCALES:
            angle = np.radians(turn)
            matrix = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            moved = _draw((quads - centre) @ matrix.T + centre, high, wide)
            common = np.fft.irfft2(spectrum * np.conj(np.fft.rfft2(moved, size)), size)
            common = np.roll(common, (reach, reach), axis=(0, 1))[: 2 * reach + 1, : 2 * reach + 1]
            shares: Array = common / np.maximum(float(moved.sum()) + silhouette - common, 1e-9)
            row, column = divmod(int(np.argmax(shares)), shares.shape[1])
            if shares[row, column] > best:
                best = float(shares[row, column])
                shift = ((column - reach) * pixels, (row - reach) * pixels)
    return ViewFit(name, overlap, best, shift, _share(both, silhouette), _share(both, body))


def _draw(quads: Array, high: int, wide: int) -> Floats:
    """(H, W) 1 where any limb's outline is."""
    picture = np.zeros((high, wide), np.uint8)
    corners: NDArray[np.int32] = np.round(quads).astype(np.int32)
    for at in range(len(corners)):
        cv2.fillConvexPoly(picture, np.asarray(cv2.convexHull(corners[at]), dtype=np.int32), 1)
    return picture.astype(np.float32)


def _share(part: float, whole: float) -> float:
    return part / whole if whole > 0.0 else 0.0


def fault_of(fits: list[ViewFit]) -> CameraFault | None:
    """The camera that contradicts the others most clearly; None where none does or there are fewer than two others."""
    if len(fits) < 3:
        return None
    worst = min(fits, key=lambda fit: fit.overlap)
    others = [fit for fit in fits if fit is not worst]
    usual, possible = (
        float(np.median([getattr(fit, name) for fit in others])) for name in ("overlap", "best")
    )
    mended = (worst.best - worst.overlap) / max(possible - worst.overlap, 1e-9)
    if worst.overlap < POOR * usual and mended >= MENDED:
        return CameraFault("calibration", worst, usual)
    if worst.overlap < VERY_POOR * usual:
        return CameraFault("masks", worst, usual)
    return None
