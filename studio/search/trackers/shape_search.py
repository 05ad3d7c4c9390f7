"""A body's size and its poses in a few frames, found together by annealing a population on the frames' silhouettes.

A particle is a shape (a few logarithms, `body.shape_space`) and a pose in every frame. All frames together in one state
would have hundreds of dimensions, but given the shape the frames are independent, so each layer

1. moves the shapes (noise in proportion to the survivors' own spread, Deutscher & Reid 2005, Eq. 18, in full
   covariance), and with each shape its poses, so that joints move as little as possible (`carried`):
   a longer thigh bends the knee instead of pushing the foot through the floor;
2. tries in each frame fifteen changes of the pose, each of one limb's parameters or of all, and keeps the best of these
and the unchanged pose; some are the same limb taken from another particle in that frame (crossover);
3. weighs each particle by the sum over the frames, with the prior of the shapes, at a β with which the chosen
share of particles survives (Eqs. 11, 12), and draws the next ones, always keeping the best.

The answer is the mean shape of the last layers' survivors. It finds the valley, lost limbs included;
`shape_refinement` descends to its minimum and gives the result's uncertainty.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.shape_space import ShapeSpace
from studio.foundations.arrays import Array
from studio.search.likelihood.shape_silhouettes import POSES, ShapeSilhouettes
from studio.search.trackers.annealing import anneal, normalised
from studio.search.trackers.lost_limbs import lost_limbs_found
from studio.search.trackers.shape_prior import ShapePrior

Progress = Callable[[int, int], None]

SHARPNESS = 250.0
"""Log weight of one frame's f_s from 0 to 1. A person is no set of cones: a hundredth more in f_s may be a fold of
cloth, so it may not outweigh the prior of people's proportions (in each of five frames: e^12.5)."""
RIDGE = 0.02
"""Cost of moving a pose parameter when poses follow the shape, as a share of the Jacobian's size."""
KEPT = 0.25
"""Share of the layers, the last ones, that are averaged for the result."""
STEP = 1e-4


@dataclass(frozen=True, slots=True)
class ShapeSearchSettings:
    """How much is searched. particles : M. layers : in all. survival : share of particles that survive a layer.

    pose_steps : how often the poses of a layer are improved. drawn : initial samples of each limb, 0 for
    none.
    """

    particles: int = 24
    layers: int = 40
    survival: float = 0.4
    pose_steps: int = 2
    drawn: int = 4096


@dataclass(frozen=True, slots=True, eq=False)
class FoundShape:
    """shape : (S,) logarithms. poses : (F, D) that go with the shape. fitness, before : (F,) f_s of them and of the
    first shape and poses. evaluations : poses weighed.
    """

    shape: Array
    poses: Array
    fitness: Array
    before: Array
    evaluations: int


@dataclass(slots=True, eq=False)
class _Population:
    """shapes (M, S), poses (M, F, D), fitness (M, F)."""

    shapes: Array
    poses: Array
    fitness: Array = field(default_factory=lambda: np.empty(0))


