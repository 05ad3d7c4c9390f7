"""Fig. 7: the weight as a function of one knee's angle, all else at the true pose.

Every seed looks at another frame of the person who walks in a circle. The right knee is turned through its whole
range; the weights of edges alone, of the region alone and of both are measured against the true angle.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from studio.comparison.findings import Chart, Findings, Series, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number, overall
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.deutscher_reid.setting import (
    BODY,
    CIRCLE,
    EQ17_WORDS,
    QUICK_FRAMES,
    SOURCE,
    WEIGHTING,
    share_number,
    times_in_words,
)
from studio.reproduction.deutscher_reid.true_poses import true_poses
from studio.reproduction.drawing import line, line_chart
from studio.reproduction.experiment import Experiment
from studio.settings import changed_settings, default_settings
from studio.weighting.catalogue import WEIGHTINGS

Array = NDArray[np.float64]

# How the parameter's name begins, in every body of the catalogue.
KNEE = "right_knee"
STEPS = 321
TERMS: Mapping[str, Mapping[str, float]] = {
    "edges": {"edge_weight": 1.0, "region_weight": 0.0},
    "region": {"edge_weight": 0.0, "region_weight": 1.0},
    "both": {"edge_weight": 1.0, "region_weight": 1.0},
}
# A mode stands out by this share of the curve's whole height. It dominates where no other is more than half as high
# above the curve's lowest point.
PROMINENT, DOMINANT = 0.1, 0.5
# "Highly peaked around the correct angle": the peak is no further off than this.
NEAR_DEGREES = 10.0
FRAME_STEP, FOOTAGE_FRAMES = 23, 240


def trials(scale: Scale) -> tuple[Trial, ...]:
    """One frame a seed."""
    first, step = (1, QUICK_FRAMES // 4) if scale.quick else (7, FRAME_STEP)
    return tuple(
        Trial(f"knee, frame {frame}", {"footage": CIRCLE, "frame": frame, "last": frame + 1})
        for frame in ((first + seed * step) % FOOTAGE_FRAMES for seed in scale.seeds)
    )


@kept_as("deutscher_reid.fig_7.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Angles (degrees), the true one, and log w of each of TERMS at every angle."""
    session, frame = shelf.session(arguments["footage"]), int(arguments["frame"])
    body, cameras = session.body(), session.cameras()
    pose = true_poses(session, body, [frame])[0]
    column = next(index for index, entry in enumerate(body.parameters) if entry.name.startswith(KNEE))
    knee = body.parameters[column]
    angles = np.linspace(knee.lower, knee.upper, STEPS)
    poses = np.tile(pose, (STEPS, 1))
    poses[:, column] = angles
    settings = default_settings("annealed", WEIGHTING)
    weighting = WEIGHTINGS[WEIGHTING]
    seen = shelf.evidence(session, cameras, frame, settings.evidence, weighting.edge_kind)
    curves = {}
    for name, knobs in TERMS.items():
        weigher = weighting.prepare(body, cameras, changed_settings(settings, knobs).weighting)
        curves[name] = weigher.problem(seen).weigh(poses).tolist()
    return {
        "angles": np.rad2deg(angles).tolist(),
        "truth": float(np.rad2deg(pose[column])),
        "log_weights": curves,
    }


def modes(weights: Array) -> list[tuple[int, float]]:
    """Peaks that stand out, highest first: where, and how high above the lowest point as a share of the highest.

    An end of the curve is a peak where the curve falls away from it.
    """
    height = np.ptp(weights)
    if height == 0.0:
        return []
    padded = np.concatenate([[weights.min()], weights, [weights.min()]])
    places = find_peaks(padded, prominence=PROMINENT * height)[0] - 1
    found = [(int(place), float((weights[place] - weights.min()) / height)) for place in places]
    return sorted(found, key=lambda mode: -mode[1])


def has_one_dominant_mode(weights: Array) -> bool:
    """Whether no second mode is more than DOMINANT as high as the first."""
    found = modes(weights)
    return len(found) == 1 or (len(found) > 1 and found[1][1] <= DOMINANT)


