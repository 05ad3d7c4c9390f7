"""Whether another seed would agree: one frame searched with K seeds from the state that the run's began with.

By limb, over its points: W, the mean over seeds of the variance within the last weighted set; B, the variance of the
seeds' estimates. √W is the spread that one search shows, √B the Monte-Carlo error of one search, √(B / K) that of the
mean of all. R̂ = √((W + B) / W)
(Gelman & Rubin 1992, "Inference from iterative simulation using multiple sequences", for long sequences). Ranks of each
seed's particles among those of all are even where seeds agree (rank plots, Vehtari, Gelman, Simpson, Carpenter &
Bürkner 2021, "Rank-normalization, folding, and localization", Bayesian Analysis 16(2)).
"""

import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from cachetools import LRUCache

from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError
from studio.foundations.progress import Progress
from studio.results.inspection.reading import InspectedFrame, InspectedRun, no_value
from studio.results.inspection.reference import body_points, by_limb, true_points
from studio.results.inspection.retracking import Change, Retracking
from studio.results.inspection.tables import Row, Selection, View, ViewResult, table
from studio.search.trackers.tracker import FrameResult, ParticleSet

VIEW = View(
    "seeds",
    "Seeds",
    "Would another seed agree?",
    ("limb",),
    (
        table(
            "limbs",
            "Spread within and between seeds",
            "limb",
            ("within", "Within a seed", "mm"),
            ("between", "Between seeds: Monte-Carlo error of one", "mm"),
            ("error", "Monte-Carlo error of their mean", "mm"),
            ("r_hat", "R̂"),
        ),
        table(
            "seeds",
            "Each seed's result",
            ("seed", "Seed"),
            "log_weight",
            ("evaluations", "Evaluations"),
            ("error", "Error", "mm"),
        ),
        table(
            "ranks",
            "Ranks of each seed's particles among all",
            "parameter",
            ("seed", "Seed"),
            ("bin", "Bin"),
            ("count", "Weight"),
            ("expected", "Expected"),
        ),
        table("poses", "Each seed's estimate", ("seed", "Seed"), each="parameter"),
    ),
    is_job=True,
)


BINS = 10
KEPT = 32


@dataclass(frozen=True, slots=True, eq=False)
class SeedResult:
    """What a seed found. estimate : (D,) before any refinement. particles : the last weighted set."""

    seed: int
    estimate: Array
    log_weight: float
    evaluations: int
    particles: ParticleSet


_lock = threading.Lock()
_kept = LRUCache[tuple[Path, int, object], tuple[SeedResult, ...]](KEPT)


def search_seeds(run: InspectedRun, frame: int, count: int, progress: Progress) -> tuple[SeedResult, ...]:
    """The frame searched with the seeds after the run's own; kept for the view. What a progress raises ends it.

    Raises NotFoundError for a frame that is not finished.
    """
    stored = run.frame(frame)
    if stored.result is None:
        raise NotFoundError(
            f"Frame {frame} of run '{run.run.name}' is not finished.", "Choose a finished frame."
        )
    again, own = Retracking(run, frame, frame), run.run.record.seed
    seeds: list[SeedResult] = []
    for number in range(count):
        progress("seeds", number, count)
        result = again.searched(Change({}, number + 1))
        seeds.append(_seed_result(own + number + 1, result))
    progress("seeds", count, count)
    with _lock:
        _kept[_key(stored)] = tuple(seeds)
    return tuple(seeds)


def _seed_result(seed: int, result: FrameResult) -> SeedResult:
    particles = result.carried.particles
    assert particles is not None
    return SeedResult(seed, result.estimate.pose, result.estimate.log_weight, result.evaluations, particles)


def _key(frame: InspectedFrame) -> tuple[Path, int, object]:
    """What a frame's searches depend on: searched again, it has other numbers."""
    result = frame.result
    stamp = None if result is None else (result.milliseconds, result.estimate.log_weight)
    return frame.of.run.folder, frame.number, stamp


def rows(frame: InspectedFrame, selection: Selection) -> ViewResult:
    """The tables of view `seeds`; empty before seeds were searched."""
    with _lock:
        seeds = _kept.get(_key(frame), ())
    if not seeds:
        return ViewResult({}, ("No other seed has been searched in this frame: start that job.",))
    run = frame.of
    limbs = [row for row in limb_rows(run, seeds) if selection.limb in ("", row[0])]
    truth = true_points(run, frame.number)
    table: list[Row] = []
    for one in seeds:
        error = float("nan")
        if truth is not None:
            away: Array = np.linalg.norm(body_points(run.body, one.estimate[None])[0] - truth, axis=1)
            error = float(np.nanmean(away))
        table.append((one.seed, one.log_weight, one.evaluations, no_value(error)))
    return ViewResult(
        {
            "limbs": limbs,
            "seeds": table,
            "ranks": rank_rows(run, seeds),
            "poses": [(one.seed, *map(float, one.estimate)) for one in seeds],
        }
    )


def limb_rows(run: InspectedRun, seeds: tuple[SeedResult, ...]) -> list[Row]:
    """Spread within and between seeds by limb."""
    within: list[Array] = []
    for one in seeds:
        points, weights = body_points(run.body, one.particles.poses), np.exp(one.particles.log_weights)
        mean = np.tensordot(weights, points, axes=1)
        within.append(weights @ np.sum((points - mean) ** 2, axis=2))
    estimates = body_points(run.body, np.stack([one.estimate for one in seeds]))
    between = (
        np.sum(estimates.var(axis=0, ddof=1), axis=1)
        if len(seeds) > 1
        else np.full(estimates.shape[1], np.nan)
    )
    inside, outside = by_limb(run.body, np.mean(within, axis=0)), by_limb(run.body, between)
    table: list[Row] = []
    for limb, variance in inside.items():
        own, other = float(variance), float(outside[limb])
        ratio = float(np.sqrt((own + other) / own)) if own > 0.0 else float("nan")
        one, mean = float(np.sqrt(other)), float(np.sqrt(other / len(seeds)))
        table.append((limb, float(np.sqrt(own)), no_value(one), no_value(mean), no_value(ratio)))
    return table


def rank_rows(run: InspectedRun, seeds: tuple[SeedResult, ...]) -> list[Row]:
    """Weight of each seed's particles in tenths of the ranks among the particles of all seeds."""
    poses = np.concatenate([one.particles.poses for one in seeds])
    weights = np.concatenate([np.exp(one.particles.log_weights) for one in seeds])
    owner = np.concatenate([np.full(len(one.particles.poses), at) for at, one in enumerate(seeds)])
    table: list[Row] = []
    for at, name in enumerate(run.names):
        order = np.argsort(poses[:, at], kind="stable")
        reached = np.cumsum(weights[order]) - 0.5 * weights[order]
        bins = np.minimum((reached / len(seeds) * BINS).astype(np.int64), BINS - 1)
        for number, one in enumerate(seeds):
            own = owner[order] == number
            counts = np.bincount(bins[own], weights[order][own], BINS)
            table += [(name, one.seed, place, float(count), 1.0 / BINS) for place, count in enumerate(counts)]
    return table
