"""A tree's sizes, and its poses in a few frames, from landmarks that were seen in several views.

Places of landmarks are linear in the tree's dimensions, so a body a dimension gives their exact slopes. Unknown are one
factor a dimension (left and right together), and each frame's pose; known are the pixels. Where these say nothing, a
dimension keeps its share of the whole body and an angle its rest value: weak pulls (`SIZE_SPREAD`, `ANGLE_SPREAD`)
whose share of the answer says how much the clicks decided.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np
import scipy.optimize
import scipy.sparse
import scipy.sparse.linalg

from studio.body.definition import MarkerEntry
from studio.body.dimensions import with_dimensions
from studio.body.dragging import root_joint
from studio.body.forward_kinematics import marker_points
from studio.body.inverse_kinematics import HEADINGS
from studio.body.least_squares import fitted_parameters, strictly_inside
from studio.body.mirroring import name_twins
from studio.body.model import BodyModel
from studio.body.reader import assemble
from studio.body.shape_space import dimension_kinds
from studio.foundations.arrays import Array, Indices, Mask
from studio.foundations.errors import BodyError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

SIZE_SPREAD = 0.3
"""Standard deviation of a dimension's share of the body, before anything was seen."""
ANGLE_SPREAD = 1.0
"""Radians, of an angle below the root from its rest value."""
BEYOND = math.radians(30.0)
"""By which a fitted angle may exceed the template's limits, which may be guesses."""
TIP = " tip"
SHRUNK, GROWN = 0.05, 20.0
"""Factors between which a dimension may change."""
DECIDED = 0.8
"""Share of a size that the clicks decided, from which it counts as decided by them."""
USUAL_NOISE, LEAST_NOISE, NOISIER = 2.0, 0.5, 1.5
"""Pixels, standard deviation of a click, as expected and at least; the factor by which it may be another one."""
ALIKE = 0.05
"""Share by which the body's scale may differ from that of the sizes decided."""
DECIDED_ANGLE = 0.2
"""Share of an angle's spread below which the clicks decided its value."""
FRAMES_LOOKED_AT = 3
FAINT = 1e-9
"""Keeps what nothing tells from being singular."""
SAME = 1e-6
DIFFERENCE = 1e-5
MOST_EVALUATIONS = 60


@dataclass(frozen=True, slots=True, eq=False)
class FrameClicks:
    """What was clicked of a frame, and agrees. camera, landmark : (N,) places of the clicks' cameras and landmarks.
    pixels : (N, 2). points : (M, 3) of all landmarks, mm, NaN where a frame does not have one.
    """

    camera: Indices
    landmark: Indices
    pixels: Array
    points: Array


@dataclass(frozen=True, slots=True, eq=False)
class FilmFit:
    """Sizes and poses that fit the clicks.

    body : of these sizes, its markers the landmarks.
    poses : (F, D).
    off : a frame's (N, 2) pixels from clicks to landmarks.
    scale : of the whole body beside the template.
    values : (G,) of the groups of dimensions, mm; deviations : (G,) their standard deviations, mm, by the clicks'
        scatter alone; decided : (G,) 0 to 1, the share of the answer that the clicks decided.
    turns : (D,) which parameters' values the clicks decided.
    noise : standard deviation of a click, pixels.
    """

    body: BodyModel
    poses: Array
    off: tuple[Array, ...]
    scale: float
    values: Array
    deviations: Array
    decided: Array
    turns: Mask
    noise: float


def landmark_names(body: BodyModel) -> tuple[str, ...]:
    """What can be clicked of a body: its markers, its joints, and the tips of its limbs."""
    return tuple(_landmark_entries(body))


def _landmark_entries(body: BodyModel) -> dict[str, MarkerEntry]:
    if body.definition is None:
        raise BodyError(f"Body '{body.name}' was not read from a file.", "Begin with a body that was.")
    entries = {one.name: one for one in body.definition.markers}
    for joint in body.definition.joints:
        entries.setdefault(joint.name, MarkerEntry(joint.name, joint.name, (0.0, 0.0, 0.0)))
    for limb in body.definition.limbs:
        name = limb.name + TIP
        entries.setdefault(name, MarkerEntry(name, limb.joint, (0.0, 0.0, limb.length)))
    return entries


