"""Cameras turned a little so that the silhouettes of a person agree: for a calibration that is nearly right.

Footage is seldom taken with the cameras exactly as they were calibrated: a tripod is touched, a mount sags. A degree is
twenty pixels, more than a forearm's half width, and no reprojection error of the calibration shows it. Silhouettes do,
without a board: planes through the line between two cameras that touch the person touch both silhouettes
(`silhouette_checks`), so the angles at which they do must be equal. Here each camera's attitude is adjusted by
least squares of these angles' differences (as pixels) over many frames, with a robust loss (masks have holes and
shadows) and a pull towards the attitude that was given, which also settles what turning all cameras together leaves
open. Places and lenses stay: silhouettes of one person in the middle hardly separate them from attitudes.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import least_squares

from studio.footage.calibration.boards import rays_of
from studio.footage.calibration.silhouette_checks import WIDEST, angles_about
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import rotation_from_vector

Outlines = Mapping[int, Mapping[str, Array]]

ROBUST_PIXELS = 4.0
"""From this miss on a tangent counts less and less: it may touch a shadow, or miss a hand that the mask lacks."""
TURN_SPREAD = np.radians(1.0)
"""A turn of this much costs what one tangent that misses by PULL pixels costs."""
PULL = 8.0
FEWEST_TANGENTS = 24


@dataclass(frozen=True, slots=True, eq=False)
class AlignedCameras:
    """cameras : turned, in order. turns : (V,) degrees that each was turned by. before, after : (V,) pixels by which
    tangents of pairs with this camera miss, median; NaN for a camera without such a pair. frames : used.
    """

    cameras: tuple[Camera, ...]
    turns: Array
    before: Array
    after: Array
    frames: tuple[int, ...]


def aligned_cameras(cameras: Sequence[Camera], outlines: Outlines) -> AlignedCameras:
    """Cameras turned about their centres so that outlines (`silhouette_checks.outlines_of`) agree best.

    Raises CalibrationError where fewer than 24 tangents are to be seen.
    """
    cameras = tuple(cameras)
    rays = _rays_in_cameras(cameras, outlines)
    start = np.zeros((len(cameras), 3))
    misses, _ = _misses(cameras, rays, start)
    if np.count_nonzero(np.isfinite(misses)) < FEWEST_TANGENTS:
        raise CalibrationError(
            "Too few silhouettes are complete in two views to align the cameras.",
            "Choose frames in which the person is completely in the pictures, or look at the masks.",
        )
    finite = np.isfinite(misses)

    def residuals(flat: Array) -> Array:
        turns = flat.reshape(-1, 3)
        missed = np.nan_to_num(_misses(cameras, rays, turns)[0][finite])
        robust = ROBUST_PIXELS * np.sqrt(2.0 * (np.sqrt(1.0 + (missed / ROBUST_PIXELS) ** 2) - 1.0))
        return np.concatenate([robust * np.sign(missed), PULL * flat / TURN_SPREAD])

    solution = least_squares(
        residuals,
        start.ravel(),
        x_scale=TURN_SPREAD,
        diff_step=1e-6,  # pyright: ignore[reportArgumentType] - one number for all
        max_nfev=60,
    )
    turns = np.asarray(solution.x, dtype=np.float64).reshape(-1, 3)
    return AlignedCameras(
        cameras=turned(cameras, turns),
        turns=np.degrees(np.linalg.norm(turns, axis=1)),
        before=_of_cameras(cameras, rays, start),
        after=_of_cameras(cameras, rays, turns),
        frames=tuple(sorted(outlines)),
    )


def turned(cameras: Sequence[Camera], turns: Array) -> tuple[Camera, ...]:
    """Cameras turned about their own centres by rotation vectors (V, 3), radians, in their own frames."""
    cameras_turned: list[Camera] = []
    for camera, turn in zip(cameras, turns, strict=True):
        rotation = rotation_from_vector(turn) @ camera.rotation
        cameras_turned.append(
            dataclasses.replace(camera, rotation=rotation, translation=-rotation @ camera.centre)
        )
    return tuple(cameras_turned)


def _rays_in_cameras(cameras: Sequence[Camera], outlines: Outlines) -> list[dict[str, Array]]:
    """For each frame, camera → (K, 3) unit directions of its outline in the camera's own frame."""
    own = {camera.name: camera for camera in cameras}
    return [
        {name: rays_of(own[name], points) @ own[name].rotation.T for name, points in views.items()}
        for _, views in sorted(outlines.items())
    ]


def _misses(
    cameras: Sequence[Camera], rays: Sequence[Mapping[str, Array]], turns: Array
) -> tuple[Array, Indices]:
    """(T,) signed misses in pixels, NaN where undetermined, and (T, 2) the cameras of each."""
    now = turned(cameras, turns)
    missed: list[float] = []
    pairs: list[tuple[int, int]] = []
    for views in rays:
        world = {camera.name: views[camera.name] @ camera.rotation for camera in now if camera.name in views}
        for one, two in combinations(range(len(now)), 2):
            first, second = now[one], now[two]
            if first.name in world and second.name in world:
                missed += _tangents(first, second, world[first.name], world[second.name])
                pairs += [(one, two)] * 2
    return np.array(missed), np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _tangents(one: Camera, two: Camera, first: Array, second: Array) -> tuple[float, float]:
    """Pixels by which the lower and the upper tangent plane of two outlines miss."""
    baseline = two.centre - one.centre
    axis = baseline / max(float(np.linalg.norm(baseline)), 1e-9)
    angles = angles_about(axis, (first, second))
    if angles is None or max(float(np.ptp(each)) for each in angles) > WIDEST:
        return float("nan"), float("nan")
    missed: list[float] = []
    for pick in (np.argmin, np.argmax):
        ends = [int(pick(each)) for each in angles]
        apart = float(angles[0][ends[0]] - angles[1][ends[1]])
        # A turn about the baseline moves a ray the less the nearer it is to that line.
        reach = [
            float(
                np.linalg.norm(np.cross(ray[end], axis)) * np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1])
            )
            for ray, end, camera in zip((first, second), ends, (one, two), strict=True)
        ]
        missed.append(apart * float(np.mean(reach)))
    return missed[0], missed[1]


def _of_cameras(cameras: Sequence[Camera], rays: Sequence[Mapping[str, Array]], turns: Array) -> Array:
    """(V,) median of the misses of the pairs with each camera, pixels."""
    missed, pairs = _misses(cameras, rays, turns)
    medians = np.full(len(cameras), np.nan)
    for number in range(len(cameras)):
        own = np.abs(missed[(pairs == number).any(axis=1)])
        own = own[np.isfinite(own)]
        if len(own):
            medians[number] = float(np.median(own))
    return medians
