"""Whether there is a second answer: clusters of a layer's particles by where the body's points are.

Average linkage on the largest distance of any point, cut where bodies differ by what counts as a lost limb; clusters
that are no valley apart are joined again: along the line between their means they must have D > 4 (D = √2 |μ1 - μ2| /
√(σ1² + σ2²), Ashman, Bird & Zepf 1994, "Detecting bimodality in astronomical datasets", Eq. 4, where 2 is asked of two
Gaussians; the halves of one uniform cloud have 3.5).
"""

import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy
from cachetools import LRUCache

from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices, Mask
from studio.results.evaluation.errors import lost_mm
from studio.results.inspection.over_frames import stamps_of
from studio.results.inspection.reading import InspectedFrame, InspectedRun, TriedFrame, no_value
from studio.results.inspection.reference import body_points, by_limb, true_points
from studio.results.inspection.tables import Row, Selection, View, ViewResult, table
from studio.search.trackers.side_exchange import kinds_of
from studio.sessions.results_reader import ResultsReader

VIEW = View(
    "modes",
    "Modes",
    "Is there a second answer?",
    ("layer",),
    (
        table(
            "modes",
            "Clusters of the layer",
            ("mode", "Mode"),
            ("mass", "Share of the weight"),
            ("particles", "Particles"),
            ("best_log_weight", "Best log weight", "nats"),
            ("distance", "Distance from the heaviest mode", "mm"),
            ("farthest", "Farthest limb"),
            ("exchanged", "Limbs exchanged with the heaviest mode"),
            ("error", "Distance from the truth", "mm"),
        ),
        table(
            "layers",
            "Share of the weight by layer",
            "layer",
            ("mode", "Mode"),
            ("mass", "Share of the weight"),
            ("particles", "Particles"),
        ),
        table("poses", "Mean pose of each mode", ("mode", "Mode"), each="parameter"),
        table(
            "frames",
            "Modes by frame",
            "frame",
            ("modes", "Modes"),
            ("first_mass", "Share of the heaviest"),
            ("distance", "Distance of the two heaviest", "mm"),
            ("farthest", "Farthest limb"),
            of_run=True,
        ),
    ),
)


APART = 4.0
MOST = 600
"""So many of the heaviest particles are clustered; the others join the nearest cluster."""
LEAST_MASS = 0.01
MOST_FRAMES, KEPT_FRAMES = 100, 2000
"""Frames of a run that are clustered, and that are remembered."""


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A cluster. members : rows. mass : share of the weight. pose, points : weighted means, (D,) and (M, 3) mm."""

    members: Indices
    mass: float
    pose: Array
    points: Array


def modes_of(body: BodyModel, poses: Array, weights: Array) -> list[Mode]:
    """The clusters of weighted poses (N, D), heaviest first; those under a hundredth of the weight join the nearest."""
    points = body_points(body, poses)
    return [
        Mode(
            np.flatnonzero(mask),
            float(weights[mask].sum()),
            _mean(poses[mask], weights[mask]),
            _mean(points[mask], weights[mask]),
        )
        for mask in _clusters(points, weights, lost_mm(body))
    ]


def _mean(values: Array, weights: Array) -> Array:
    share = weights / weights.sum() if weights.sum() > 0.0 else np.full(len(weights), 1.0 / len(weights))
    return np.tensordot(share, values, axes=1)


def _clusters(points: Array, weights: Array, apart: float) -> list[Mask]:
    """(N,) masks of the clusters of points (N, M, 3), the heaviest first. apart : mm between two clusters."""
    heavy = np.argsort(-weights, kind="stable")[:MOST]
    if len(heavy) < 2:
        return [np.ones(len(weights), dtype=bool)]
    distances = np.concatenate(
        [
            np.linalg.norm(points[heavy[at + 1 :]] - points[one], axis=2).max(axis=1)
            for at, one in enumerate(heavy[:-1])
        ]
    )
    labels = scipy.cluster.hierarchy.fcluster(
        scipy.cluster.hierarchy.linkage(distances, "average"), apart, "distance"
    )
    groups = [heavy[labels == label] for label in np.unique(labels)]
    groups = _joined(points, weights, groups)
    centres = np.stack([_mean(points[group], weights[group]) for group in groups])
    nearest = np.linalg.norm(points[:, None] - centres, axis=3).max(axis=2).argmin(axis=1)
    for number, group in enumerate(groups):
        nearest[group] = number
    masks = [nearest == number for number in range(len(groups))]
    return sorted(masks, key=lambda mask: -float(weights[mask].sum()))


def _joined(points: Array, weights: Array, groups: list[Indices]) -> list[Indices]:
    """The groups, those joined that no valley divides or that weigh too little to be an answer."""
    while len(groups) > 1:
        masses = [float(weights[group].sum()) for group in groups]
        pairs = [(one, other) for one in range(len(groups)) for other in range(one)]
        light = [pair for pair in pairs if min(masses[pair[0]], masses[pair[1]]) < LEAST_MASS * sum(masses)]
        apart = {pair: _valley(points, weights, groups[pair[0]], groups[pair[1]]) for pair in light or pairs}
        one, other = min(apart, key=lambda pair: apart[pair])
        if not light and apart[one, other] > APART:
            break
        groups[other] = np.concatenate([groups[other], groups[one]])
        del groups[one]
    return groups


def _valley(points: Array, weights: Array, one: Indices, other: Indices) -> float:
    """Ashman's D of two groups of points along the line between their means."""
    first, second = _mean(points[one], weights[one]), _mean(points[other], weights[other])
    along = (second - first).ravel()
    length = float(np.linalg.norm(along))
    if length == 0.0:
        return 0.0
    spreads = 0.0
    for group, centre in ((one, first), (other, second)):
        away = (points[group] - centre).reshape(len(group), -1) @ along / length
        spreads += float(_mean(away**2, weights[group]))
    return float(np.sqrt(2.0) * length / np.sqrt(spreads)) if spreads > 0.0 else float("inf")


