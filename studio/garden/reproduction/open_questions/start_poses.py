"""Is a start pose as often right as its confidence says? Poses searched from nothing on the suite of drawn clips.

Right: a mean marker error of at most `RIGHT_MM`. What the confidence is made of was set on the choosing half
(`runs.setup.initialising.trust`); the reporting half, with other seeds of the search, judges it.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from studio.body.motion_files.trc import read_trc
from studio.foundations.errors import TruthError
from studio.garden.drawn_recipes import HALVES, KINDS, REPORTING, clip_name
from studio.garden.reproduction.claims import percent
from studio.garden.reproduction.experiment import Part, each_seed, listed
from studio.results.comparison.findings import Chart, Plain, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.evaluation.errors import evaluate
from studio.runs.setup.initialising import initialise

FRAMES = (0, 25, 39)
"""The first is a clip's calmest; every clip has the last."""
QUICK_KINDS = ("walk", "turns", "leap", "hard")
RIGHT_MM = 100.0
SURE = 0.9
CLASSES = (0.0, 0.25, 0.5, 0.75, SURE, 0.97, 1.0)
"""Bounds of the classes of confidence."""


def trials(scale: Scale) -> tuple[Trial, ...]:
    """A start pose in each frame of every clip with every seed."""

    def arguments(clip: str, frame: int, seed: int) -> dict[str, Any]:
        return {"footage": clip, "frame": frame, "seed": seed}

    return tuple(
        trial
        for half in HALVES
        for kind in (QUICK_KINDS if scale.quick else KINDS)
        for frame in FRAMES[: 1 if scale.quick else None]
        for trial in each_seed(
            f"{half} {kind}, frame {frame}", scale.seeds, partial(arguments, clip_name(half, kind), frame)
        )
    )


@kept_as("open_questions.start_poses.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """The confidence of a start pose, and its mean and largest marker error, mm."""
    session = cache.session(arguments["footage"])
    if session.truth_path is None:
        raise TruthError(f"Session '{session.name}' has no truth.", "Take one made by 'studio synthesize'.")
    frame = int(arguments["frame"])
    start = initialise(session, frame, seed=int(arguments["seed"]))
    truth, frames = read_trc(session.truth_path), np.array([frame])
    errors = evaluate(start.pose[None], frames, session.body(), truth, session.manifest.fps)
    return {"confidence": start.confidence, "mean_mm": errors.mean_mm, "worst_mm": errors.worst_mm}


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """By half: how often poses of each class of confidence are right, and those that are wrong though sure."""
    curves: list[Series] = []
    for half in HALVES:
        own = [one for one in outcomes if one.trial.label.startswith(f"{half} ")]
        sure = np.array([one.measured["confidence"] for one in own])
        right = np.array([one.measured["mean_mm"] <= RIGHT_MM for one in own])
        yield percent(f"right, of all, {half}", right)
        if (sure >= SURE).any():
            yield percent(
                f"right, of those called {100 * SURE:.0f} % sure or more, {half}",
                right[sure >= SURE],
                100.0 * SURE if half == REPORTING else None,
            )
        rows, middles, shares = list[tuple[Plain, ...]](), list[float](), list[float]()
        for low, high in itertools.pairwise(CLASSES):
            within = (sure >= low) & ((sure < high) | (high == CLASSES[-1]))
            if within.any():
                middles.append(100.0 * float(sure[within].mean()))
                shares.append(100.0 * float(right[within].mean()))
                bounds = f"{100 * low:.0f} to {100 * high:.0f} %"
                rows.append((bounds, int(within.sum()), round(middles[-1], 1), round(shares[-1], 1)))
        curves.append(Series(half, tuple(middles), tuple(shares), group=half))
        yield Table(
            f"Start poses by confidence: {half} half",
            ("confidence", "start poses", "mean confidence (%)", "right (%)"),
            tuple(rows),
        )
        wrong = [
            (one.trial.label, *(round(float(one.measured[name]), 2) for name in ("confidence", "mean_mm")))
            for one, good in zip(own, right, strict=True)
            if not good
        ]
        yield Table(
            f"Wrong start poses: {half} half", ("clip", "confidence", "mean error (mm)"), tuple(wrong)
        )
    curves.append(Series("as often right as called", (0.0, 100.0), (0.0, 100.0), group="ideal", dashed=True))
    yield Chart("How often a start pose is right", "lines", "confidence (%)", "right (%)", tuple(curves))
    yield {"right (mm)": RIGHT_MM, "frames": ", ".join(map(str, FRAMES))}


EXPERIMENTS = (
    listed(
        "start-poses",
        trials,
        measure,
        shown,
        footage=tuple(clip_name(half, kind) for half in HALVES for kind in KINDS),
    ),
)
