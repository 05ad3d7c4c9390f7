"""Three of the paper's choices of evidence, each beside what it replaced: sets of pixels, split blobs, Eq. 9.

Section 6.1 classifies a voxel by the sum of the distances of its pixels (χ² with 3 k degrees of freedom), where others
segment each pixel for itself. Both are carved by the same octree from the same samples, and compared with the hull that
the exact silhouettes give; a few frames are drawn for these.

Section 6.2 and Fig. 7 split a body part's blob where its clothes change their colour. Blobs are learnt from true poses
of the first frames, split and unsplit, and fitted in frames after them.

Section 6.4 replaces the nearest blob (Eq. 8) by the one that fitting began from (Eq. 9), which costs one divergence a
blob instead of one a pair. Both weigh the same poses of the same frames, blobs fitted from the frame before.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.evidence.volume.blob_model import BlobMixture, BlobModel
from studio.evidence.volume.chi_square import fitted_thresholds
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_settings import HullSettings
from studio.evidence.volume.reconstruction import Reconstructor
from studio.evidence.volume.relative_entropy import DIMENSIONS
from studio.evidence.volume.tracking_space import box_of
from studio.evidence.yuv_background import YuvBackground, learn_background
from studio.foundations.arrays import Array, Bytes, evenly_spread
from studio.garden.reproduction.caillette.following import problems, taught_blobs
from studio.garden.reproduction.caillette.setting import (
    AS_PRINTED,
    BLOBS,
    GUIDED,
    TEST,
    TEST_2,
    UNSEEN,
    last_frame,
)
from studio.garden.reproduction.caillette.true_motion import true_motion
from studio.garden.reproduction.claims import HIGHER, LOWER, NO_WORSE, beyond, ratio
from studio.garden.reproduction.drawing import bar_chart, places, seed_range
from studio.garden.reproduction.experiment import Part, each_seed, grouped, listed, measured
from studio.results.comparison.findings import Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.drawing_footage.recipe_file import find_recipe, read_recipe
from studio.results.drawing_footage.recipes import person_renderer
from studio.runs.search_space import search_space, session_sigma
from studio.search.likelihood.blobs import ExpectedBlobs
from studio.search.likelihood.problem import FittedToPoses
from studio.search.settings import changed_settings, default_settings

# χ² of sets of pixels against each pixel for itself (6.1, Eq. 5 and 6).

SETS, PIXELS, EXACT = "sets of pixels (χ²)", "each pixel for itself", "exact silhouettes"
DRAWN_FRAMES, EMPTY_FRAMES, POINTS, ROOM_MM = 3, 20, 200_000, 150.0
CARVED = (TEST, TEST_2)
SURE = 1e6
"""Squared distance of a pixel that is certainly foreground."""


def carving_trials(scale: Scale) -> tuple[Trial, ...]:
    """One a clip and seed, which chooses the frames."""
    clips = CARVED[: 1 if scale.quick else None]
    return tuple(
        trial
        for clip in clips
        for trial in each_seed(clip, scale.seeds, lambda seed, clip=clip: {"drawn": clip, "seed": seed})
    )


def as_segmented(mask: Bytes) -> tuple[Bytes, YuvBackground]:
    """A mask as a picture (H, W, 3) and a background, of which every foreground pixel is surely not, every other
    surely is: what carving from sets of pixels makes of a segmentation.
    """
    picture = np.repeat(np.where(mask > 0, 255, 0).astype(np.uint8)[:, :, None], 3, axis=2)
    mean = np.zeros((*mask.shape, 3), dtype=np.float32)
    precision = np.broadcast_to(np.eye(3, dtype=np.float32) * SURE, (*mask.shape, 3, 3))
    return picture, YuvBackground(mean, np.ascontiguousarray(precision))


def overlap(hull: Hull, exact: Hull, points: Array) -> tuple[float, float, float]:
    """Intersection over union of two hulls by points of space; shares of the exact one that are missed, and added."""
    ours, true = hull.contains(points), exact.contains(points)
    both, whole = (ours & true).sum(), max(int(true.sum()), 1)
    union = max(int((ours | true).sum()), 1)
    return float(both / union), float((true & ~ours).sum() / whole), float((ours & ~true).sum() / whole)


@kept_as("caillette.carving.measure")
def measure_carving(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Of both classifications, means over a few frames: intersection over union with the hull of the exact
    silhouettes, share missed, share added.
    """
    del cache
    path = find_recipe(arguments["drawn"])
    renderer, cameras, frames = person_renderer(read_recipe(path), path.parent)
    seed = int(arguments["seed"])
    chosen = evenly_spread(frames, 10 * DRAWN_FRAMES)[seed % 10 :: 10]
    settings = HullSettings(**{name: value for name, value in AS_PRINTED.items() if name.startswith("hull_")})
    backgrounds = [
        learn_background([renderer.empty(camera, frame) for frame in range(EMPTY_FRAMES)])
        for camera in range(len(cameras))
    ]
    reconstructor = Reconstructor(cameras, box_of(cameras), settings)
    single = fitted_thresholds(3, settings.hull_confidence).single
    shares = settings.hull_shadow, settings.hull_deepest_shadow
    rng = np.random.default_rng((seed, 61))
    parts: dict[str, list[tuple[float, float, float]]] = {SETS: [], PIXELS: []}
    for frame in chosen:
        shadow = renderer.shadow(int(frame))
        drawn = [renderer.picture(camera, int(frame), shadow) for camera in range(len(cameras))]
        alone = [
            (background.squared_distances(picture, *shares) > single).astype(np.uint8)
            for (picture, _), background in zip(drawn, backgrounds, strict=True)
        ]
        seen = {
            EXACT: [as_segmented(mask) for _, mask in drawn],
            SETS: [(picture, own) for (picture, _), own in zip(drawn, backgrounds, strict=True)],
            PIXELS: [as_segmented(mask) for mask in alone],
        }
        hulls = {
            name: reconstructor.hull(
                FrameEvidence(
                    int(frame),
                    tuple(
                        ViewEvidence(
                            camera.name,
                            picture,
                            np.zeros(picture.shape[:2], np.uint8),
                            np.zeros(picture.shape[:2], np.uint8),
                            background,
                        )
                        for camera, (picture, background) in zip(cameras, views, strict=True)
                    ),
                )
            )
            for name, views in seen.items()
        }
        centres = np.concatenate([hull.centres for hull in hulls.values()])
        low, high = hulls[EXACT].centres.min(axis=0) - ROOM_MM, hulls[EXACT].centres.max(axis=0) + ROOM_MM
        low, high = (
            np.maximum(low, centres.min(axis=0) - ROOM_MM),
            np.minimum(high, centres.max(axis=0) + ROOM_MM),
        )
        points = rng.uniform(low, high, (POINTS, 3))
        for name, own in parts.items():
            own.append(overlap(hulls[name], hulls[EXACT], points))
    return {
        name: dict(zip(("overlap", "missed", "added"), np.mean(own, axis=0).tolist(), strict=True))
        for name, own in parts.items()
    }