class FilmedTree:
    """A body whose sizes are fitted.

    names : of the landmarks. groups : dimensions with one factor, each moves some landmark. free : (P,) parameters that
    move a landmark; the others keep their rest values. rooted : (P,) which of these move the whole body.
    """

    def __init__(self, body: BodyModel, names: Sequence[str], *, symmetric: bool = True) -> None:
        """Raises BodyError for a landmark that the body does not have."""
        known = _landmark_entries(body)
        for name in names:
            if name not in known:
                listed = ", ".join(known)
                raise BodyError(f"Body '{body.name}' has no landmark '{name[:64]}'.", f"Known: {listed}.")
        assert body.definition is not None
        definition = msgspec.structs.replace(body.definition, markers=tuple(known[name] for name in names))
        self.names = tuple(names)
        self.body = assemble(definition, body.name, body.dimensions)
        self.lengths = {
            name: value
            for name, value in body.dimensions.items()
            if definition.dimensions[name].mm is not None and not definition.dimensions[name].is_offset
        }
        self.groups = self._groups(symmetric)
        self.free = self._free()
        root = root_joint(self.body)
        of_root = self.body.joints[root].parameters if root >= 0 else ()
        self.rooted = np.isin(self.free, of_root)

    def _groups(self, symmetric: bool) -> tuple[tuple[str, ...], ...]:
        assert self.body.definition is not None
        kinds = dimension_kinds(self.body.definition)
        rest = marker_points(self.body, self.body.neutral)[0]
        moving = [
            name
            for name, value in self.lengths.items()
            if value > 0.0
            and kinds.get(name) != "radius"
            and np.abs(self._longer(self.body, name) - rest).max() > SAME
        ]
        twins = name_twins(moving).tolist() if symmetric else range(len(moving))
        pairs = {tuple(dict.fromkeys(sorted((at, twin)))) for at, twin in enumerate(twins)}
        return tuple(tuple(moving[at] for at in pair) for pair in sorted(pairs))

    @staticmethod
    def _longer(body: BodyModel, name: str) -> Array:
        longer = with_dimensions(body, {name: body.dimensions[name] + 1.0})
        return marker_points(longer, body.neutral)[0]

    def _free(self) -> Indices:
        """Parameters that move a landmark in some pose."""
        rng = np.random.default_rng(0)
        base = self.body.neutral + 0.3 * rng.standard_normal(len(self.body.parameters)) * self.body.angles
        steps = base + np.concatenate([np.zeros((1, len(base))), 0.1 * np.eye(len(base))])
        points = marker_points(self.body, steps)
        return np.flatnonzero(np.abs(points[1:] - points[0]).max(axis=(1, 2)) > SAME)

    @cached_property
    def rigid_pairs(self) -> tuple[Indices, Array]:
        """(K, 2) landmarks whose distance no pose changes, and the template's distances (K,), mm."""
        rng = np.random.default_rng(1)
        poses = self.body.neutral + rng.standard_normal((8, len(self.body.parameters))) * self.body.angles
        points = marker_points(self.body, poses)
        ones, others = np.triu_indices(len(self.names), 1)
        lengths = np.linalg.norm(points[:, ones] - points[:, others], axis=-1)
        rigid = (np.ptp(lengths, axis=0) < SAME * lengths.max(initial=1.0)) & (lengths[0] > SAME)
        return np.stack([ones[rigid], others[rigid]], axis=1), lengths[0, rigid]

    def scale(self, frames: Sequence[FrameClicks]) -> float:
        """The seen body beside the template: by distances that no pose changes, else by how far the landmarks spread.

        Raises BodyError where nothing can be compared.
        """
        points = np.stack([one.points for one in frames])
        pairs, lengths = self.rigid_pairs
        seen = np.linalg.norm(points[:, pairs[:, 0]] - points[:, pairs[:, 1]], axis=-1)
        ratios = (seen / lengths)[np.isfinite(seen)]
        if not len(ratios):
            rest = marker_points(self.body, self.body.neutral)[0]
            ratios = np.array([_spread(one, rest) for one in points])
            ratios = ratios[np.isfinite(ratios) & (ratios > 0.0)]
        if not len(ratios):
            raise BodyError(
                "The clicked landmarks say nothing of the body's size.",
                "Click both ends of a limb in the same frame, in two views.",
            )
        return float(np.median(ratios))

    def sized(self, scale: float, factors: Mapping[str, float]) -> BodyModel:
        """The body scaled, and its dimensions once more by their factors."""
        return with_dimensions(
            self.body, {name: scale * value * factors.get(name, 1.0) for name, value in self.lengths.items()}
        )

    def factors_by_name(self, factors: Array) -> dict[str, float]:
        """Factors of groups (G,) by dimension: of a pair, whose template may differ, both get the mean size."""
        by_name = dict[str, float]()
        for group, factor in zip(self.groups, factors, strict=True):
            mean = sum(self.lengths[name] for name in group) / len(group)
            by_name |= {name: float(factor) * mean / self.lengths[name] for name in group}
        return by_name


