"""Whether the last cloud of tempered sequential Monte Carlo is a sample of the posterior that it states.

Simulation-based calibration (Talts, Betancourt, Simpson, Vehtari & Gelman 2018): a pose is drawn from the prior, a
silhouette from the likelihood given it, and the cloud searched for it. The pose's rank in the cloud is uniform if, and
for all practical purposes only if, the cloud is a sample of the posterior. This takes a likelihood that *is* the
density of what is seen: of a planar arm, of whose silhouette each pixel is turned over independently with probability
ε, the density of the picture is (ε / (1 - ε)) to the number of pixels that differ from the pose's. The template
likelihood is minus the share of pixels that differ, so that its scale is the number of pixels times log((1 - ε) / ε).
The prior is uniform between the joints' limits. A scale four times too large, and one four times too small, must fail.

People, whose likelihood is no density, have no ranks to check: there a cloud of few evaluations is compared with one of
a million by another algorithm, differential evolution Markov chains (ter Braak 2006), with the same prior and scale.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array
from studio.foundations.progress import report
from studio.garden.reproduction.claims import geometric_mean, share
from studio.garden.reproduction.deutscher_reid.arms import TemplateArm, silhouette, template_arm
from studio.garden.reproduction.experiment import Part, group_of, listed
from studio.garden.reproduction.open_questions.posterior import LEVELS, band, distribution, rank
from studio.results.comparison.findings import Chart, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.runs.live.following import Following
from studio.runs.search_space import search_space, session_sigma
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.problem import FrameLikelihood
from studio.search.settings import DEFAULT_WEIGHTING, RunSettings, default_settings
from studio.search.trackers.catalogue import TRACKERS, knobs_for_evaluations
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.frame_prior import FramePrior
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.tracker import FilterState, LayerRecord, start_of

ARM_BODIES = ("planar_arm4", "branched_arms6")
TURNED = 0.3
"""Probability ε of a pixel to be turned over."""
POSES, QUICK_POSES = 20, 4
"""A seed's simulated pictures."""
KNOBS: Mapping[str, Any] = {"layers": 60, "particles": 400, "survival": 0.7}
RIGHT = "the density's scale"
SCALES: Mapping[str, float] = {RIGHT: 1.0, "four times too large": 4.0, "four times too small": 0.25}


def trials(scale: Scale) -> tuple[Trial, ...]:
    """A batch of simulated pictures a body, scale and seed."""
    poses = QUICK_POSES if scale.quick else POSES
    return tuple(
        Trial(
            f"{kind}, {body}, seed {seed}",
            {"body": body, "seed": seed, "times": times, "poses": poses, "knobs": dict(KNOBS)},
        )
        for body in ARM_BODIES[: 1 if scale.quick else None]
        for kind, times in SCALES.items()
        for seed in scale.seeds
    )


@cache
def scene(body: str) -> TemplateArm:
    """The body before its camera."""
    return template_arm(body)


def turned_over(arm: TemplateArm, pose: Array, rng: np.random.Generator) -> FrameLikelihood:
    """A picture of a pose (D,) whose pixels are turned over at random, as a function of poses."""
    mask = silhouette(arm.body, arm.camera, pose)
    wrong = rng.random(mask.shape) < TURNED
    mask = np.where(wrong, 255 - mask, mask).astype(np.uint8)
    picture = np.repeat(mask[:, :, None], 3, axis=2)
    return arm.likelihood.problem(
        FrameEvidence(0, (ViewEvidence(arm.camera.name, picture, mask, np.zeros_like(mask)),))
    )


def scale_of_density(arm: TemplateArm) -> float:
    """The exponent with which the template likelihood is the density of a picture."""
    return arm.camera.width * arm.camera.height * math.log((1.0 - TURNED) / TURNED)


