"""Motion of the root in each cluster: turning in a pirouette, little in a stance (beyond Caillette, Galata & Howard
2007, section 5.2).

The paper moves the six global parameters with Gaussian noise of unspecified width. One width for a whole dance is wrong
everywhere: in the reproduction's exercises the heading changes by 1 degree a frame in most frames and by 24 in a
pirouette. So each cluster has its own Gaussian, learnt from the same frames, of the root's change in a frame,
the horizontal parameters relative to the body's heading. Labels and features do not use it; behaviour is still joint
angles and their derivatives alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.model import MOVE, TURN, BodyModel, Joint, Step
from studio.foundations.arrays import Array
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.prediction_kernels import rooted_noise
from studio.search.behaviour.reduction import full_clusters

IntArray = NDArray[np.int64]

LEAST_SHARE = 1e-3
"""Least variance of a parameter in a cluster, as a share of that over the whole training."""
LEAST_VARIANCE = 1e-12
UP = 2


@dataclass(frozen=True, slots=True, eq=False)
class RootFrame:
    """The parameters of a root that moves freely, and which of them are horizontal.

    columns : (r,) places in the pose vector. turning : (r,) bool, angles (rad; else mm). heading : place in the pose
    vector of the turn about the vertical that comes first, -1 for none. level : (2,) entries of `columns` that move
    along the world's x and y, or none (0,).
    """

    columns: IntArray
    turning: NDArray[np.bool_]
    heading: int
    level: IntArray

    def changes(self, poses: Array) -> Array:
        """(F, r) changes into every frame of poses (F, D) of one recording, horizontally relative to the heading of the
        frame before; the first frame has the second's.
        """
        moved = np.diff(poses[:, self.columns], axis=0)
        wrapped = (moved + math.pi) % (2.0 * math.pi) - math.pi
        moved = np.where(self.turning, wrapped, moved)
        moved = self._turned(moved, -self._headings(poses[:-1]))
        return np.concatenate([moved[:1], moved])

    def moved(self, poses: Array, changes: Array) -> Array:
        """(N, D) poses (N, D) with changes (N, r), as `changes` gives them, added."""
        found = poses.copy()
        found[:, self.columns] += self._turned(changes, self._headings(poses))
        return found

    def _headings(self, poses: Array) -> Array:
        return poses[:, self.heading] if self.heading >= 0 else np.zeros(len(poses))

    def _turned(self, changes: Array, angles: Array) -> Array:
        if not len(self.level):
            return changes
        found, (east, north) = changes.copy(), self.level
        cosine, sine = np.cos(angles), np.sin(angles)
        found[:, east] = cosine * changes[:, east] - sine * changes[:, north]
        found[:, north] = sine * changes[:, east] + cosine * changes[:, north]
        return found


@dataclass(frozen=True, slots=True, eq=False)
class RootMotion:
    """Gaussians of the root's change per frame, one a cluster. changes : means (K, r), covariances (K, r, r)."""

    frame: RootFrame
    changes: GaussianMixture

    def at_ratio(self, ratio: float) -> "RootMotion":
        """The motion for frames that last `ratio` times as long."""
        return RootMotion(self.frame, self.changes.mapped(ratio * np.eye(len(self.frame.columns))))

    def joined(self, other: GaussianMixture) -> "RootMotion":
        """The motion with the clusters of `other` appended."""
        own = self.changes
        pairs = ((own.weights, other.weights), (own.means, other.means), (own.covariances, other.covariances))
        return RootMotion(self.frame, GaussianMixture(*(np.concatenate(pair) for pair in pairs)))

    def moved(self, rng: np.random.Generator, poses: Array, labels: IntArray, spread: float = 1.0) -> Array:
        """(N, D) poses (N, D) of particles in clusters `labels` (N,) a frame later, their roots only.

        spread : multiplies the clusters' standard deviations.
        """
        normals = rng.standard_normal((len(poses), len(self.frame.columns)))
        noise = rooted_noise(self.changes.roots, labels, normals)
        return self.frame.moved(poses, self.changes.means[labels] + spread * noise)


def root_frame(body: BodyModel) -> RootFrame | None:
    """The root of a body; None where it is fixed to the world or has several."""
    joints = [joint for joint in body.joints if joint.parent < 0]
    driven = [step for joint in joints for step in joint.steps if step.parameter >= 0]
    if len(joints) != 1 or not any(step.kind == MOVE for step in driven):
        return None
    heading = _heading(joints[0])
    level = [_place_of_move(driven, axis) for axis in (0, 1)]
    return RootFrame(
        np.array([step.parameter for step in driven], dtype=np.int64),
        np.array([step.kind == TURN for step in driven]),
        heading,
        np.array([] if heading < 0 or -1 in level else level, dtype=np.int64),
    )


def learn_root_motion(body: BodyModel, recordings: Sequence[Array], shares: Array) -> RootMotion | None:
    """The root motion of recordings of poses (F, D); shares : (all F, K) of every frame in every cluster. None without
    a root.
    """
    frame = root_frame(body)
    if frame is None:
        return None
    changes = np.concatenate([frame.changes(poses) for poses in recordings])
    return RootMotion(frame, gaussians_of(changes, shares))


def gaussians_of(changes: Array, shares: Array) -> GaussianMixture:
    """One Gaussian a cluster of changes (n, r), by the shares (n, K) of the frames in it; a cluster of few frames is
    shrunk to the common one.
    """
    return full_clusters(changes, shares, np.maximum(LEAST_SHARE * changes.var(axis=0), LEAST_VARIANCE))


def _heading(joint: Joint) -> int:
    """The parameter of a joint's first turn, if that is about the vertical; else -1."""
    first = next((step for step in joint.steps if step.kind == TURN), None)
    return first.parameter if first is not None and first.axis == UP and first.value == 1.0 else -1


def _place_of_move(driven: Sequence[Step], axis: int) -> int:
    """Which of the driven steps moves along a world axis, -1 for none."""
    places = [
        place
        for place, step in enumerate(driven)
        if step.kind == MOVE and step.axis == axis and step.value == 1.0
    ]
    return places[0] if places else -1
