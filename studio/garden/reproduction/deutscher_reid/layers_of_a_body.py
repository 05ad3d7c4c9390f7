"""Effect of a frame's layers on the particles of a whole body: Figs. 3, 19 and 20, a person walking in a circle.

Fig. 3 draws the particles' horizontal places, Fig. 19 the variance of every parameter, Fig. 20 all particles. Of the
latter every seed tracks some frames; the results are the mean over the frames of each parameter's variance relative to
the frame's first cloud, and the scatter of the markers over the particles.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import read_trc
from studio.foundations.arrays import Array
from studio.foundations.errors import TruthError
from studio.garden.reproduction.claims import beside, share
from studio.garden.reproduction.deutscher_reid.setting import (
    BODY,
    CIRCLE,
    EQ18_WORDS,
    IMPROVED,
    PLAIN,
    WEIGHTING,
)
from studio.garden.reproduction.drawing import layer_table, line, line_chart, places, seeds_and_mean
from studio.garden.reproduction.experiment import Part, each_seed, listed, measured
from studio.results.comparison.findings import Chart, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import TrackingTrial, track
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.evaluation.errors import rows_of_frames
from studio.runs.hierarchy import hierarchy_of
from studio.search.trackers.tracker import LayerRecord
from studio.sessions.session import Session

SETTINGS: Mapping[str, Any] = {"footage": CIRCLE, "body": BODY, "weighting": WEIGHTING}


def _tracked_layers(
    arguments: Mapping[str, Any], cache: FootageCache
) -> tuple[TrackingTrial, list[int], list[list[LayerRecord]], float]:
    """The attempt, its frames, every frame's layers, and the mean error, mm."""
    attempt = TrackingTrial.of_plain(arguments)
    records: list[LayerRecord] = []
    tracked = track(attempt, cache, on_layer=records.append)
    return (
        attempt,
        tracked.frames,
        [[record for record in records if record.frame == frame] for frame in tracked.frames],
        tracked.mean_mm,
    )


# Fig. 3.

FIG_3_FRAMES, QUICK_FIG_3_FRAMES = 60, 20
FIG_3_KNOBS: Mapping[str, Any] = {**PLAIN, "layers": 10, "particles": 200}
PLACES = ("pelvis_x", "pelvis_y")
# The marker at the pelvis, whose place these parameters are.
ROOT_MARKER = "Hip"
# Standard deviations within which a cloud covers a point.
COVERED = 3.0
DRAWN_LAYERS = (0, 1, 2, 6, 7, 9)


def trials_fig_3(scale: Scale) -> tuple[Trial, ...]:
    """One a seed."""
    last = QUICK_FIG_3_FRAMES if scale.quick else FIG_3_FRAMES
    return tuple(
        each_seed(
            "clouds",
            scale.seeds,
            lambda seed: TrackingTrial(CIRCLE, "annealed", WEIGHTING, seed, FIG_3_KNOBS, last=last).plain(),
        )
    )