@kept_as("open_questions.sampled_posterior.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Ranks (K, D) of the simulated poses in their clouds; by picture the share of moves taken in the last layer, and
    whether the ladder reached its end.
    """
    del cache
    arm, tracker, seed = scene(arguments["body"]), TRACKERS["tempered"], int(arguments["seed"])
    scale = scale_of_density(arm) * float(arguments["times"])
    settings = tracker.settings_type(**{**arguments["knobs"], "likelihood_scale": scale})
    ranks, taken, ended = list[list[float]](), list[float](), list[bool]()
    for at in range(int(arguments["poses"])):
        rng = np.random.default_rng((seed, at, 31))
        truth = rng.uniform(arm.space.lower, arm.space.upper)
        problem, last = turned_over(arm, truth, rng), list[LayerRecord]()
        result = search_frame(
            tracker,
            problem,
            FilterState(None),
            arm.space,
            seed=seed,
            frame=at,
            settings_source=lambda: (1, settings),
            on_layer=last.append,
        )
        cloud = result.carried.particles
        assert cloud is not None
        weights = np.exp(cloud.log_weights)
        ranks.append([rank(cloud.poses[:, d], weights, float(truth[d])) for d in range(len(truth))])
        taken.append(float(last[-1].acceptance))
        ended.append(bool(last[-1].beta == 0.0))
        report("pictures", at + 1, int(arguments["poses"]))
    names = [entry.label for entry in arm.body.parameters]
    return {"parameters": names, "ranks": ranks, "taken": taken, "ended": ended}


def are_uniform(ranks: Array) -> bool:
    """Whether the ranks (K,) of one parameter stay within the simultaneous 95 % band of K independent ones."""
    return bool(np.all(np.abs(distribution(ranks) - np.array(LEVELS)) <= band(len(ranks))))


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """By body and scale, how many parameters have uniform ranks, and their distributions."""
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for outcome in outcomes:
        groups.setdefault(group_of(outcome.trial), []).append(outcome.measured)
    rows, of_kind = list[tuple[Any, ...]](), dict[str, list[bool]]()
    for group, entries in groups.items():
        ranks = np.concatenate([np.array(one["ranks"]) for one in entries])
        names, count = entries[0]["parameters"], len(ranks)
        uniform = [are_uniform(ranks[:, d]) for d in range(len(names))]
        of_kind.setdefault(group.partition(", ")[0], []).extend(uniform)
        outside = [float(((own < 0.025) | (own > 0.975)).mean()) for own in ranks.T]
        for name, one, far in zip(names, uniform, outside, strict=True):
            away = float(np.max(np.abs(distribution(ranks[:, names.index(name)]) - np.array(LEVELS))))
            rows.append(
                (group, name, count, round(away, 3), round(band(count), 3), one, round(100.0 * far, 1))
            )
        yield number(
            f"{group}: moves taken at the end",
            [float(np.array(one["taken"]).mean()) for one in entries],
            "of 1",
        )
        series = [
            Series(name, LEVELS, tuple(distribution(ranks[:, d]).tolist())) for d, name in enumerate(names)
        ]
        for sign, word in ((-1.0, "lower"), (1.0, "upper")):
            edge = tuple(min(max(level + sign * band(count), 0.0), 1.0) for level in LEVELS)
            series.append(Series(f"95 % band, {word}", LEVELS, edge, group="band", dashed=True))
        yield Chart(
            f"Rank of the simulated pose: {group}", "lines", "rank", "share of the ranks", tuple(series)
        )
    for kind, uniform in of_kind.items():
        yield share(f"{kind}: parameters with uniform ranks", uniform, 1.0 if kind == RIGHT else 0.0)
    heads = (
        *("body and scale", "parameter", "pictures", "largest distance", "band", "uniform"),
        "truth outside the middle 95 % (%)",
    )
    yield Table("Every parameter", heads, tuple(rows))
    yield "The band is one parameter's: of twenty with uniform ranks one leaves it."
    yield {"pixels turned over": TURNED, **KNOBS}


PEOPLE_CLIPS = ("walk", "choosing-turns")
AT_FRAMES, QUICK_FRAMES = (4, 12), (4,)
SIZES = (5000, 20_000, 80_000)
CHAINS, GENERATIONS, QUICK_GENERATIONS, KEPT_EVERY = 200, 5000, 200, 25
JUMP_EVERY = 10
"""Generations after which chains step by a whole difference of two others, between modes."""
LITTLE = 1e-3
"""Of σ0: noise that lets chains leave the plane of the others."""


def people_trials(scale: Scale) -> tuple[Trial, ...]:
    """A frame of a clip a seed."""
    return tuple(
        Trial(
            f"{clip}, frame {frame}, seed {seed}",
            {
                "clip": clip,
                "frame": frame,
                "seed": seed,
                "sizes": list(SIZES[: 1 if scale.quick else None]),
                "generations": QUICK_GENERATIONS if scale.quick else GENERATIONS,
            },
        )
        for clip in PEOPLE_CLIPS[: 1 if scale.quick else None]
        for frame in (QUICK_FRAMES if scale.quick else AT_FRAMES)
        for seed in scale.seeds
    )


class SearchedClip:
    """A clip with what a search of its frames needs, in memory. settings : of a tracker with the default likelihood."""

    def __init__(self, cache: FootageCache, clip: str, settings: RunSettings) -> None:
        self.cache, self.settings = cache, settings
        self.session = cache.session(clip)
        self.body, self.cameras = self.session.body(), self.session.cameras()
        sigma = session_sigma(self.session, self.body, self.session.manifest.fps)
        self.space = search_space(self.body, sigma)
        self.likelihood = WEIGHTINGS[DEFAULT_WEIGHTING].prepare(self.body, self.cameras, settings.weighting)

    def problem(self, frame: int) -> FrameLikelihood:
        """The likelihood of a frame."""
        chosen, knobs = WEIGHTINGS[DEFAULT_WEIGHTING], self.settings.evidence
        return self.likelihood.problem(
            self.cache.evidence(
                self.session, self.cameras, frame, knobs, chosen.edge_kind, chosen.reads_pictures
            )
        )

    def followed(self, seed: int) -> Following:
        """A run that begins in the session's start pose."""
        start = self.session.start_pose(self.body)
        return Following(
            self.settings, self.space, start_of(None if start is None else tuple(map(float, start))), seed
        )


@kept_as("open_questions.sampled_posterior.measure_people")
def measure_people(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Of clouds of each size: the distance of their means from the chains' in the chains' deviations, root mean square
    over the parameters; the geometric mean of the deviations over the chains'; log evidence.
    """
    settings, last = default_settings("tempered", DEFAULT_WEIGHTING), int(arguments["frame"])
    scene = SearchedClip(cache, arguments["clip"], settings)
    run = scene.followed(int(arguments["seed"]))
    for frame in range(last):
        run.step(frame, scene.problem(frame))
    problem, space = scene.problem(last), scene.space
    before, own = run.carried, settings.tracker
    prior = FramePrior.of_frame(before, space, scale=own.diffusion_scale, dynamics=own.dynamics, bounded=True)
    chains = chains_of(
        problem, prior, own.likelihood_scale, int(arguments["seed"]), int(arguments["generations"])
    )
    middle: Array = chains.mean(axis=0)
    deviation: Array = np.maximum(chains.std(axis=0), 1e-12)
    clouds = dict[str, dict[str, float]]()
    for size in arguments["sizes"]:
        knobs = dataclasses.replace(settings.tracker, **knobs_for_evaluations("tempered", int(size)))
        records: list[LayerRecord] = []
        result = search_frame(
            TRACKERS["tempered"],
            problem,
            before,
            space,
            seed=int(arguments["seed"]),
            frame=last,
            settings_source=lambda knobs=knobs: (1, knobs),
            on_layer=records.append,
        )
        cloud = result.carried.particles
        assert cloud is not None
        weights = np.exp(cloud.log_weights)
        mean = weights @ cloud.poses
        spread: Array = np.sqrt(weights @ (cloud.poses - mean) ** 2)
        clouds[str(size)] = {
            "off": float(np.sqrt(np.mean(((mean - middle) / deviation) ** 2))),
            "spread": float(np.exp(np.mean(np.log(np.maximum(spread, 1e-12) / deviation)))),
            "log_evidence": float(records[-1].log_evidence),
        }
    half = len(chains) // 2
    apart: Array = (chains[:half].mean(axis=0) - chains[half:].mean(axis=0)) / deviation
    agreement = float(np.sqrt(np.mean(apart**2)))
    return {"clouds": clouds, "chains_apart": agreement}


def chains_of(
    problem: FrameLikelihood, prior: FramePrior, scale: float, seed: int, generations: int
) -> Array:
    """(K, D) poses of the posterior, of CHAINS chains of differential evolution (ter Braak 2006) that begin in the
    prior; each half moves by differences of the other's members. The first half of the generations is left out.
    """
    poses, size = prior.draw(RandomNumbers.of_beginning(seed, 0), CHAINS), len(prior.deviation)
    rng = np.random.default_rng((seed, 77))

    def log_posterior(rows: Array) -> Array:
        density = prior.log_density(rows)
        values = scale * problem.log_likelihood(rows) + density
        return np.where(np.isfinite(density) & problem.feasible(rows), values, -np.inf)

    weights, kept = log_posterior(poses), list[Array]()
    halves = np.arange(CHAINS).reshape(2, -1)
    for generation in range(generations):
        step = 1.0 if generation % JUMP_EVERY == 0 else 2.38 / math.sqrt(2.0 * size)
        for own, other in (halves, halves[::-1]):
            pairs = np.array([rng.choice(other, 2, replace=False) for _ in own])
            moved = poses[own] + step * (poses[pairs[:, 0]] - poses[pairs[:, 1]])
            moved += LITTLE * prior.deviation * rng.normal(size=moved.shape)
            proposed = log_posterior(moved)
            taken = np.log(rng.random(len(own))) < proposed - weights[own]
            poses[own[taken]], weights[own[taken]] = moved[taken], proposed[taken]
        if generation >= generations // 2 and generation % KEPT_EVERY == 0:
            kept.append(poses.copy())
        report("generations of the chains", generation + 1, generations)
    return np.concatenate(kept)


def people_shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """By size: how far clouds are from the chains."""
    sizes = dict.fromkeys(size for outcome in outcomes for size in outcome.measured["clouds"])
    rows = list[tuple[Any, ...]]()
    for size in sizes:
        own = [outcome.measured["clouds"][size] for outcome in outcomes if size in outcome.measured["clouds"]]
        off, spread = [one["off"] for one in own], [one["spread"] for one in own]
        yield number(f"{size} evaluations: means off", off, "deviations")
        yield number(f"{size} evaluations: spread over the chains'", spread, "×", statistic=geometric_mean)
        rows += [
            (
                outcome.trial.label,
                int(size),
                *(round(outcome.measured["clouds"][size][name], 2) for name in KEYS),
            )
            for outcome in outcomes
        ]
    apart = [outcome.measured["chains_apart"] for outcome in outcomes]
    yield number("the chains' first and second half apart", apart, "deviations")
    heads = ("frame", "evaluations", "means off (deviations)", "spread (×)", "log evidence (nats)")
    yield Table("Every frame", heads, tuple(rows))
    yield {"weighting": DEFAULT_WEIGHTING, "chains": CHAINS, "generations": GENERATIONS}


KEYS = ("off", "spread", "log_evidence")
EXPERIMENTS = (
    listed("sampled-posterior", trials, measure, shown),
    listed("sampled-people", people_trials, measure_people, people_shown, footage=PEOPLE_CLIPS),
)
