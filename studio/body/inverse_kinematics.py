"""The pose whose markers come closest to given points.

Least squares over the pose, limits respected where finite (trust region, scipy). The root is found first:
from several headings of the start and of the rest pose the root alone is fitted; the best of these are then
fitted whole. While markers stay away, the best pose is perturbed and fitted again, with the same random numbers
in every call. A pull towards the start, far too weak to move a marker, determines what the points leave open
(twists of straight limbs).
"""

import math
from collections.abc import Sequence

import numpy as np

from studio.body.branches import within_limits
from studio.body.forward_kinematics import marker_points
from studio.body.least_squares import fitted_parameters, strictly_inside
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import BodyError

# Headings tried for the root, evenly around; starts that are fitted whole.
HEADINGS = 8
FULL_FITS = 4

# Fits of the perturbed best pose; standard deviation (radians) of the noise on its angles below the root.
SHAKES = 12
SHAKE = 0.7

# A length that counts like one radian: about a person's limb.
MM_PER_RADIAN = 400.0

# Residual (mm) of one radian off the start; against markers of 1 mm it moves no joint by 0.01 mm.
PULL = 0.02

# A root fit with a smaller error (mm) is not improved by other starts.
EXACT = 0.5


def pose_from_markers(
    body: BodyModel, names: tuple[str, ...], points: Array, start: Array
) -> tuple[Array, float]:
    """The pose (D,) that brings the named markers to the points, and the remaining distance (RMS, mm).

    names : markers of the body. points : (M, 3) world, mm; rows with a NaN are missing and ignored.
    start : (D,) where the search starts, rewritten into the limits first (`branches.within_limits`); angles end
    within half a turn of it where limits allow. Raises BodyError for an unknown marker, for shapes that do not
    fit and when no point is left.
    """
    problem = _MarkerProblem(body, names, points, start)
    rng = np.random.default_rng(0)
    candidates = problem.starts()
    best, error = problem.start, math.inf
    for attempt in range(len(candidates) + SHAKES):
        shaken = attempt >= len(candidates)
        candidate = problem.shaken(rng, best) if shaken else candidates[attempt]
        pose = problem.fitted(candidate, problem.everything)
        if problem.error(pose) < error:
            best, error = pose, problem.error(pose)
        if error < EXACT:
            break
    return problem.unwound(best), error


def known_markers(body: BodyModel, names: Sequence[str]) -> tuple[list[int], tuple[str, ...]]:
    """The markers of the body among `names`: their places in `names`, and their names."""
    known = {marker.name for marker in body.markers}
    places = [place for place, name in enumerate(names) if name in known]
    return places, tuple(names[place] for place in places)


class _MarkerProblem:
    def __init__(self, body: BodyModel, names: tuple[str, ...], points: Array, start: Array) -> None:
        known = {marker.name: place for place, marker in enumerate(body.markers)}
        for name in names:
            if name not in known:
                listed = ", ".join(known) or "none"
                raise BodyError(f"Body '{body.name}' has no marker '{name}'.", f"Its markers: {listed}.")
        points, start = np.asarray(points, dtype=float), np.asarray(start, dtype=float)
        if points.shape != (len(names), 3) or start.shape != (len(body.parameters),):
            cause = f"Points {points.shape} and start {start.shape} do not fit body '{body.name}'"
            hint = f"Give {len(names)} points (x, y, z) and {len(body.parameters)} parameters."
            raise BodyError(f"{cause} and {len(names)} markers.", hint)
        present = np.isfinite(points).all(axis=1)
        if not present.any() or not np.isfinite(start).all():
            raise BodyError(
                "No marker has a position, or the start pose holds a NaN.", "Choose another frame."
            )
        self.body = body
        self.places = np.array([known[name] for name in names])[present]
        self.points = points[present]
        self.scale = np.where(body.angles, 1.0, MM_PER_RADIAN)
        self.lower, self.upper = body.lower, body.upper
        self.start = np.clip(within_limits(body, start), self.lower, self.upper)
        self.everything = np.arange(len(body.parameters))
        self.root, self.turns, self.moves = _root(body)

    def starts(self) -> list[Array]:
        """Poses to fit whole: the start, then the best of those with a fitted root."""
        if not len(self.moves):
            return [self.start, self.body.neutral]
        candidates: list[tuple[float, Array]] = []
        for base in (self.start, self.body.neutral):
            for turn in range(HEADINGS):
                pose = base.copy()
                if len(self.turns):
                    pose[self.turns[0]] += turn * 2.0 * math.pi / HEADINGS
                pose = self.fitted(self.centred(np.clip(pose, self.lower, self.upper)), self.root)
                candidates.append((self.error(pose), pose))
        candidates.sort(key=lambda entry: entry[0])
        return [self.start, *(pose for _, pose in candidates[:FULL_FITS])]

    def shaken(self, rng: np.random.Generator, pose: Array) -> Array:
        """The pose with random changes to the angles below the root."""
        noise = SHAKE * rng.standard_normal(len(pose)) * (self.scale == 1.0)
        noise[self.root] = 0.0
        return np.clip(pose + noise, self.lower, self.upper)

    def centred(self, pose: Array) -> Array:
        """The pose moved so that its markers' middle is the points'."""
        shifted = pose.copy()
        away = (self.points - marker_points(self.body, pose)[0, self.places]).mean(axis=0)
        for place, axis in zip(self.moves, _axes(self.body, self.moves), strict=True):
            shifted[place] += away[axis]
        return np.clip(shifted, self.lower, self.upper)

    def fitted(self, pose: Array, free: Indices) -> Array:
        """The pose with its `free` parameters at the least squares."""
        scale, lower, upper = self.scale[free], self.lower[free], self.upper[free]
        pull = PULL * (pose if free is not self.everything else self.start)[free] / scale

        return fitted_parameters(
            pose,
            free,
            scale,
            strictly_inside(pose[free], lower, upper) / scale,
            (lower / scale, upper / scale),
            self.offsets,
            lambda values: PULL * values - pull,
            np.full(len(free), PULL),
            most=200,
        )[0]

    def offsets(self, poses: Array) -> Array:
        """(N, 3 M) from the points to the poses' markers, mm."""
        return (marker_points(self.body, poses)[:, self.places] - self.points).reshape(len(poses), -1)

    def error(self, pose: Array) -> float:
        """Root of the mean squared distance of markers and points, mm."""
        offsets = self.offsets(pose[None]).reshape(-1, 3)
        return float(np.sqrt((offsets**2).sum(axis=1).mean()))

    def unwound(self, pose: Array) -> Array:
        """The pose with every angle as close to the start as whole turns within its limits allow."""
        turns = np.round((pose - self.start) / (2.0 * math.pi)) * 2.0 * math.pi
        nearer = pose - np.where(self.body.angles, turns, 0.0)
        return np.where((nearer >= self.lower) & (nearer <= self.upper), nearer, pose)


def _root(body: BodyModel) -> tuple[Indices, Indices, Indices]:
    """The parameters of the first joint that moves: all, its angles, its lengths."""
    for joint in body.joints:
        if used := joint.parameters:
            turns = [place for place in used if body.parameters[place].kind == "angle"]
            moves = [place for place in used if body.parameters[place].kind == "length"]
            return np.array(used), np.array(turns, dtype=np.int64), np.array(moves, dtype=np.int64)
    return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64)


def _axes(body: BodyModel, moves: Indices) -> list[int]:
    """The axis along which each of the root's lengths moves the body."""
    axis = {step.parameter: step.axis for joint in body.joints for step in joint.steps}
    return [axis[int(place)] for place in moves]