def _spread(points: Array, rest: Array) -> float:
    seen = np.isfinite(points).all(axis=1)
    if seen.sum() < 2:
        return math.nan
    sizes = [float(np.linalg.norm(one[seen] - one[seen].mean(axis=0))) for one in (points, rest)]
    return sizes[0] / sizes[1] if sizes[1] > SAME else math.nan


def fit_film(
    tree: FilmedTree,
    cameras: Sequence[Camera],
    frames: Sequence[FrameClicks],
    *,
    held: bool = False,
) -> FilmFit:
    """Sizes of the tree and its pose in each frame. held : the root is in the same place in all frames."""
    scale, sigma = tree.scale(frames), USUAL_NOISE
    factors = np.ones(len(tree.groups))
    poses = first_poses(tree, tree.sized(scale, {}), frames)
    for last in (False, False, True):
        problem = _Problem(tree, cameras, frames, scale, held=held, sigma=sigma, sized=True)
        factors, poses = problem.solved(factors, poses)
        # A frame that fits far worse than the rest stands in a wrong turn of its limbs: others' poses are tried.
        poses = problem.retried(factors, poses)
        fit = problem.fit(*problem.solved(factors, poses))
        ratio = _rescaled(tree, fit)
        if last or (abs(ratio - 1.0) < ALIKE and 1.0 / NOISIER < fit.noise / sigma < NOISIER):
            break
        scale, factors, poses, sigma = scale * ratio, factors / ratio, fit.poses, max(fit.noise, LEAST_NOISE)
    return fit


def _rescaled(tree: FilmedTree, fit: FilmFit) -> float:
    """The body's scale by the sizes that are decided, beside that to which the others were pulled."""
    decided = fit.decided >= DECIDED
    template = np.array([np.mean([tree.lengths[name] for name in group]) for group in tree.groups])
    return float(np.median((fit.values / template)[decided])) / fit.scale if decided.any() else 1.0


def fit_poses(
    tree: FilmedTree,
    cameras: Sequence[Camera],
    frames: Sequence[FrameClicks],
    body: BodyModel,
    near: Sequence[Array],
    *,
    held: bool = False,
) -> FilmFit:
    """The poses of a body of known sizes in frames. near : poses (D,) to begin with, besides the rest pose. held :
    whether its root is in the same place in all of them.
    """
    fixed = FilmedTree(body, tree.names)
    problem = _Problem(fixed, cameras, frames, 1.0, held=held, sigma=USUAL_NOISE, sized=False)
    none = np.ones(0)
    poses = problem.solved(none, first_poses(fixed, fixed.body, frames))[1]
    poses = problem.retried(none, poses, near)
    return problem.fit(none, problem.solved(none, poses)[1] if held else poses)


