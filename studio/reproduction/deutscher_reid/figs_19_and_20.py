"""Figs. 19 and 20: how the parameters of a whole body are localised over the layers of one frame.

Fig. 19 draws the variance of every parameter, Fig. 20 all particles. Every seed tracks some frames of the person who
walks in a circle; what is kept is the mean over the frames of each parameter's variance over that of the frame's
first cloud, and how widely the particles scatter the markers.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.comparison.findings import Chart, Findings, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number
from studio.comparison.tracked import Attempt, track
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.deutscher_reid.setting import (
    BODY,
    CIRCLE,
    EQ18_WORDS,
    IMPROVED,
    SOURCE,
    WEIGHTING,
    share_number,
    times_in_words,
)
from studio.reproduction.drawing import layer_table, line, line_chart, places, seeds_and_mean
from studio.reproduction.experiment import Experiment
from studio.runs.hierarchy import hierarchy_of
from studio.tracking.tracker import LayerRecord

Array = NDArray[np.float64]

FRAMES, QUICK_FRAMES = 20, 8
# From one seed's first frame to the next one's.
STRIDE, QUICK_STRIDE, FOOTAGE_FRAMES = 37, 20, 240
KNOBS: Mapping[str, Any] = {**IMPROVED, "layers": 10, "particles": 200}
SHARE = "variance over the first cloud's"
# Ranks in the tree: the root; what hangs on the trunk; what lies beyond elbow and knee.
RANKS = ("torso", "hips, shoulders and head", "elbows, knees and beyond")
# Markers of both sides that tell how far out a part is.
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
    return tuple(
        Trial(
            f"layers of a whole body, seed {seed}",
            Attempt(
                CIRCLE,
                "annealed",
                WEIGHTING,
                seed,
                KNOBS,
                first=first,
                last=first + frames,
            ).plain(),
        )
        for seed, first in ((seed, seed * stride % (FOOTAGE_FRAMES - FRAMES)) for seed in scale.seeds)
    )


@kept_as("deutscher_reid.figs_19_and_20.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Shares of the first cloud's variance per layer and parameter, and the scatter of PARTS (mm) per layer, means
    over the frames but the first, which is searched several times.
    """
    attempt = Attempt.of_plain(arguments)
    session = shelf.session(attempt.footage)
    body = session.body(attempt.body or None)
    records: list[LayerRecord] = []
    found = track(attempt, shelf, on_layer=records.append)
    names = [marker.name for marker in body.markers]
    columns = [[names.index(name) for name in part] for part in PARTS.values()]
    shares, scatter = [], []
    for frame in found.frames[1:]:
        layers = [record for record in records if record.frame == frame]
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
        "mean_mm": found.mean_mm,
    }


def conclude_fig_19(outcomes: Sequence[Outcome]) -> Findings:
    """Parameters fall at different rates, those of the torso first. A parameter's rate: the mean over the layers of
    its variance over the first cloud's.
    """
    shares = np.array([outcome.measured["shares"] for outcome in outcomes])
    rank = np.array(outcomes[0].measured["rank"])
    rates = shares.mean(axis=1)
    by_rank = np.stack([rates[:, rank == number].mean(axis=1) for number in range(len(RANKS))], axis=1)
    ordered = [bool(np.all(np.diff(row) > 0)) for row in by_rank]
    slowest = [float(row.max() / row.min()) for row in rates]
    torso_first = share_number("torso first, then hips and shoulders, then the rest", ordered)
    differ = number("slowest over fastest parameter's mean share", slowest, "×")
    numbers = (
        torso_first,
        differ,
        *(number(f"mean share, {name}", by_rank[:, index].tolist(), "") for index, name in enumerate(RANKS)),
        number(
            "mean error of the tracked frames", [outcome.measured["mean_mm"] for outcome in outcomes], "mm"
        ),
    )
    words = (
        "The parameters' variances fall at different rates: averaged over the layers the slowest keeps "
        f"{differ.ours:.1f} "
        f"times the share of the fastest. By rank in the tree the order torso, hips and shoulders, elbows and knees "
        f"holds in {times_in_words(ordered)} (mean shares {', '.join(f'{v:.2f}' for v in by_rank.mean(axis=0))}). The "
        f"paper calls the pattern more complicated than the arm's and prints no figures. {EQ18_WORDS}"
    )
    charts = (_rank_chart(shares, rank), _parameter_chart(outcomes, shares))
    table = Table(
        "Mean share of the first cloud's variance over the layers",
        ("parameter", "part", "mean share", "after the last layer"),
        tuple(
            (
                label,
                RANKS[rank[index]],
                round(float(rates[:, index].mean()), 3),
                _small(shares[:, -1, index].mean()),
            )
            for index, label in enumerate(outcomes[0].measured["parameters"])
        ),
    )
    return Findings(torso_first.verdict, words, numbers, (table,), charts, _settings())