def half_width(angles: Array, weights: Array) -> float:
    """The width of the highest peak at half of the curve's height, in the angles' unit."""
    above = weights >= 0.5 * (weights.max() + weights.min())
    peak = int(np.argmax(weights))
    low = high = peak
    while low > 0 and above[low - 1]:
        low -= 1
    while high < len(weights) - 1 and above[high + 1]:
        high += 1
    return float(angles[high] - angles[low])


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """Modes, peaks and widths of each term. The verdict is on both together."""
    rows = {name: [_read(outcome, name) for outcome in outcomes] for name in TERMS}
    both = rows["both"]
    one = [row["dominant"] for row in both]
    near = [row["off"] <= NEAR_DEGREES for row in both]
    claims = (
        share_number("both: one dominant mode", one),
        share_number(f"both: peak within {NEAR_DEGREES:g}° of the true angle", near),
    )
    others = tuple(
        entry
        for name, found in rows.items()
        for entry in (
            number(f"{name}: peak from the true angle", [row["off"] for row in found], "°"),
            number(f"{name}: width at half height", [row["width"] for row in found], "°"),
            number(f"{name}: modes that stand out", [float(row["modes"]) for row in found], ""),
        )
    )
    single = {name: [row["dominant"] for row in found] for name, found in rows.items()}
    words = (
        f"Edges and region together have one dominant mode in {times_in_words(one)} and its peak within "
        f"{NEAR_DEGREES:g}° of the true knee in {times_in_words(near)}; edges alone have one dominant mode in "
        f"{times_in_words(single['edges'])}, the region alone in {times_in_words(single['region'])}. "
        f"A seed is a frame. Between peak and lowest point the weight falls by {_contrast(outcomes):.0%}: Eq. 16 is "
        f"flat, and the exponent of Eq. 3 sharpens it. {EQ17_WORDS} The paper shows one frame, and only the "
        "combined function."
    )
    rivals = [angle for row in both for angle in row["rivals"]]
    if rivals:
        words += (
            f" Where a second mode is more than half as high, it lies at {min(rivals):.0f} to "
            f"{max(rivals):.0f}° (the knee "
            f"bends to {max(outcomes[0].measured['angles']):.0f}°, where the shin is drawn on the thigh)."
        )
    settings = {"footage": CIRCLE, "body": BODY, "parameter": KNEE, "angles": STEPS}
    return Findings(
        overall(entry.verdict for entry in claims),
        words,
        (*claims, *others),
        (_table(outcomes, rows),),
        _charts(outcomes),
        settings,
    )


def _read(outcome: Outcome, name: str) -> dict[str, Any]:
    """What the curve of one term says. Weights, not their logs, are drawn and judged (Eq. 16)."""
    angles = np.array(outcome.measured["angles"])
    weights = np.exp(np.array(outcome.measured["log_weights"][name]))
    peak = float(angles[int(np.argmax(weights))])
    return {
        "off": abs(peak - outcome.measured["truth"]),
        "width": half_width(angles, weights),
        "modes": len(modes(weights)),
        "dominant": has_one_dominant_mode(weights),
        "rivals": [float(angles[place]) for place, height in modes(weights)[1:] if height > DOMINANT],
    }


def _contrast(outcomes: Sequence[Outcome]) -> float:
    """How far the combined weight falls below its peak, as a share of it: mean over the frames."""
    curves = [np.array(outcome.measured["log_weights"]["both"]) for outcome in outcomes]
    return float(np.mean([1.0 - np.exp(-np.ptp(curve)) for curve in curves]))


def _charts(outcomes: Sequence[Outcome]) -> tuple[Chart, ...]:
    """The first frame's three curves as the paper draws one, and the combined curves of all frames."""
    charts = []
    for outcome in outcomes[:2]:
        angles, truth = tuple(outcome.measured["angles"]), outcome.measured["truth"]
        weights = outcome.measured["log_weights"].items()
        series = tuple(line(name, angles, np.exp(values)) for name, values in weights)
        title = f"Weight against the right knee's angle, frame {outcome.trial.arguments['frame']}"
        bands = ((truth - 1.0, truth + 1.0, "true angle"),)
        charts.append(Chart(title, "lines", "right knee (°)", "weight", series, bands=bands))
    shifted = tuple(
        Series(
            f"frame {outcome.trial.arguments['frame']}",
            tuple((np.array(outcome.measured["angles"]) - outcome.measured["truth"]).tolist()),
            tuple(np.exp(np.array(outcome.measured["log_weights"]["both"])).tolist()),
            group="both",
            thin=index > 0,
        )
        for index, outcome in enumerate(outcomes)
    )
    title, axis = "Edges and region together, every frame", "knee from its true angle (°)"
    charts.append(line_chart(title, axis, "weight", shifted))
    return tuple(charts)


def _table(outcomes: Sequence[Outcome], rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> Table:
    lines = tuple(
        (
            outcome.trial.arguments["frame"],
            round(outcome.measured["truth"], 1),
            *(
                value
                for name in TERMS
                for value in (round(rows[name][index]["off"], 1), rows[name][index]["modes"])
            ),
        )
        for index, outcome in enumerate(outcomes)
    )
    heads = tuple(head for name in TERMS for head in (f"{name}: off (°)", f"{name}: modes"))
    return Table("The highest peak of each term", ("frame", "true angle (°)", *heads), lines)


EXPERIMENT = Experiment(
    name="deutscher-fig-7",
    title="Weight against one knee's angle",
    source=f"{SOURCE}, Fig. 7",
    claim="Varied in the right knee only, the weighting function is highly peaked around the correct angle.",
    trials=trials,
    measure=measure,
    conclude=conclude,
    footage=(CIRCLE,),
)
