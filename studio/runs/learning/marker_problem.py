"""Residuals of a body's markers and pointers against recorded ones, with slopes, for all frames at once."""

import numpy as np
from numpy.typing import NDArray

from studio.body.inverse_kinematics import pose_from_markers
from studio.body.model import BodyModel, Marker, kinematic_tables
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.runs.learning.marker_kernels import place_points
from studio.runs.learning.targets import Targets, pointers_of

Rows = NDArray[np.int64]
Flags = NDArray[np.bool_]

MM_PER_RADIAN = 400.0  # a length that counts like one radian: about a person's limb
POINTING_MM = 100.0  # a pointer counts like a marker this far along its limb
PULL = 4.0  # mm a radian off the pose before, frame by frame
FRAME_STEPS, DAMPING, LARGEST_DAMPING, SETTLED = 12, 1e-3, 1e3, 1e-4
HELD = 1e12
CHUNK = 400
FEWEST_MARKERS = 4


class MarkerProblem:
    """Poses here are scaled: one unit is a radian, or MM_PER_RADIAN.

    scale, lower, upper, rest : (D,). usable : (F,) whether a frame has enough markers. groups : parameter numbers of
    each limb. Raises StudioError where no frame is usable.
    """

    def __init__(self, body: BodyModel, targets: Targets) -> None:
        known = {marker.name: marker for marker in body.markers}
        kept = [place for place, name in enumerate(targets.names) if name in known]
        self.body, self.names = body, tuple(targets.names[place] for place in kept)
        self.points = np.ascontiguousarray(targets.points[:, kept])
        self._fix([known[name] for name in self.names], targets)
        self.scale = np.where(body.angles, 1.0, MM_PER_RADIAN)
        self.lower = body.lower / self.scale
        self.upper = body.upper / self.scale
        self.rest = body.neutral / self.scale
        limbs = [entry.limb for entry in body.parameters]
        self.groups = [
            np.flatnonzero([limb == name for limb in limbs]).astype(np.int64) for name in dict.fromkeys(limbs)
        ]
        self.present: Flags = np.all(np.isfinite(self.points), axis=2)
        self.usable: Flags = np.sum(self.present, axis=1) >= min(FEWEST_MARKERS, max(len(self.names), 1))
        if not self.usable.any():
            raise StudioError(
                f"No frame has markers of body '{body.name}'.", "Choose another recording or body."
            )

    def slopes(self, path: Array) -> tuple[Array, Array]:
        """Normal equations of every frame of a path (F, D): J'J (F, D, D) and J'r (F, D)."""
        count, width = path.shape
        normal, right = np.zeros((count, width, width)), np.zeros((count, width))
        for first in range(0, count, CHUNK):
            rows = np.arange(first, min(first + CHUNK, count))
            normal[rows], right[rows] = self._normal(path[rows], rows)
        return normal, right

    def costs(self, path: Array) -> Array:
        """(F,) sums of the squared residuals of the frames, mm²."""
        residuals, _ = self._residuals(path, np.arange(len(path)), slopes=False)
        return (residuals**2).sum(axis=1)

    def rms(self, path: Array) -> Array:
        """(F,) RMS in mm over the markers present; NaN where they are too few."""
        residuals, _ = self._residuals(path, np.arange(len(path)), slopes=False)
        squares = (residuals[:, : 3 * len(self.names)] ** 2).sum(axis=1)
        mean = squares / np.maximum(self.present.sum(axis=1), 1)
        return np.where(self.usable, np.sqrt(mean), np.nan)

    def searched(self, frame: int, start: Array) -> Array:
        """The pose (D,) of one frame from many starts."""
        present = self.present[frame]
        names = tuple(name for name, seen in zip(self.names, present, strict=True) if seen)
        pose, _ = pose_from_markers(self.body, names, self.points[frame, present], start * self.scale)
        return self.next(np.clip(pose / self.scale, self.lower, self.upper), frame)

    def next(self, before: Array, frame: int) -> Array:
        """The pose (D,) of a frame closest to the targets and, weakly, to the pose before."""
        rows, pose, damping = np.array([frame]), before, DAMPING
        now = self._cost(pose, before, rows)
        for _ in range(FRAME_STEPS):
            candidate = self._stepped(pose, before, rows, damping)
            then = self._cost(candidate, before, rows)
            if then < now:
                settled = now - then < SETTLED * now
                pose, now, damping = candidate, then, 0.3 * damping
                if settled:
                    break
            elif damping > LARGEST_DAMPING:
                break
            else:
                damping *= 10.0
        return pose

    def _cost(self, pose: Array, before: Array, rows: Rows) -> float:
        residuals, _ = self._residuals(pose[None], rows, slopes=False)
        return float((residuals**2).sum()) + PULL**2 * float(((pose - before) ** 2).sum())

    def _stepped(self, pose: Array, before: Array, rows: Rows, damping: float) -> Array:
        normal, right = self._normal(pose[None], rows)
        slope: Array = right[0] + PULL**2 * (pose - before)
        matrix: Array = normal[0] + PULL**2 * np.eye(len(pose))
        held = ((pose <= self.lower) & (slope > 0.0)) | ((pose >= self.upper) & (slope < 0.0))
        matrix += np.diag(damping * np.diag(matrix) + np.where(held, HELD, 0.0))
        step = np.linalg.solve(matrix, np.where(held, 0.0, -slope))
        return np.clip(pose + step, self.lower, self.upper)

    def _normal(self, poses: Array, rows: Rows) -> tuple[Array, Array]:
        now, slopes = self._residuals(poses, rows, slopes=True)
        return slopes @ slopes.transpose(0, 2, 1), (slopes @ now[..., None])[..., 0]

    def _fix(self, markers: list[Marker], targets: Targets) -> None:
        """Set where markers and pointers are fixed on the body, and their targets (F, P, 3)."""
        pointers = [
            pointer for pointer in pointers_of(self.body, movable=True) if pointer.limb in targets.directions
        ]
        self._joints = np.array([entry.joint for entry in (*markers, *pointers)], dtype=np.int64)
        offsets = [marker.offset for marker in markers]
        offsets += [POINTING_MM * pointer.axis for pointer in pointers]
        self._offsets = np.array(offsets, dtype=float).reshape(-1, 3)
        self._is_point = np.arange(len(self._joints)) < len(markers)
        along = [POINTING_MM * targets.directions[pointer.limb][:, None] for pointer in pointers]
        self._goals = np.concatenate([self.points, *along], axis=1)
        self._seen: Flags = np.all(np.isfinite(self._goals), axis=2)
        self._goals = np.where(self._seen[..., None], self._goals, 0.0)

    def _residuals(self, poses: Array, rows: Rows, *, slopes: bool) -> tuple[Array, Array]:
        """Residuals (N, R) in mm of poses (N, D) in the frames `rows`, and their slopes (N, D, R) if `slopes`.

        Missing targets have residual 0.
        """
        tables, (count, width) = kinematic_tables(self.body), poses.shape
        places = np.zeros((count, len(self._joints), 3))
        along = np.zeros((count, width if slopes else 0, len(self._joints), 3))
        place_points(
            np.ascontiguousarray(poses * self.scale),
            *(tables.parent, tables.first_step, tables.step_kind, tables.step_axis),
            *(tables.step_parameter, tables.step_value),
            *(self._joints, self._offsets, self._is_point, places, along),
        )
        seen = self._seen[rows][..., None]
        apart = np.where(seen, places - self._goals[rows], 0.0).reshape(count, -1)
        if not slopes:
            return apart, along
        along *= self.scale[:, None, None] * seen[:, None]
        return apart, along.reshape(count, width, -1)
