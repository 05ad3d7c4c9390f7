"""Position and orientation of a body from its hull alone (Caillette, Galata & Howard 2007, section 6.2, Fig.
7: global position and orientation from the voxels' mean and principal axes).

The hull's mean gives the position, its principal axes the orientation: the mean and axes of the body's own cones, in a
given pose (the neutral one, a motion prototype), are aligned with them. Axes have no sign and a person is about as
deep as wide in a hull, so there are several candidates; only the pictures can decide between them.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from studio.body.forward_kinematics import joint_frames
from studio.body.model import MOVE, BodyModel
from studio.body.scale import scale_of
from studio.evidence.volume.blob_model import cone_blobs
from studio.evidence.volume.hull import Hull
from studio.foundations.arrays import Array

IntArray = NDArray[np.int64]

MM_OF_ROTATION = 1000.0
"""mm that an error of 1 in a rotation matrix's entry counts as."""
NEARLY_ROUND = 0.6
"""Where the lesser horizontal variance is more than this share of the greater one, quarter turns are candidates too."""
STARTS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """A volume's mean (3,) mm and second moments about it, covariance (3, 3) mm²."""

    mean: Array
    covariance: Array

    def principal(self) -> Array:
        """(3, 3) the principal axes as columns, the longest first, right-handed."""
        axes = np.linalg.eigh(self.covariance)[1][:, ::-1].copy()
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        return axes

    def heading(self) -> float:
        """Angle of the longer horizontal axis from x, radians, within a half turn."""
        flat = self.covariance[:2, :2]
        return 0.5 * float(np.arctan2(2.0 * flat[0, 1], flat[0, 0] - flat[1, 1]))

    def roundness(self) -> float:
        """The lesser horizontal variance as a share of the greater: 1 for a round volume."""
        variances = np.linalg.eigvalsh(self.covariance[:2, :2])
        return float(variances[0] / variances[1])


def axes_of_hull(hull: Hull) -> Axes:
    """The mean and moments of a hull's volume. Raises ValueError for an empty hull."""
    if len(hull.centres) == 0:
        raise ValueError("An empty hull has no axes.")
    shares = hull.weights()
    mean = shares @ hull.centres
    apart = hull.centres - mean
    own = float(shares @ hull.edges**2) / 12.0
    return Axes(mean, (apart * shares[:, None]).T @ apart + own * np.eye(3))


def axes_of_pose(body: BodyModel, pose: Array) -> Axes:
    """The mean and moments of the body's cones in a pose (D,). Raises BodyError for a pose that is not the body's."""
    blobs = cone_blobs(body).mixture(body, pose)
    shares, means = blobs.weights, blobs.means[0]
    mean = shares @ means
    apart = means - mean
    inner = np.einsum("b,bij->ij", shares, blobs.covariances[0])
    return Axes(mean, inner + (apart * shares[:, None]).T @ apart)


def root_parameters(body: BodyModel) -> IntArray:
    """The parameters that place the whole body in the world: those of the joint that hangs on the world. Empty
    for a body that is fixed to the world.
    """
    roots = [joint for joint in body.joints if joint.parent < 0]
    free = [
        joint for joint in roots if any(step.kind == MOVE and step.parameter >= 0 for step in joint.steps)
    ]
    if len(roots) != 1 or not free:
        return np.zeros(0, dtype=np.int64)
    return np.array(free[0].parameters, dtype=np.int64)


def root_candidates(body: BodyModel, hull: Hull, pose: Array, *, upright: bool = True) -> Array:
    """(C, D) the pose (D,) with its root aligned to the hull, other parameters unchanged.

    upright : turn it about the vertical only: both facings along the hull's longer horizontal axis, then, where the
    hull is nearly round, both across it. Else all three principal axes are aligned, in the four ways that are
    rotations. A body fixed to the world has one candidate, the pose. Raises ValueError for an empty hull.
    """
    parameters = root_parameters(body)
    if not len(parameters):
        return np.array(pose, dtype=np.float64)[None]
    seen, own = axes_of_hull(hull), axes_of_pose(body, pose)
    root = next(index for index, joint in enumerate(body.joints) if joint.parent < 0)
    frame = joint_frames(body, pose)[0, root]
    turns = _headings(seen, own) if upright else _axis_turns(seen, own)
    poses: list[Array] = []
    for turn in turns:
        origin = turn @ (frame[:, 3] - own.mean) + seen.mean
        target = np.column_stack([turn @ frame[:, :3], origin])
        poses.append(with_root_at(body, root, parameters, pose, target))
    return np.stack(poses)


def _headings(seen: Axes, own: Axes) -> list[Array]:
    """Turns about the vertical that align one's longer horizontal axis with the other's, or put it across."""
    between = seen.heading() - own.heading()
    quarters = (0, 2, 1, 3) if max(seen.roundness(), own.roundness()) > NEARLY_ROUND else (0, 2)
    turns: list[Array] = []
    for quarter in quarters:
        angle = between + quarter * 0.5 * np.pi
        cosine, sine = np.cos(angle), np.sin(angle)
        turns.append(np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]))
    return turns


def _axis_turns(seen: Axes, own: Axes) -> list[Array]:
    """The four rotations that align principal axes with principal axes."""
    to, of = seen.principal(), own.principal()
    signs = [np.array([a, b, a * b]) for a, b in itertools.product((1.0, -1.0), repeat=2)]
    return [(to * sign) @ of.T for sign in signs]


def with_root_at(body: BodyModel, root: int, parameters: IntArray, pose: Array, target: Array) -> Array:
    """The pose (D,) with the root's `parameters` that bring the frame of joint `root` nearest to `target` (3, 4)."""
    length = MM_OF_ROTATION * scale_of(body)
    scale = np.array([[length] * 3 + [1.0]] * 3)
    angles = body.angles[parameters]
    made = np.array(pose, dtype=np.float64)

    def apart(values: Array) -> Array:
        made[parameters] = values
        return ((joint_frames(body, made)[0, root] - target) * scale).ravel()

    best, least = made[parameters].copy(), np.inf
    for start in range(STARTS):
        # The first of the root's turns is the heading in every body here; others are found from any start.
        first = np.array(pose, dtype=np.float64)[parameters]
        first[np.flatnonzero(angles)[:1]] += 2.0 * np.pi * start / STARTS
        fit = least_squares(apart, first, x_scale=np.where(angles, 1.0, length))
        if fit.cost < least:
            best, least = fit.x, fit.cost
        if least < 1e-6:
            break
    made[parameters] = best
    return made
