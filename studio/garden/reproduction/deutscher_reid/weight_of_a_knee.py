"""Fig. 7: the weight as a function of one knee's angle, all else at the true pose.

Every seed uses another frame of the person walking in a circle. The right knee is turned through its whole
range; the weights of edges alone, of the region alone and of both are measured against the true angle.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.signal import find_peaks

from studio.body.inverse_kinematics import known_markers, pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.trc import read_trc
from studio.foundations.arrays import Array
from studio.foundations.errors import TruthError
from studio.garden.reproduction.claims import share
from studio.garden.reproduction.deutscher_reid.setting import (
    BODY,
    CIRCLE,
    EQ17_WORDS,
    QUICK_FRAMES,
    WEIGHTING,
)
from studio.garden.reproduction.drawing import floats, line, line_chart
from studio.garden.reproduction.experiment import Part, listed
from studio.results.comparison.findings import Chart, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.evaluation.errors import rows_of_frames
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import changed_settings, default_settings
from studio.sessions.session import Session

# Beginning of the parameter's name, in every body of the catalogue.
KNEE = "right_knee"
STEPS = 321
TERMS: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "edges": (WEIGHTING, {"edge_weight": 1.0, "region_weight": 0.0}),
    "region": (WEIGHTING, {"edge_weight": 0.0, "region_weight": 1.0}),
    "both": (WEIGHTING, {"edge_weight": 1.0, "region_weight": 1.0}),
    "with the silhouette": ("edge-region-silhouette", {}),
}
"""Likelihood and knobs of each curve. The paper's is of both; the silhouette, outside the body too, is ours."""
AROUND_DEGREES = 60.0
"""Half the range about the true angle that is swept beside the knee's whole range: the paper's axis has no numbers."""
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
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Angles (degrees), the true one, and log w of each of TERMS at every angle."""
    session, frame = cache.session(arguments["footage"]), int(arguments["frame"])
    body, cameras = session.body(), session.cameras()
    pose = true_poses(session, body, [frame])[0]
    column = next(index for index, entry in enumerate(body.parameters) if entry.name.startswith(KNEE))
    knee = body.parameters[column]
    angles = np.linspace(knee.lower, knee.upper, STEPS)
    poses = np.tile(pose, (STEPS, 1))
    poses[:, column] = angles
    curves = {}
    for name, (weighting_name, knobs) in TERMS.items():
        weighting = WEIGHTINGS[weighting_name]
        settings = changed_settings(default_settings("annealed", weighting_name), knobs)
        seen = cache.evidence(session, cameras, frame, settings.evidence, weighting.edge_kind)
        likelihood = weighting.prepare(body, cameras, settings.weighting)
        curves[name] = likelihood.problem(seen).log_likelihood(poses).tolist()
    return {
        "angles": np.rad2deg(angles).tolist(),
        "truth": float(np.rad2deg(pose[column])),
        "log_weights": curves,
    }


def true_poses(session: Session, body: BodyModel, frames: list[int]) -> Array:
    """(K, D) the body fitted to the true markers of consecutive frames, each starting from the one before.

    Raises TruthError where the session has no truth, or none of a frame.
    """
    if session.truth_path is None:
        raise TruthError(f"Session '{session.name}' has no truth.", "Take one made by 'studio synthesize'.")
    truth = read_trc(session.truth_path)
    rows = rows_of_frames(truth, session.manifest.fps)
    missing = [frame for frame in frames if frame not in rows]
    if missing:
        raise TruthError(f"The truth has no row for frame {missing[0]}.", "Take frames that it has.")
    kept, names = known_markers(body, truth.names)
    own = session.start_pose(body) if body.name == session.manifest.body else None
    pose, poses = body.neutral if own is None else own, list[Array]()
    # From the start onwards, so that large changes of heading are followed.
    for frame in range(max(frames) + 1):
        if frame in rows and (frame in frames or frame % 4 == 0):
            pose = pose_from_markers(body, names, truth.positions[rows[frame], kept], pose)[0]
        if frame in frames:
            poses.append(pose)
    return np.array(poses)


def modes(weights: Array) -> list[tuple[int, float]]:
    """Distinct peaks, highest first: position, and height above the lowest point as a share of the highest.

    An end of the curve is a peak where the curve falls away from it.
    """
    height = np.ptp(weights)
    if height == 0.0:
        return []
    padded = np.concatenate([[weights.min()], weights, [weights.min()]])
    places = find_peaks(padded, prominence=PROMINENT * height)[0] - 1
    minima = [(int(place), float((weights[place] - weights.min()) / height)) for place in places]
    return sorted(minima, key=lambda mode: -mode[1])


def half_width(angles: Array, weights: Array) -> float:
    """The width of the highest peak at half of the curve's height, in the angles' unit."""
    below = np.flatnonzero(weights < 0.5 * (weights.max() + weights.min()))
    peak = np.argmax(weights)
    low = max(below[below < peak], default=-1) + 1
    high = min(below[below > peak], default=len(weights)) - 1
    return float(angles[high] - angles[low])


def _read(outcome: Outcome, name: str, around: float = math.inf) -> dict[str, Any]:
    """Figures of one term's curve. Weights, not their logs, are drawn and judged (Eq. 16). dominant : no second
    mode is more than DOMINANT as high as the first. around : degrees to either side of the true angle.
    """
    angles = np.array(outcome.measured["angles"])
    near = np.abs(angles - outcome.measured["truth"]) <= around
    angles = angles[near]
    weights = np.exp(np.array(outcome.measured["log_weights"][name]))[near]
    minima = modes(weights)
    return {
        "off": abs(float(angles[int(np.argmax(weights))]) - outcome.measured["truth"]),
        "width": half_width(angles, weights),
        "modes": len(minima),
        "dominant": bool(minima) and all(height <= DOMINANT for _, height in minima[1:]),
    }


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Modes, peaks and widths of each term; the claims are on both together. The first two frames' curves in the
    paper's form, and the combined curves of all.
    """
    rows = {name: [_read(outcome, name) for outcome in outcomes] for name in TERMS}
    yield share("both: one dominant mode", [row["dominant"] for row in rows["both"]])
    for name in TERMS:
        narrow = [_read(outcome, name, AROUND_DEGREES)["dominant"] for outcome in outcomes]
        yield share(f"{name}: one dominant mode within {AROUND_DEGREES:g}°", narrow, None)
    full = [row["dominant"] for row in rows["with the silhouette"]]
    yield share("with the silhouette: one dominant mode", full, None)
    near = [row["off"] <= NEAR_DEGREES for row in rows["both"]]
    yield share(f"both: peak within {NEAR_DEGREES:g}° of the true angle", near)
    for name, read in rows.items():
        for words, key, unit in (
            ("peak from the true angle", "off", "°"),
            ("width at half height", "width", "°"),
            ("modes that stand out", "modes", ""),
        ):
            yield number(f"{name}: {words}", [row[key] for row in read], unit)
    yield (
        "A seed is a frame; the paper shows one, and only the combined function (both), on an axis without numbers. "
        f"The claim is judged over the knee's whole range; within {AROUND_DEGREES:g}° of the true angle, and with the "
        f"silhouette's term, which is not the paper's, stand beside it. {EQ17_WORDS}"
    )
    frames = [outcome.trial.arguments["frame"] for outcome in outcomes]
    lines = tuple(
        (
            frame,
            round(outcome.measured["truth"], 1),
            *(cell for row in read for cell in (round(row["off"], 1), row["modes"])),
        )
        for frame, outcome, *read in zip(frames, outcomes, *rows.values(), strict=True)
    )
    heads = (head for name in TERMS for head in (f"{name}: off (°)", f"{name}: modes"))
    yield Table("The highest peak of each term", ("frame", "true angle (°)", *heads), lines)
    for frame, outcome in list(zip(frames, outcomes, strict=True))[:2]:
        angles, truth = tuple(outcome.measured["angles"]), outcome.measured["truth"]
        weights = outcome.measured["log_weights"].items()
        series = tuple(line(name, angles, np.exp(values)) for name, values in weights)
        title = f"Weight against the right knee's angle, frame {frame}"
        bands = ((truth - 1.0, truth + 1.0, "true angle"),)
        yield Chart(title, "lines", "right knee (°)", "weight", series, bands=bands)
    shifted = (
        Series(
            f"frame {frame}",
            floats(np.array(outcome.measured["angles"]) - outcome.measured["truth"]),
            floats(np.exp(outcome.measured["log_weights"]["both"])),
            group="both",
            thin=index > 0,
        )
        for index, (frame, outcome) in enumerate(zip(frames, outcomes, strict=True))
    )
    yield line_chart(
        "Edges and region together, every frame", "knee from its true angle (°)", "weight", shifted
    )
    yield {"footage": CIRCLE, "body": BODY, "parameter": KNEE, "angles": STEPS}


EXPERIMENTS = (listed("deutscher-fig-7", trials, measure, shown, footage=(CIRCLE,)),)