def first_poses(tree: FilmedTree, body: BodyModel, frames: Sequence[FrameClicks]) -> Array:
    """(F, D) poses of the body that come near the landmarks in space: the root from several headings, then all."""
    poses: list[Array] = []
    scale = np.where(body.angles[tree.free], 1.0, _mm_per_radian(body))
    for one in frames:
        seen = np.flatnonzero(np.isfinite(one.points).all(axis=1))
        starts = [body.neutral, *poses[-1:]]
        turned = [_turned(tree, body, start, turn) for start in starts for turn in range(HEADINGS)]
        rooted = tree.free[tree.rooted]
        fits = [_placed(body, pose, rooted, scale[tree.rooted], seen, one.points) for pose in turned]
        fits += [_placed(body, pose, rooted, scale[tree.rooted], seen, one.points) for pose in poses[-1:]]
        fits.sort(key=lambda entry: entry[1])
        whole = [_placed(body, pose, tree.free, scale, seen, one.points) for pose, _ in fits[:3]]
        poses.append(min(whole, key=lambda entry: entry[1])[0])
    return np.array(poses)


def _turned(tree: FilmedTree, body: BodyModel, pose: Array, turn: int) -> Array:
    turns = [int(at) for at in tree.free[tree.rooted] if body.angles[at]]
    changed = pose.copy()
    if turns:
        changed[turns[0]] += turn * 2.0 * math.pi / HEADINGS
    return np.clip(changed, body.lower, body.upper)


def _placed(
    body: BodyModel, pose: Array, free: Indices, scale: Array, seen: Indices, points: Array
) -> tuple[Array, float]:
    if not len(free) or not len(seen):
        return pose, 0.0
    lower, upper = _limits(body, free)
    mm = float(scale.max())
    begin = strictly_inside(pose[free], lower, upper) / scale
    pull = 0.02 * mm
    rest = body.neutral[free] / scale
    held = np.where(_returning(body)[free], pull, 0.0)

    def offsets(poses: Array) -> Array:
        return (marker_points(body, poses)[:, seen] - points[seen]).reshape(len(poses), -1)

    return fitted_parameters(
        pose,
        free,
        scale,
        begin,
        (lower / scale, upper / scale),
        offsets,
        lambda values: held * (values - rest),
        held,
        most=40,
        tolerance=1e-5,
    )


def _returning(body: BodyModel) -> Mask:
    """(D,) which parameters are drawn to their rest values: angles, and limbs' changes of length."""
    returning = body.angles
    returning[[limb.slide for limb in body.limbs if limb.slide >= 0]] = True
    return returning


def _limits(body: BodyModel, free: Indices) -> tuple[Array, Array]:
    room = np.where(body.angles, BEYOND, 0.0)[free]
    return body.lower[free] - room, body.upper[free] + room


def _mm_per_radian(body: BodyModel) -> float:
    """A length that counts like a radian: a quarter of the body's extent."""
    rest = marker_points(body, body.neutral)[0]
    return max(0.25 * float(np.linalg.norm(np.ptp(rest, axis=0))), 1e-3)


