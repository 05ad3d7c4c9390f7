"""With which scale of the likelihood does a tempered cloud cover the truth as often as it says?

The likelihood counts every pixel as if it erred alone; a scale T makes it say less. For each joint and frame the share
of the cloud that is nearer to its mean than the truth is, by the cloud's own covariance of that joint: of a posterior
it lies below 0.5, 0.8 and 0.95 in 50, 80 and 95 per cent of the cases. T is chosen on the choosing half, where the
three differ least from that, and shown per clip on the reporting half. Every third frame is used.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import TruthError
from studio.garden.drawn_recipes import CHOOSING, HALVES, REPORTING, clip_name
from studio.garden.reproduction.deutscher_reid.weight_of_a_knee import true_poses
from studio.garden.reproduction.experiment import Part, each_seed, group_of, listed
from studio.garden.reproduction.tracking import Candidate
from studio.results.comparison.findings import Chart, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import TrackingTrial, track
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.inspection.reference import body_points
from studio.search.trackers.annealing import normalised
from studio.search.trackers.tracker import LayerRecord

KINDS = ("walk", "turns", "dance", "kick", "run", "crouch")
WEIGHTING = "edge-region-silhouette"
SCALES = (10.0, 20.0, 40.0, 80.0, 150.0, 300.0)
EVALUATIONS, FRAMES, QUICK_FRAMES = 5000, 60, 12
EVERY, FIRST = 3, 3
PROMISED = (0.5, 0.8, 0.95)
RIDGE_MM = 0.1
"""Added to a joint's deviations, so that one that the cloud holds still has a region."""


def _name(scale: float) -> str:
    return f"T = {scale:g}"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every scale on every clip of both halves with every seed."""
    last = QUICK_FRAMES if scale.quick else FRAMES

    def arguments(one: Candidate, clip: str, seed: int) -> dict[str, Any]:
        return one.attempt(clip, seed, EVALUATIONS, last=last).plain()

    return tuple(
        trial
        for half in HALVES
        for kind in KINDS[: 1 if scale.quick else None]
        for one in (
            Candidate(_name(value), "tempered", WEIGHTING, {"likelihood_scale": value})
            for value in (SCALES[2:5:2] if scale.quick else SCALES)
        )
        for trial in each_seed(
            f"{one.name}, {clip_name(half, kind)}",
            scale.seeds,
            partial(arguments, one, clip_name(half, kind)),
        )
    )


def share_nearer(points: Array, weights: Array, truth: Array) -> Array:
    """(M,) of each joint the share of a cloud's weight that is nearer to its mean than the truth.

    points : (N, M, 3) mm. weights : (N,) normalised. truth : (M, 3). Near by the cloud's covariance of the joint.
    """
    mean = np.tensordot(weights, points, axes=1)
    away, off = points - mean, truth - mean
    covariance: Array = np.einsum("n,nmi,nmj->mij", weights, away, away) + RIDGE_MM**2 * np.eye(3)
    inverse = np.linalg.inv(covariance)
    own = np.einsum("nmi,mij,nmj->nm", away, inverse, away)
    return weights @ (own < np.einsum("mi,mij,mj->m", off, inverse, off))


@kept_as("open_questions.likelihood_scale.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Shares (K, M) of K frames and M joints; mean error and frames with a limb lost."""
    attempt = TrackingTrial.of_plain(arguments)
    session = cache.session(attempt.footage)
    body = session.body()
    if session.truth_path is None:
        raise TruthError(f"Session '{session.name}' has no truth.", "Take one made by 'studio synthesize'.")
    frames = list(range(FIRST, int(attempt.last or session.manifest.frame_count), EVERY))
    truth = dict(zip(frames, body_points(body, true_poses(session, body, frames)), strict=True))
    last: dict[int, LayerRecord] = {}
    tracked = track(attempt, cache, on_layer=lambda record: last.update({record.frame: record}))
    shares = [
        share_nearer(
            body_points(body, last[frame].poses),
            np.exp(normalised(last[frame].log_weights, last[frame].beta)),
            truth[frame],
        )
        for frame in frames
    ]
    return {
        "shares": np.round(shares, 4).tolist(),
        "mean_mm": tracked.mean_mm,
        "lost": tracked.lost_frames / len(tracked.frames),
    }


def covered(entries: Sequence[Mapping[str, Any]]) -> Array:
    """(3,) in how many of the cases the truth lies within the region that promises PROMISED."""
    shares = np.concatenate([np.ravel(one["shares"]) for one in entries])
    return np.array([float((shares <= level).mean()) for level in PROMISED])


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """The scale chosen, what it covers on the reporting half by clip, and the same of all scales."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for outcome in outcomes:
        name, _, clip = group_of(outcome.trial).partition(", ")
        groups.setdefault((name, clip), []).append(outcome.measured)
    names = list(dict.fromkeys(name for name, _ in groups))
    clips = {half: [clip for _, clip in groups if clip.startswith(half)] for half in HALVES}

    def of(name: str, half: str) -> list[Mapping[str, Any]]:
        return [one for clip in dict.fromkeys(clips[half]) for one in groups.get((name, clip), [])]

    wrong = {name: float(np.abs(covered(of(name, CHOOSING)) - PROMISED).max()) for name in names}
    chosen = min(names, key=lambda name: wrong[name])
    for level, value in zip(PROMISED, covered(of(chosen, REPORTING)).tolist(), strict=True):
        yield number(f"{chosen}, reporting half: truth within {100 * level:.0f} %", [100.0 * value], "%")
    rows = [
        (
            half,
            name,
            *(round(100.0 * value, 1) for value in covered(of(name, half)).tolist()),
            round(float(np.mean([one["mean_mm"] for one in of(name, half)])), 1),
            round(100.0 * float(np.mean([one["lost"] for one in of(name, half)])), 1),
        )
        for half in HALVES
        for name in names
    ]
    heads = ("within 50 %", "within 80 %", "within 95 %")
    yield Table(
        "Every scale", ("half", "scale", *heads, "error (mm)", "limb lost (% of frames)"), tuple(rows)
    )
    by_clip = [
        (clip, *(round(100.0 * value, 1) for value in covered(groups[chosen, clip]).tolist()))
        for clip in dict.fromkeys(clips[REPORTING])
    ]
    yield Table(f"{chosen}, each clip of the reporting half", ("clip", *heads), tuple(by_clip))
    promised = (0.0, *PROMISED, 1.0)
    series = [
        Series(name, promised, (0.0, *covered(of(name, REPORTING)).tolist(), 1.0)) for name in names
    ] + [Series("as promised", promised, promised, dashed=True)]
    yield Chart("Promised and found, reporting half", "lines", "promised", "found", tuple(series))
    yield {"weighting": WEIGHTING, "evaluations": EVALUATIONS, "frames": FRAMES, "every frames": EVERY}


CLIPS = tuple(clip_name(half, kind) for half in HALVES for kind in KINDS)
EXPERIMENTS = (listed("likelihood-scale", trials, measure, shown, footage=CLIPS),)