def exchanged_in(body: BodyModel, one: Array, other: Array) -> str:
    """What is exchanged between two poses (D,), "left and right leg exchanged"; "" where nothing is: the exchange of
    the one must lie nearer to the other than the one itself does, and by half.
    """
    target = body_points(body, other[None])[0]
    away = float(np.linalg.norm(body_points(body, one[None])[0] - target, axis=1).mean())
    exchanged, nearest = "", 0.5 * away
    for kind in kinds_of(body):
        points = body_points(body, kind.offered(one)[None])[0]
        distance = float(np.linalg.norm(points - target, axis=1).mean())
        if distance < nearest:
            exchanged, nearest = kind.what, distance
    return exchanged


def farthest_limb(body: BodyModel, one: Array, other: Array) -> tuple[str, float]:
    """The limb whose points (M, 3) differ most between two bodies, and its mean distance, mm."""
    away = {limb: float(mm) for limb, mm in by_limb(body, np.linalg.norm(one - other, axis=1)).items()}
    limb = max(away, key=lambda name: away[name] if np.isfinite(away[name]) else -1.0)
    return limb, away[limb]


def rows(frame: InspectedFrame, selection: Selection) -> ViewResult:
    """The tables of view `modes`: clusters of the selected layer and, of the same places, their mass in every layer."""
    run, chosen = frame.of, frame.layer(selection)
    body, record = run.body, frame.layers[chosen]
    modes = modes_of(body, record.poses, frame.weights(chosen))
    truth = true_points(run, frame.number)
    table: list[Row] = []
    for number, mode in enumerate(modes):
        limb, _ = farthest_limb(body, mode.points, modes[0].points)
        distance = float(np.linalg.norm(mode.points - modes[0].points, axis=1).max())
        error = float("nan")
        if truth is not None:
            away: Array = np.linalg.norm(mode.points - truth, axis=1)
            error = float(np.nanmean(away))
        table.append(
            (
                number,
                mode.mass,
                len(mode.members),
                float(record.log_weights[mode.members].max()),
                distance,
                limb if number else "",
                exchanged_in(body, modes[0].pose, mode.pose) if number else "",
                no_value(error),
            )
        )
    return ViewResult(
        {
            "modes": table,
            "layers": _masses(frame, modes),
            "poses": [(number, *map(float, mode.pose)) for number, mode in enumerate(modes)],
        }
    )


def _masses(frame: InspectedFrame, modes: list[Mode]) -> list[Row]:
    """Share of every layer's weight, and particles, that lie nearest to each mode."""
    centres = np.stack([mode.points for mode in modes])
    table: list[Row] = []
    for layer, record in enumerate(frame.layers):
        points, weights = body_points(frame.of.body, record.poses), frame.weights(layer)
        nearest = np.linalg.norm(points[:, None] - centres, axis=3).max(axis=2).argmin(axis=1)
        for number in range(len(modes)):
            own = nearest == number
            table.append((layer, number, float(weights[own].sum()), int(own.sum())))
    return table


def over_run(run: InspectedRun, selection: Selection) -> ViewResult:
    """Modes of the last layer by frame; of a long run some frames, evenly spread."""
    with run.run.results() as results:
        stamps = stamps_of(results.timeline())
        frames = list(stamps)
        chosen = frames[:: max(1, -(-len(frames) // MOST_FRAMES))]
        if run.tried is not None:
            chosen = sorted({*chosen, run.tried.number})
            stamps[run.tried.number] = _stamp_of(run.tried)
        table = [_row_of_frame(run, number, stamps[number], results) for number in chosen]
    notes = (
        () if len(chosen) == len(frames) else (f"Every {len(frames) // len(chosen)}th frame or so is shown.",)
    )
    return ViewResult({"frames": table}, notes)


def _stamp_of(tried: TriedFrame) -> tuple[float, float, int]:
    result = tried.result
    return result.estimate.log_weight, result.milliseconds, result.settings_version


_lock = threading.Lock()
_known = LRUCache[tuple[Path, int, object], Row](KEPT_FRAMES)


def _row_of_frame(run: InspectedRun, number: int, stamp: object, results: ResultsReader) -> Row:
    """Modes of a frame's last layer; clustered once for as long as the frame is the same."""
    key = (run.run.folder, number, stamp)
    with _lock:
        if key in _known:
            return _known[key]
    frame = run.frame(number, results)
    modes = modes_of(run.body, frame.layers[-1].poses, frame.weights(len(frame.layers) - 1))
    limb, distance = ("", 0.0)
    if len(modes) > 1:
        limb, distance = farthest_limb(run.body, modes[0].points, modes[1].points)
    row = (number, len(modes), modes[0].mass, distance, limb)
    with _lock:
        _known[key] = row
    return row