class _Problem:
    """Unknowns: G factors of dimensions, H shared root parameters if the body is held, and each frame's others."""

    def __init__(
        self,
        tree: FilmedTree,
        cameras: Sequence[Camera],
        frames: Sequence[FrameClicks],
        scale: float,
        *,
        held: bool,
        sigma: float,
        sized: bool,
    ) -> None:
        self.tree, self.cameras, self.frames, self.scale, self.sigma = tree, cameras, frames, scale, sigma
        self.groups = tree.groups if sized else ()
        body = tree.sized(scale, tree.factors_by_name(np.ones(len(tree.groups)))) if sized else tree.body
        self.base = body
        self.lower, self.upper = _limits(body, tree.free)
        self.unit = np.where(body.angles[tree.free], 1.0, _mm_per_radian(body))
        pulled = _returning(body)[tree.free] & ~tree.rooted
        self.pull = np.where(pulled, 1.0 / ANGLE_SPREAD, 0.0)
        self.rest = body.neutral[tree.free] / self.unit
        count, parameters = len(frames), len(tree.free)
        shared = tree.rooted & held
        own = np.cumsum(~shared) - 1
        self.columns = np.empty((count, parameters), dtype=np.int64)
        begin = len(self.groups)
        for frame in range(count):
            self.columns[frame, shared] = begin + np.arange(shared.sum())
            self.columns[frame, ~shared] = begin + shared.sum() + frame * (~shared).sum() + own[~shared]
        self.unknowns = begin + int(shared.sum()) + count * int((~shared).sum())
        self.directions = [self._direction(group) for group in self.groups]

    def _direction(self, group: tuple[str, ...]) -> BodyModel:
        """The body whose dimensions of a group are half as long again: places are linear in these."""
        longer = {name: 1.5 * self.base.dimensions[name] for name in group}
        return with_dimensions(self.base, longer)

    def body_of(self, factors: Array) -> BodyModel:
        if not self.groups:
            return self.base
        return self.tree.sized(self.scale, self.tree.factors_by_name(factors))

    def solved(self, factors: Array, poses: Array) -> tuple[Array, Array]:
        x = np.zeros(self.unknowns)
        x[: len(self.groups)] = factors
        lower, upper = np.full(self.unknowns, SHRUNK), np.full(self.unknowns, GROWN)
        low, high = self.lower / self.unit, self.upper / self.unit
        for frame, columns in enumerate(self.columns):
            x[columns] = strictly_inside(poses[frame, self.tree.free] / self.unit, low, high)
            lower[columns], upper[columns] = low, high
        answer = scipy.optimize.least_squares(
            self.residuals,
            x,
            self.slopes,
            (lower, upper),
            tr_solver="lsmr",
            max_nfev=MOST_EVALUATIONS,
            xtol=1e-6,
            ftol=1e-6,
        )
        return self.parted(answer.x)

    def parted(self, x: Array) -> tuple[Array, Array]:
        poses = np.repeat(self.base.neutral[None], len(self.frames), axis=0)
        poses[:, self.tree.free] = x[self.columns] * self.unit
        return x[: len(self.groups)], poses

    def whole(self, factors: Array, poses: Array) -> Array:
        x = np.zeros(self.unknowns)
        x[: len(self.groups)] = factors
        for frame, columns in enumerate(self.columns):
            x[columns] = poses[frame, self.tree.free] / self.unit
        return x

    def seen(self, frame: int, points: Array) -> Array:
        """(n, N, 2) where n sets of landmarks (n, M, 3) are seen by the clicks' cameras."""
        clicks = self.frames[frame]
        pixels = np.empty((len(points), len(clicks.camera), 2))
        places: list[int] = np.unique(clicks.camera).tolist()
        for place in places:
            chosen = clicks.camera == place
            pixels[:, chosen] = project(self.cameras[place], points[:, clicks.landmark[chosen]])[0]
        # Behind a camera nothing is seen: a click there is as wrong as can be, and no step ends there.
        return np.nan_to_num(pixels, nan=1e6)

    def off(self, factors: Array, poses: Array) -> list[Array]:
        points = marker_points(self.body_of(factors), poses)
        return [
            self.seen(frame, points[frame][None])[0] - clicks.pixels
            for frame, clicks in enumerate(self.frames)
        ]

    def residuals(self, x: Array) -> Array:
        factors, poses = self.parted(x)
        pulls = [self.pull * (x[columns] - self.rest) for columns in self.columns]
        seen = [one.ravel() / self.sigma for one in self.off(factors, poses)]
        return np.concatenate([*seen, (factors - 1.0) / SIZE_SPREAD, *pulls])

    def slopes(self, x: Array) -> scipy.sparse.csr_matrix:
        return scipy.sparse.vstack([self.seen_slopes(x), self.pulled_slopes()]).tocsr()

    def seen_slopes(self, x: Array) -> scipy.sparse.csr_matrix:
        """Of the clicks' residuals alone."""
        factors, poses = self.parted(x)
        body, count = self.body_of(factors), len(self.tree.free)
        steps = np.zeros((2 * count, poses.shape[1]))
        for place, (at, unit) in enumerate(zip(self.tree.free, self.unit, strict=True)):
            steps[place, at], steps[count + place, at] = DIFFERENCE * unit, -DIFFERENCE * unit
        longer = [
            2.0 * (marker_points(direction, poses) - marker_points(self.base, poses))
            for direction in self.directions
        ]
        now = marker_points(body, poses)
        rows: list[scipy.sparse.csr_matrix] = []
        for frame, clicks in enumerate(self.frames):
            stepped = self.seen(frame, marker_points(body, poses[frame] + steps))
            by_pose = (stepped[:count] - stepped[count:]) / (2.0 * DIFFERENCE)
            block = np.zeros((2 * len(clicks.camera), self.unknowns))
            block[:, self.columns[frame]] = by_pose.reshape(count, -1).T
            if longer:
                grown = np.stack([one[frame] for one in longer])
                ahead = self.seen(frame, now[frame] + DIFFERENCE * grown)
                behind = self.seen(frame, now[frame] - DIFFERENCE * grown)
                by_size = (ahead - behind) / (2.0 * DIFFERENCE)
                block[:, : len(longer)] = by_size.reshape(len(longer), -1).T
            rows.append(scipy.sparse.csr_matrix(block / self.sigma))
        return scipy.sparse.vstack(rows).tocsr()

    def pulled_slopes(self) -> scipy.sparse.csr_matrix:
        count = len(self.groups)
        columns = np.concatenate([np.arange(count), self.columns.ravel()])
        values = np.concatenate([np.full(count, 1.0 / SIZE_SPREAD), np.tile(self.pull, len(self.frames))])
        return scipy.sparse.csr_matrix(
            (values, (np.arange(len(values)), columns)), shape=(len(values), self.unknowns)
        )

    def costs(self, factors: Array, poses: Array) -> Array:
        """(F,) root of the mean squared residual, pixels."""
        return np.array([float(np.sqrt((one**2).mean())) for one in self.off(factors, poses)])

    def retried(self, factors: Array, poses: Array, near: Sequence[Array] = ()) -> Array:
        """The poses, those of badly fitting frames begun once more from the poses of others."""
        costs, body = self.costs(factors, poses), self.body_of(factors)
        usual = float(np.median(costs))
        poses = poses.copy()
        worst: list[int] = np.flatnonzero(costs > 2.0 * usual + self.sigma).tolist()
        best: list[int] = np.argsort(costs)[:3].tolist()
        for frame in worst:
            alone = _Problem(
                FilmedTree(body, self.tree.names),
                self.cameras,
                [self.frames[frame]],
                1.0,
                held=False,
                sigma=self.sigma,
                sized=False,
            )
            good = [poses[at] for at in best if at != frame]
            for start in [*near, *good]:
                trial = alone.solved(np.ones(0), start[None])[1]
                cost = alone.costs(np.ones(0), trial)[0]
                if cost < costs[frame]:
                    costs[frame], poses[frame] = cost, trial[0]
        return poses

    def fit(self, factors: Array, poses: Array) -> FilmFit:
        off = self.off(factors, poses)
        body = self.body_of(factors)
        count = len(self.groups)
        values = np.array([np.mean([body.dimensions[name] for name in group]) for group in self.groups])
        # How well a few frames decide the angles stands for all.
        looked = self.columns[:: max(1, len(self.frames) // FRAMES_LOOKED_AT)]
        wanted = np.concatenate([np.arange(count), looked.ravel()])
        seen, pulled = self.seen_slopes(self.whole(factors, poses)), self.pulled_slopes()
        both = seen.T @ seen + pulled.T @ pulled + FAINT * scipy.sparse.identity(self.unknowns)
        chosen = np.zeros((self.unknowns, len(wanted)))
        chosen[wanted, np.arange(len(wanted))] = 1.0
        spread: Array = scipy.sparse.linalg.splu(both.tocsc()).solve(chosen)[wanted, np.arange(len(wanted))]
        residuals = np.concatenate([one.ravel() for one in off]) / self.sigma
        noise = self.sigma * float(np.sqrt((residuals**2).sum() / max(1, len(residuals) - self.unknowns)))
        decided = np.clip(1.0 - spread[:count] / SIZE_SPREAD**2, 0.0, 1.0)
        own = noise / self.sigma * np.sqrt(np.maximum(spread[:count], 0.0))
        deviations = values / np.maximum(factors, SHRUNK) * own
        turns = np.zeros(len(self.base.parameters), dtype=np.bool_)
        angles = np.median(spread[count:].reshape(looked.shape), axis=0)
        turns[self.tree.free] = angles < DECIDED_ANGLE * ANGLE_SPREAD**2
        return FilmFit(
            body,
            poses,
            tuple(off),
            self.scale,
            np.asarray(values, np.float64),
            deviations,
            decided,
            turns,
            noise,
        )