@kept_as("deutscher_reid.fig_3.measure")
def measure_fig_3(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """The spread per layer (mm, of x and y together), whether the first cloud covers the true movement, how far the
    last one's middle is from the true place, means over the frames but the first; and the clouds of the middle frame.
    """
    attempt, frames, layers, _ = _tracked_layers(arguments, cache)
    session = cache.session(attempt.footage)
    names = [entry.name for entry in session.body(attempt.body or None).parameters]
    columns = [names.index(name) for name in PLACES]
    truth = true_places(session, frames)
    spreads, covered, distances, clouds = list[list[float]](), list[bool](), list[float](), list[Any]()
    last = layers[0][-1].mean[columns]
    for row in range(1, len(frames)):
        clouds_of_layers: list[Array] = [record.poses[:, columns] for record in layers[row]]
        place: Array = truth[row]
        spreads.append([np.sqrt(cloud.var(axis=0).sum()) for cloud in clouds_of_layers])
        covered.append(covers(clouds_of_layers[0], last + truth[row] - truth[row - 1]))
        last = layers[row][-1].mean[columns]
        distances.append(float(np.linalg.norm(last - truth[row])))
        if row == len(frames) // 2:
            clouds = [np.round(clouds_of_layers[layer] - place, 2).tolist() for layer in DRAWN_LAYERS]
    return {
        "spreads": np.mean(spreads, axis=0).tolist(),
        "covered": float(np.mean(covered)),
        "distance": float(np.mean(distances)),
        "clouds": clouds,
    }


def true_places(session: Session, frames: Sequence[int]) -> Array:
    """(K, 2) true positions of the pelvis, x and y in mm. Raises TruthError where the session has no truth."""
    if session.truth_path is None:
        raise TruthError(f"Session '{session.name}' has no truth.", "Take one made by 'studio synthesize'.")
    truth = read_trc(session.truth_path)
    if ROOT_MARKER not in truth.names:
        raise TruthError(f"The truth has no marker '{ROOT_MARKER}'.", "Take footage of a person.")
    rows = rows_of_frames(truth, session.manifest.fps)
    return truth.positions[[rows[frame] for frame in frames], truth.names.index(ROOT_MARKER), :2]


def covers(cloud: Array, place: Array) -> bool:
    """Whether a place (2,) lies within COVERED standard deviations of a cloud (N, 2)."""
    away: Array = place - cloud.mean(axis=0)
    return bool(away @ np.linalg.solve(np.cov(cloud.T), away) <= COVERED**2)


def fig_3(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """The first cloud covers the movement, and the clouds draw together layer by layer."""
    spreads = measured(outcomes, "spreads")
    layers = spreads.shape[1]
    falls = (np.diff(spreads, axis=1) < 0).sum(axis=1)
    # Both hold by construction: σ0 is half the largest movement, and every layer's noise is less than the one's before.
    yield beside(number("first cloud covers the true movement", measured(outcomes, "covered"), "of 1", 1.0))
    yield number("layers with a smaller spread than the one before", falls, f"of {layers - 1}")
    yield share("the last cloud is the smallest", spreads.argmin(axis=1) == layers - 1, None)
    yield number("spread of the first cloud", spreads[:, 0], "mm")
    yield number("spread of the last cloud", spreads[:, -1], "mm")
    yield number("last cloud's middle from the true place", measured(outcomes, "distance"), "mm")
    yield (
        "No verdict: the first cloud is as wide as the movement and the last one the smallest by construction, and "
        "whether the weighting's maximum lies in the last one is not measured. To cover: within "
        f"{COVERED:g} standard deviations. The rendered person is not made of cones, and a layer of Eq. 13 first "
        "spreads more than it selects."
    )
    clouds = tuple(
        line(f"layer {layer + 1}", *np.array(cloud).T)
        for layer, cloud in zip(DRAWN_LAYERS, outcomes[0].measured["clouds"], strict=True)
    )
    yield Chart("Particles of one frame around the true place", "points", "x (mm)", "y (mm)", clouds)
    fall = seeds_and_mean("spread", places(layers, first=1), spreads)
    yield line_chart("Spread over the layers", "layer", "spread (mm)", fall, log_y=True)
    yield layer_table("Mean spread", ("mm",), spreads.mean(axis=0)[:, None], digits=2)
    yield {**SETTINGS, **FIG_3_KNOBS}


# Figs. 19 and 20.

FRAMES, QUICK_FRAMES = 20, 8
# From one seed's first frame to the next one's.
STRIDE, QUICK_STRIDE, FOOTAGE_FRAMES = 37, 20, 240
KNOBS: Mapping[str, Any] = {**IMPROVED, "layers": 10, "particles": 200}
SHARE = "variance over the first cloud's"
# Ranks in the tree: the root; what hangs on the trunk; what lies beyond elbow and knee.
RANKS = ("torso", "hips, shoulders and head", "elbows, knees and beyond")
# Markers of both sides, by distance from the trunk.
PARTS: Mapping[str, tuple[str, ...]] = {
    "hips": ("LHip", "RHip"),
    "shoulders": ("LShoulder", "RShoulder"),
    "knees": ("LKnee", "RKnee"),
    "elbows": ("LElbow", "RElbow"),
    "ankles": ("LAnkle", "RAnkle"),
    "wrists": ("LWrist", "RWrist"),
}


def trials(scale: Scale) -> tuple[Trial, ...]:
    """One a seed; the same for both figures."""
    frames, stride = (QUICK_FRAMES, QUICK_STRIDE) if scale.quick else (FRAMES, STRIDE)

    def arguments(seed: int) -> Mapping[str, Any]:
        first = seed * stride % (FOOTAGE_FRAMES - FRAMES)
        return TrackingTrial(
            CIRCLE, "annealed", WEIGHTING, seed, KNOBS, first=first, last=first + frames
        ).plain()

    return tuple(each_seed("layers of a whole body", scale.seeds, arguments))


@kept_as("deutscher_reid.figs_19_and_20.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Shares of the first cloud's variance per layer and parameter, and the scatter of PARTS (mm) per layer, means
    over the frames but the first, which is searched several times.
    """
    attempt, _, frames, mean_mm = _tracked_layers(arguments, cache)
    body = cache.session(attempt.footage).body(attempt.body or None)
    names = [marker.name for marker in body.markers]
    columns = [[names.index(name) for name in part] for part in PARTS.values()]
    shares, scatter = list[list[Array]](), list[list[list[float]]]()
    for layers in frames[1:]:
        shares.append([record.variance_weighed / layers[0].variance_weighed for record in layers])
        clouds = [marker_points(body, record.poses) for record in layers]
        scatter.append(
            [[np.sqrt(cloud[:, part].var(axis=0).sum(axis=1)).mean() for part in columns] for cloud in clouds]
        )
    return {
        "parameters": [entry.label for entry in body.parameters],
        "rank": hierarchy_of(body).depth.tolist(),
        "shares": np.mean(shares, axis=0).tolist(),
        "scatter": np.mean(scatter, axis=0).tolist(),
        "mean_mm": mean_mm,
    }


def fig_19(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Parameters fall at different rates, those of the torso first. A parameter's rate: the mean over the layers of
    its variance over the first cloud's.
    """
    shares, labels = measured(outcomes, "shares"), outcomes[0].measured["parameters"]
    rank = np.array(outcomes[0].measured["rank"])
    rates = shares.mean(axis=1)
    by_rank = np.stack([rates[:, rank == place].mean(axis=1) for place in range(len(RANKS))], axis=1)
    yield share("torso first, then hips and shoulders, then the rest", np.all(np.diff(by_rank) > 0, axis=1))
    yield number("slowest over fastest parameter's mean share", rates.max(axis=1) / rates.min(axis=1), "×")
    for name, values in zip(RANKS, by_rank.T, strict=True):
        yield number(f"mean share, {name}", values)
    yield number("mean error of the tracked frames", measured(outcomes, "mean_mm"), "mm")
    yield f"The paper calls the pattern more complicated than the arm's and prints no figures. {EQ18_WORDS}"
    rows = (
        (
            label,
            RANKS[int(rank[index])],
            round(float(rates[:, index].mean()), 3),
            f"{shares[:, -1, index].mean():.2g}",
        )
        for index, label in enumerate(labels)
    )
    heads = ("parameter", "part", "mean share", "after the last layer")
    yield Table("Mean share of the first cloud's variance over the layers", heads, tuple(rows))
    layers = places(shares.shape[1], first=1)
    ranks = (
        entry
        for place, name in enumerate(RANKS)
        for entry in seeds_and_mean(name, layers, shares[:, :, rank == place].mean(axis=2))
    )
    yield line_chart("Variance over the layers, by rank in the tree", "layer", SHARE, ranks, log_y=True)
    every = (line(label, layers, row) for label, row in zip(labels, shares.mean(axis=0).T, strict=True))
    yield line_chart("Variance over the layers, every parameter", "layer", SHARE, every, log_y=True)
    yield {**SETTINGS, **KNOBS}


def fig_20(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """The particles draw together from the torso to the ends of the limbs."""
    scatter = measured(outcomes, "scatter")
    shares = dict(zip(PARTS, (scatter / scatter[:, :1]).mean(axis=1).T, strict=True))
    legs = (shares["hips"] < shares["knees"]) & (shares["knees"] < shares["ankles"])
    arms = (shares["shoulders"] < shares["elbows"]) & (shares["elbows"] < shares["wrists"])
    yield share("from the torso outwards, in legs and arms", legs & arms)
    yield share("hips, then knees, then ankles", legs, None)
    yield share("shoulders, then elbows, then wrists", arms, None)
    for index, name in enumerate(PARTS):
        yield number(f"scatter of the {name}, last layer", scatter[:, -1, index], "mm")
    yield f"In order: by the share of their scatter in the first cloud, averaged over the layers. {EQ18_WORDS}"
    mean = scatter.mean(axis=0)
    fall = (line(name, places(len(mean), first=1), row) for name, row in zip(PARTS, mean.T, strict=True))
    yield line_chart("Scatter of the particles' joints over the layers", "layer", "mm", fall, log_y=True)
    yield layer_table("Mean scatter (mm)", tuple(PARTS), mean)
    yield {**SETTINGS, **KNOBS}


EXPERIMENTS = (
    listed("deutscher-fig-3", trials_fig_3, measure_fig_3, fig_3, footage=(CIRCLE,)),
    listed("deutscher-fig-19", trials, measure, fig_19, footage=(CIRCLE,)),
    listed("deutscher-fig-20", trials, measure, fig_20, footage=(CIRCLE,)),
)