class ShapeSearch:
    """One search.

    silhouettes : the frames. limits : (2, D) of the poses. spread : (D,) how far poses may be off at first (radians,
    mm). limb_of : (D,) number of the limb that each parameter belongs to. prior : of the shapes.
    """

    def __init__(
        self,
        silhouettes: ShapeSilhouettes,
        limits: Array,
        spread: Array,
        limb_of: NDArray[np.int64],
        prior: ShapePrior,
        *,
        settings: ShapeSearchSettings | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> None:
        self._silhouettes, self._limits, self._spread = silhouettes, limits, spread
        self._limbs = [np.flatnonzero(limb_of == limb) for limb in np.unique(limb_of)]
        self._settings = settings or ShapeSearchSettings()
        self._rng = np.random.default_rng(np.random.SeedSequence((seed, 0x5AB)))
        self._progress = progress
        self._space: ShapeSpace = silhouettes.programs.space
        self._prior, self._sigma = prior, prior.sigma
        self.evaluations = 0

    def run(self, poses: Array) -> FoundShape:
        """The shape and the poses, from poses (F, D) of the space's own body."""
        rules, rng = self._settings, self._rng
        count = rules.particles
        before = self.fitness(np.zeros(len(self._sigma)), poses)
        poses = self.draw_limbs(poses)
        first = _Population(np.zeros((count, len(self._sigma))), np.repeat(poses[None], count, axis=0))
        now = first
        kept: list[tuple[Array, Array]] = []
        for layer in range(rules.layers):
            if self._progress is not None:
                self._progress(layer, rules.layers)
            heat = 1.0 - layer / rules.layers
            moved = self._moved(now, layer, heat)
            for _ in range(rules.pose_steps):
                self._improve(moved, heat)
            total = SHARPNESS * moved.fitness.sum(axis=1) + self._prior.log(moved.shapes)
            weights = tempered(total, rules.survival)
            if layer >= round((1.0 - KEPT) * rules.layers):
                kept.append((weights, moved.shapes))
            chosen = rng.choice(count, count, p=weights)
            chosen[0] = int(np.argmax(total))
            now = _Population(moved.shapes[chosen], moved.poses[chosen], moved.fitness[chosen])
        return self._answer(now, kept, before)

    def _moved(self, now: _Population, layer: int, heat: float) -> _Population:
        """New shapes around the population's, with poses carried along."""
        rng = self._rng
        if layer == 0:
            steps = rng.normal(size=now.shapes.shape) * self._sigma
        else:
            away = now.shapes - now.shapes.mean(axis=0)
            floor = np.diag(np.square(self._sigma * (0.02 + 0.08 * heat)))
            covariance = 0.3 * away.T @ away / len(away) + floor
            steps = rng.multivariate_normal(np.zeros(len(covariance)), covariance, len(away))
        steps[0] = 0.0
        moved = _Population(now.shapes + steps, np.empty_like(now.poses))
        middle = now.shapes.mean(axis=0)
        for k in range(now.poses.shape[1]):
            follow = self.carried(middle, now.poses[0, k])
            moved.poses[:, k] = self._within(now.poses[:, k] + steps @ follow.T)
        return moved

    def carried(self, shape: Array, pose: Array) -> Array:
        """(D, S) change of a pose over the shape that moves the ends of limbs least."""
        body, scale = self._space.body_of(shape), self._spread
        nudged = pose + np.vstack([np.zeros(len(pose)), np.diag(STEP * scale)])
        ends = limb_ends(body, nudged).reshape(len(nudged), -1)
        by_pose = (ends[1:] - ends[0]).T / STEP
        by_shape = np.stack(
            [
                (limb_ends(self._space.body_of(shape + STEP * unit), pose[None]).ravel() - ends[0]) / STEP
                for unit in np.eye(len(shape))
            ],
            axis=1,
        )
        ridge = RIDGE * np.linalg.norm(by_pose) / np.sqrt(len(pose)) * np.eye(len(pose))
        stacked = np.vstack([by_pose, ridge])
        wanted = np.vstack([-by_shape, np.zeros((len(pose), len(shape)))])
        return scale[:, None] * np.linalg.lstsq(stacked, wanted, rcond=None)[0]

    def _improve(self, now: _Population, heat: float) -> None:
        """Replace each pose by the best of sixteen around it."""
        rng = self._rng
        count, frames, _ = now.poses.shape
        tried = np.repeat(now.poses[:, :, None], POSES, axis=2)
        scale = 10.0 ** rng.uniform(-1.7, -0.7 + 0.7 * heat, (count, frames, POSES, 1))
        noise = rng.normal(size=tried.shape) * self._spread * scale
        limb = rng.integers(-1, len(self._limbs), (count, frames, POSES))
        other = rng.integers(0, count, (count, frames, POSES))
        borrowed = rng.random((count, frames, POSES)) < 0.25
        for number, own in enumerate(self._limbs):
            chosen = (limb == number) | (limb < 0)
            chosen[:, :, 0] = False
            fresh = chosen & ~borrowed
            m, k, n = np.nonzero(fresh)
            tried[m[:, None], k[:, None], n[:, None], own] += noise[m[:, None], k[:, None], n[:, None], own]
            m, k, n = np.nonzero((limb == number) & chosen & borrowed)
            tried[m[:, None], k[:, None], n[:, None], own] = now.poses[
                other[m, k, n][:, None], k[:, None], own
            ]
        tried = self._within(tried)
        fitness = self._fitness(now.shapes, tried)
        best = np.argmax(fitness, axis=2)
        now.poses = np.take_along_axis(tried, best[..., None, None], axis=2)[:, :, 0]
        now.fitness = np.take_along_axis(fitness, best[..., None], axis=2)[..., 0]

    def draw_limbs(self, poses: Array) -> Array:
        """(F, D) the poses with each limb at its best of many samples (`lost_limbs`)."""
        shape = np.zeros((1, len(self._sigma)))

        def fitness(tried: Array) -> Array:
            by_body = tried.reshape(-1, POSES, *poses.shape).swapaxes(1, 2)
            shapes = np.repeat(shape, len(by_body), axis=0)
            return self._fitness(shapes, by_body).swapaxes(1, 2).reshape(len(tried), -1)

        rest, tries = self._space.body.neutral, self._settings.drawn
        return lost_limbs_found(self._rng, fitness, poses, self._limbs, self._limits, rest, tries)

    def fitness(self, shape: Array, poses: Array) -> Array:
        """(F,) f_s of a shape (S,) in poses (F, D)."""
        return self._fitness(shape[None], poses[None, :, None])[0, :, 0]

    def _fitness(self, shapes: Array, poses: Array) -> Array:
        """(M, F, K) of poses (M, F, K, D), K at most sixteen."""
        wanted = poses.shape[2]
        if wanted < POSES:
            poses = np.repeat(poses[:, :, :1], POSES, axis=2)
        self.evaluations += poses.shape[0] * poses.shape[1] * wanted
        return self._silhouettes.fitness(shapes, poses)[:, :, :wanted]

    def _within(self, poses: Array) -> Array:
        return np.clip(poses, *self._limits)

    def _answer(self, now: _Population, kept: list[tuple[Array, Array]], before: Array) -> FoundShape:
        """The mean shape of the last layers' survivors, and poses for it."""
        weights = np.concatenate([one for one, _ in kept]) / len(kept)
        shapes = np.concatenate([one for _, one in kept])
        shape = weights @ shapes
        poses = np.empty_like(now.poses)
        for k in range(poses.shape[1]):
            poses[:, k] = self._within(
                now.poses[:, k] + (shape - now.shapes) @ self.carried(shape, now.poses[0, k]).T
            )
        last = _Population(np.repeat(shape[None], len(poses), axis=0), poses)
        for _ in range(2 * self._settings.pose_steps + 2):
            self._improve(last, 0.0)
        best = np.argmax(last.fitness, axis=0)
        frames = np.arange(int(poses.shape[1]))
        if self._progress is not None:
            self._progress(self._settings.layers, self._settings.layers)
        return FoundShape(
            shape, last.poses[best, frames], last.fitness[best, frames], before, self.evaluations
        )


def tempered(log_weights: Array, survival: float) -> Array:
    """(M,) normalised weights w^β with β at most 1, smaller where too few would survive."""
    return np.exp(normalised(log_weights, min(1.0, anneal(log_weights, survival).beta)))