def shown_carving(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """How much of the exact hull is wrong by sets of pixels, over by each pixel for itself."""
    of = {
        (name, part): [float(outcome.measured[name][part]) for outcome in outcomes]
        for name in (SETS, PIXELS)
        for part in ("overlap", "missed", "added")
    }
    wrong = {name: [1.0 - value for value in of[name, "overlap"]] for name in (SETS, PIXELS)}
    yield ratio(
        "what is wrong of the hull, sets of pixels over each for itself", wrong[SETS], wrong[PIXELS], LOWER
    )
    for name in (SETS, PIXELS):
        yield number(f"{name}: intersection over union with the exact hull", of[name, "overlap"], "of 1")
        yield number(f"{name}: missed of the exact hull", of[name, "missed"], "of 1")
        yield number(f"{name}: added to the exact hull", of[name, "added"], "of 1")
    yield (
        f"Within {ROOM_MM:g} mm of the body. Both have the same octree, samples, backgrounds, shadows and confidence, "
        "and no segmentation is cleaned, so that only the sum of distances differs."
    )
    rows = tuple(
        (name, *(round(float(np.mean(of[name, part])), 4) for part in ("overlap", "missed", "added")))
        for name in (SETS, PIXELS)
    )
    yield Table(
        "Against the hull of the exact silhouettes", ("a voxel by", "overlap", "missed", "added"), rows
    )
    series = [
        seed_range(name, places(2), [of[name, "missed"], of[name, "added"]], name) for name in (SETS, PIXELS)
    ]
    yield bar_chart("Wrong voxels (bars: lowest and highest seed)", "", "share", series, ("missed", "added"))
    yield {
        "clips": ", ".join(CARVED),
        **{name: value for name, value in AS_PRINTED.items() if "hull" in name},
    }


# Split blobs (6.2, Fig. 7).

WHOLE_LIMBS, SPLIT = "one blob a body part", "split by colour"
PERFORMED = (TEST, TEST_2, UNSEEN, "dance-choosing-1", "dance-choosing-2")
SPLIT_FRAMES, EVERY = 100, 8


def splitting_trials(scale: Scale) -> tuple[Trial, ...]:
    """One a clip; nothing is drawn at random."""
    return tuple(
        Trial(clip, {"footage": clip, "last": last_frame(clip, scale.quick, SPLIT_FRAMES)})
        for clip in PERFORMED
    )


@kept_as("caillette.splitting.measure")
def measure_splitting(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Of both models: `likelihood`, nats a voxel, of each frame after those that blobs were learnt from; `blobs`."""
    session, last = cache.session(arguments["footage"]), int(arguments["last"])
    body, truth = session.body(), true_motion(cache, session, last)
    measured: dict[str, Any] = {}
    for name, most in ((WHOLE_LIMBS, 1), (SPLIT, 3)):
        settings = changed_settings(default_settings(GUIDED, BLOBS), {**AS_PRINTED, "blob_parts": most})
        problem_of = problems(cache, session, settings, last)
        memory = taught_blobs(problem_of, truth.poses, settings)
        likelihood: list[float] = []
        blobs = 0
        for frame in range(settings.weighting.blob_learning, last, EVERY):
            problem = problem_of(frame)
            assert isinstance(problem, FittedToPoses)
            expecting = problem.expecting(truth.poses[frame][None], memory)
            assert isinstance(expecting, ExpectedBlobs)
            assert expecting.fitted is not None
            blobs = len(expecting.model.limb)
            likelihood.append(round(expecting.fitted.log_likelihood, 4))
        measured[name] = {"likelihood": likelihood, "blobs": blobs}
    return {**measured, "parts": len(body.drawn)}


def shown_splitting(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """What splitting gains in frames that were not learnt from."""
    means = {
        name: [float(np.mean(list(map(float, outcome.measured[name]["likelihood"])))) for outcome in outcomes]
        for name in (WHOLE_LIMBS, SPLIT)
    }
    gained = [after - before for before, after in zip(*means.values(), strict=True)]
    yield beyond(number("likelihood gained by splitting, frames after", gained, "nats/voxel"), 0.0, HIGHER)
    yield number("blobs, split", [outcome.measured[SPLIT]["blobs"] for outcome in outcomes])
    yield number("body parts", [outcome.measured["parts"] for outcome in outcomes])
    yield (
        "A value a clip: blobs are learnt from the true poses of its first frames, and fitted from the true pose in "
        f"every {EVERY}th frame after them: more blobs are likelier anyway in the frames that they were learnt from."
    )
    rows = tuple(
        (outcome.trial.label, outcome.measured[SPLIT]["blobs"], round(before, 3), round(after, 3))
        for outcome, before, after in zip(outcomes, *means.values(), strict=True)
    )
    heads = ("clip", "blobs, split", "one a part (nats/voxel)", "split (nats/voxel)")
    yield Table("Likelihood of the voxels", heads, rows)
    series = [
        seed_range(
            name, places(len(outcomes)), [outcome.measured[name]["likelihood"] for outcome in outcomes], name
        )
        for name in (WHOLE_LIMBS, SPLIT)
    ]
    labels = [outcome.trial.label for outcome in outcomes]
    yield bar_chart("Likelihood (bars: lowest and highest frame)", "clip", "nats/voxel", series, labels)
    yield {"weighting": BLOBS, "clips": ", ".join(PERFORMED)}


# Eq. 8 against Eq. 9.

NEAREST, KEPT = "Eq. 8, the nearest blob", "Eq. 9, the blob it was fitted from"
WEIGHED, SCALES, BACK = 400, (0.5, 1.0, 2.0, 4.0), 2
NEAREST_FRAMES = 100


def divergence_trials(scale: Scale) -> tuple[Trial, ...]:
    """One a clip and seed."""

    def arguments(clip: str, seed: int) -> dict[str, Any]:
        return {"footage": clip, "seed": seed, "last": last_frame(clip, scale.quick, NEAREST_FRAMES)}

    return tuple(
        trial
        for clip in CARVED[: 1 if scale.quick else None]
        for trial in each_seed(clip, scale.seeds, partial(arguments, clip))
    )


def nearest_divergences(body: BodyModel, model: BlobModel, image: BlobMixture, poses: Array) -> Array:
    """(N,) Eq. 8 of poses (N, D), nats: each of the model's blobs from the nearest of the image's, of space alone as
    Eq. 9 is here.
    """
    mixture = model.mixture(body, poses)
    precisions = np.linalg.inv(image.covariances)
    away = image.means[None, None] - mixture.means[:, :, None]
    square = np.einsum("nfgi,gij,nfgj->nfg", away, precisions, away)
    trace = np.einsum("gij,nfji->nfg", precisions, mixture.covariances)
    logs = np.linalg.slogdet(image.covariances)[1] - np.log(model.eigenvalues).sum(axis=1)[:, None]
    share = np.log(model.weight)[:, None] - np.log(image.weights)[None]
    each = 0.5 * (logs - DIMENSIONS + trace + square) + share
    return each.min(axis=2) @ model.weight


@kept_as("caillette.divergence.measure")
def measure_divergence(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Means over frames: `errors`, mm of the twentieth of some poses about the truth that either equation likes best;
    `ranks`, the correlation of the ranks that both give.
    """
    settings = changed_settings(default_settings(GUIDED, BLOBS), AS_PRINTED)
    session, last = cache.session(arguments["footage"]), int(arguments["last"])
    body, truth = session.body(), true_motion(cache, session, last)
    sigma = search_space(body, session_sigma(session, body, session.manifest.fps)).sigma
    problem_of = problems(cache, session, settings, last)
    memory = taught_blobs(problem_of, truth.poses, settings)
    rng = np.random.default_rng((int(arguments["seed"]), 89))
    errors: dict[str, list[float]] = {NEAREST: [], KEPT: []}
    ranks: list[float] = []
    for frame in range(settings.weighting.blob_learning, last, EVERY):
        problem = problem_of(frame)
        assert isinstance(problem, FittedToPoses)
        expecting = problem.expecting(truth.poses[frame - BACK][None], memory)
        assert isinstance(expecting, ExpectedBlobs)
        assert expecting.fitted is not None
        scales = np.repeat(SCALES, WEIGHED // len(SCALES))[:, None]
        poses = truth.poses[frame] + rng.normal(0.0, 1.0, (len(scales), len(sigma))) * sigma * scales
        points = marker_points(body, np.concatenate([truth.poses[frame][None], poses]))
        away = np.linalg.norm(points[1:] - points[0], axis=2).mean(axis=1)
        both = {
            NEAREST: nearest_divergences(body, expecting.model, expecting.fitted.mixture, poses),
            KEPT: expecting.divergences(poses),
        }
        for name, values in both.items():
            errors[name].append(float(away[np.argsort(values)[: len(away) // 20]].mean()))
        ranks.append(float(spearmanr(both[NEAREST], both[KEPT]).statistic))
    return {
        "errors": {name: float(np.mean(values)) for name, values in errors.items()},
        "ranks": float(np.mean(ranks)),
    }


def shown_divergence(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Whether Eq. 9 prefers poses as near as Eq. 8 does."""
    groups: Mapping[str, list[dict[str, Any]]] = grouped(outcomes)
    of: dict[str, dict[str, list[float]]] = {
        clip: {name: [run["errors"][name] for run in runs] for name in (NEAREST, KEPT)}
        for clip, runs in groups.items()
    }
    for clip, errors in of.items():
        yield ratio(
            f"error of the best poses, Eq. 9 over Eq. 8, {clip}", errors[KEPT], errors[NEAREST], NO_WORSE
        )
    for clip, errors in of.items():
        for name, values in errors.items():
            yield number(f"{name}, {clip}: error of the best twentieth", values, "mm")
    yield number("correlation of the ranks that both give", measured(outcomes, "ranks"), "of 1")
    yield (
        f"{WEIGHED} poses about the truth, by half to four times σ0; blobs are fitted from the true pose of {BACK} "
        "frames before. Eq. 8 takes a divergence a pair of blobs, Eq. 9 one a blob."
    )
    rows = tuple(
        (clip, *(round(float(np.mean(errors[name])), 2) for name in (NEAREST, KEPT)))
        for clip, errors in of.items()
    )
    yield Table("Error of the best twentieth (mm)", ("clip", NEAREST, KEPT), rows)
    series = [
        seed_range(name, places(len(of)), [errors[name] for errors in of.values()], name)
        for name in (NEAREST, KEPT)
    ]
    yield bar_chart("Error of the best twentieth (bars: lowest and highest seed)", "clip", "mm", series, of)
    yield {"weighting": BLOBS, "clips": ", ".join(of)}


EXPERIMENTS = (
    listed("caillette-sets-of-pixels", carving_trials, measure_carving, shown_carving),
    listed("caillette-fig-7", splitting_trials, measure_splitting, shown_splitting, footage=PERFORMED),
    listed("caillette-equation-9", divergence_trials, measure_divergence, shown_divergence, footage=CARVED),
)
