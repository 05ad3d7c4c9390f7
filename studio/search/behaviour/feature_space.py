"""Poses as points of the feature space: joint angles and how they change (Caillette et al. 2007, section 3.2).

X_t = (x_t, ẋ_t): x_t are the d pose parameters that are not global position and orientation, and ẋ_t = x_t - x_{t-1}
is their change per frame at `fps`, the convention of Eq. 4 (which adds ẋ without a time step).
"""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.model import MOVE, BodyModel
from studio.foundations.arrays import Array
from studio.foundations.errors import BehaviourError
from studio.foundations.words import counted

IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class FeatureSpace:
    """Which parameters of which body are modelled, and the frame rate that derivatives belong to.

    body : name of the body. parameters : names of all D entries of its pose vector. columns : (d,) places of the
    modelled ones, the rest being global. rest : (D,) a rest pose, for the other parameters. turning : (d,) bool, angles
    (rad; else lengths, mm). middle : (d,) middle of the limits, the rest pose's where there are none. fps : frames per
    second.
    """

    body: str
    parameters: tuple[str, ...]
    columns: IntArray
    rest: Array
    turning: NDArray[np.bool_]
    middle: Array
    fps: float

    @property
    def dimensions(self) -> int:
        """d, the number of modelled parameters; features have 2 d entries."""
        return len(self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the d modelled parameters."""
        return tuple(self.parameters[int(column)] for column in self.columns)

    def angles(self, poses: Array) -> Array:
        """(N, D) poses to the (N, d) modelled parameters, unchanged."""
        return self.checked(poses)[:, self.columns]

    def continuous(self, poses: Array) -> Array:
        """(F, D) poses of one recording in order to (F, d) without jumps by whole turns.

        Each angle is written so that half the recording lies nearest the middle of its limits: recordings of one
        movement lie on the same branch.
        """
        values = self.angles(poses)
        unwound = np.where(self.turning, np.unwrap(values, axis=0), values)
        turns = np.round((np.median(unwound, axis=0) - self.middle) / (2.0 * math.pi))
        return unwound - np.where(self.turning, 2.0 * math.pi * turns, 0.0)

    def features(self, poses: Array) -> Array:
        """(F, 2 d) features (x_t, ẋ_t) of one recording, F >= 2; the first frame has the second's derivative.

        Raises BehaviourError for a single frame, wrong shapes and values that are not finite.
        """
        if len(poses) < 2:
            raise BehaviourError(
                f"A recording of {counted(len(poses), 'frame')} has no derivatives.",
                "Give recordings of at least two frames.",
            )
        values = self.continuous(poses)
        changes = np.diff(values, axis=0)
        return np.concatenate([values, np.concatenate([changes[:1], changes])], axis=1)

    def poses(self, values: Array, rest: Array | None = None) -> Array:
        """(N, d) modelled parameters to (N, D) poses; the global ones from `rest` (D,), else the body's rest pose."""
        whole = np.repeat((self.rest if rest is None else np.asarray(rest))[None], len(values), axis=0)
        whole[:, self.columns] = values
        return whole

    def at_rate(self, fps: float) -> "FeatureSpace":
        """The same space at another frame rate."""
        return dataclasses.replace(self, fps=fps)

    def check_body(self, body: BodyModel) -> None:
        """Raise BehaviourError unless the body has this space's parameters (dimensions may differ)."""
        names = tuple(entry.name for entry in body.parameters)
        if names != self.parameters:
            raise BehaviourError(
                f"The behaviour model is of body '{self.body}' with {len(self.parameters)} parameters, "
                f"not of '{body.name}' with {len(names)}.",
                f"Learn one with `--body {body.name}`, or track with body '{self.body}'.",
            )

    def checked(self, poses: Array) -> Array:
        """The poses as a finite (N, D) array. Raises BehaviourError."""
        poses = np.asarray(poses, dtype=np.float64)
        if poses.ndim != 2 or poses.shape[1] != len(self.parameters):
            raise BehaviourError(
                f"Poses of shape {poses.shape} do not fit body '{self.body}'.",
                f"Give rows of {len(self.parameters)} parameters.",
            )
        if not np.isfinite(poses).all():
            frame = int(np.flatnonzero(~np.isfinite(poses).all(axis=1))[0])
            raise BehaviourError(
                f"The pose of frame {frame} holds a value that is not finite.",
                "Leave such frames out, and cut the recording there.",
            )
        return poses


def feature_space(body: BodyModel, fps: float) -> FeatureSpace:
    """The features of a body: all parameters but those of a root that moves and turns freely.

    fps : of the recordings. Raises BehaviourError for a body with only a root, and unless fps > 0.
    """
    if not (math.isfinite(fps) and fps > 0.0):
        raise BehaviourError(f"{fps:g} is not a valid frame rate.", "Give a number above 0.")
    root = _global(body)
    columns = np.array([row for row in range(len(body.parameters)) if row not in root], dtype=np.int64)
    if not len(columns):
        raise BehaviourError(
            f"Body '{body.name}' has only a position and an orientation.",
            "Take a body with joints.",
        )
    entries = [body.parameters[int(column)] for column in columns]
    limits = np.array([(entry.lower, entry.upper) for entry in entries])
    limited = np.isfinite(limits).all(axis=1)
    middle = body.neutral[columns]
    middle[limited] = limits[limited].mean(axis=1)
    return FeatureSpace(
        body=body.name,
        parameters=tuple(entry.name for entry in body.parameters),
        columns=columns,
        rest=body.neutral,
        turning=np.array([entry.kind == "angle" for entry in entries]),
        middle=middle,
        fps=float(fps),
    )


def _global(body: BodyModel) -> set[int]:
    """The parameters of joints on the world that can move: global position and orientation."""
    found: set[int] = set()
    for joint in body.joints:
        driven = [step for step in joint.steps if step.parameter >= 0]
        if joint.parent < 0 and any(step.kind == MOVE for step in driven):
            found.update(step.parameter for step in driven)
    return found