def conclude_fig_20(outcomes: Sequence[Outcome]) -> Findings:
    """The particles draw together from the torso to the ends of the limbs."""
    scatter = np.array([outcome.measured["scatter"] for outcome in outcomes])
    shares = (scatter / scatter[:, :1]).mean(axis=1)
    names = list(PARTS)
    column = {name: index for index, name in enumerate(names)}
    legs = [bool(row[column["hips"]] < row[column["knees"]] < row[column["ankles"]]) for row in shares]
    arms = [bool(row[column["shoulders"]] < row[column["elbows"]] < row[column["wrists"]]) for row in shares]
    both = [one and other for one, other in zip(legs, arms, strict=True)]
    order = share_number("from the torso outwards, in legs and arms", both)
    numbers = (
        order,
        share_number("hips, then knees, then ankles", legs, None),
        share_number("shoulders, then elbows, then wrists", arms, None),
        *(
            number(f"scatter of the {name}, last layer", scatter[:, -1, column[name]].tolist(), "mm")
            for name in names
        ),
    )
    words = (
        "How far the particles have drawn together, as a share of their scatter in the first cloud and "
        "averaged over the "
        f"layers, is in order hips, knees, ankles in {times_in_words(legs)} and shoulders, elbows, wrists in "
        f"{times_in_words(arms)}; Fig. 20 shows the order from the torso to the limbs' joints. {EQ18_WORDS}"
    )
    mean = scatter.mean(axis=0)
    fall = (line(name, places(len(mean), first=1), mean[:, index]) for index, name in enumerate(names))
    chart = line_chart("Scatter of the particles' joints over the layers", "layer", "mm", fall, log_y=True)
    table = layer_table("Mean scatter (mm)", names, mean)
    return Findings(order.verdict, words, numbers, (table,), (chart,), _settings())


def _rank_chart(shares: Array, rank: NDArray[np.int64]) -> Chart:
    layers = places(shares.shape[1], first=1)
    series = [
        entry
        for index, name in enumerate(RANKS)
        for entry in seeds_and_mean(name, layers, shares[:, :, rank == index].mean(axis=2))
    ]
    return line_chart("Variance over the layers, by rank in the tree", "layer", SHARE, series, log_y=True)


def _parameter_chart(outcomes: Sequence[Outcome], shares: Array) -> Chart:
    layers, mean = places(shares.shape[1], first=1), shares.mean(axis=0)
    series = (
        line(label, layers, mean[:, index]) for index, label in enumerate(outcomes[0].measured["parameters"])
    )
    return line_chart("Variance over the layers, every parameter", "layer", SHARE, series, log_y=True)


def _small(value: float) -> str:
    return f"{value:.2g}"


def _settings() -> dict[str, Any]:
    return {"footage": CIRCLE, "body": BODY, "weighting": WEIGHTING, **KNOBS}


EXPERIMENTS = (
    Experiment(
        name="deutscher-fig-19",
        title="Variance reduction of a whole body",
        source=f"{SOURCE}, Fig. 19",
        claim="The parameters of a whole body are localised at clearly different rates, in a more complicated pattern "
        "than those of the arm.",
        trials=trials,
        measure=measure,
        conclude=conclude_fig_19,
        footage=(CIRCLE,),
    ),
    Experiment(
        name="deutscher-fig-20",
        title="Particles of a whole body over the layers",
        source=f"{SOURCE}, Fig. 20",
        claim="The particles draw together hierarchically, from the torso's rotation and translation out to the limbs' "
        "joint angles.",
        trials=trials,
        measure=measure,
        conclude=conclude_fig_20,
        footage=(CIRCLE,),
    ),
)
