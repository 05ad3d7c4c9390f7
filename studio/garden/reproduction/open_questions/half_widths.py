"""Do half widths hold? What is promised of a run's joints against what the truth of drawn clips shows.

Each clip is tracked as a user would, and its half widths are measured from its twin, which sees no truth. Then the
share of frames is counted in which a true joint is within them. The factors by which half widths are wider than twins'
errors (`results.uncertainty.half_widths.WIDER`) were chosen on the choosing half, so only the reporting half counts.
Levels that a clip's few frames do not allow have no half widths there.
"""

import math
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import RunError
from studio.foundations.progress import report
from studio.garden.drawn_recipes import CHOOSING, HALVES, KINDS, REPORTING, clip_name
from studio.garden.reproduction.experiment import Part, each_seed, listed
from studio.results.comparison.findings import Chart, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.inspection.reading import InspectedRun
from studio.results.uncertainty.conformal import LEVELS
from studio.results.uncertainty.half_widths import measure_uncertainty, true_coverage, true_errors
from studio.results.uncertainty.twin import track_to_end
from studio.runs.new_run import prepare_run
from studio.runs.problem_source import ProblemSource
from studio.sessions.session import Session

QUICK_FRAMES, QUICK_KINDS = 20, ("walk",)
SHARES = tuple(np.linspace(0.0, 1.0, 41).tolist())
PERCENT = tuple(round(100 * level) for level in LEVELS)


def trials(scale: Scale) -> tuple[Trial, ...]:
    """The clips of both halves."""
    kinds = QUICK_KINDS if scale.quick else KINDS
    last = QUICK_FRAMES if scale.quick else None

    def arguments(clip: str, seed: int) -> dict[str, Any]:
        return {"footage": clip, "seed": seed, "last": last}

    clips = [clip_name(half, kind) for half in HALVES for kind in kinds]
    return tuple(trial for clip in clips for trial in each_seed(clip, scale.seeds, partial(arguments, clip)))


@kept_as("open_questions.half_widths.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Of a clip, by joint and level: half widths (mm), shares of frames within by the truth; by joint, quantiles of
    its true errors (mm) at SHARES; of the run, its frames, blocks, and the twin's processor time over that of tracking.
    Of a run that is refused, why.
    """
    with tempfile.TemporaryDirectory(prefix="studio-half-widths-") as folder:
        place = Path(folder) / "clip"
        shutil.copytree(cache.session(arguments["footage"]).path, place)
        session = Session(place)
        began = time.process_time()
        run = prepare_run(session, seed=arguments["seed"], last=arguments["last"], allow_inconsistent=True)
        with closing(ProblemSource(session, run.body(), run.cameras())) as problems:
            track_to_end(run, problems, lambda done, total: report("tracking", done, total))
        tracked = time.process_time()
        opened = InspectedRun(session, run)
        try:
            known = measure_uncertainty(opened, report).of
        except RunError as refusal:
            return {"refused": refusal.message}
        assert known is not None
        drawn = time.process_time()
        truth, errors = true_coverage(opened, known), true_errors(opened, known)
    return {
        "joints": [point.point for point in known.points],
        "half_widths": [list(point.half_widths_mm) for point in known.points],
        "within": [list(truth[point.point]) for point in known.points],
        "errors": [np.nanquantile(errors[:, at], SHARES).tolist() for at in range(errors.shape[1])],
        "frames": known.frames,
        "blocks": known.blocks,
        "times": (drawn - tracked) / (tracked - began),
    }


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Shares of frames within, over the clips of the reporting half and by joint; every clip in a table."""
    rows: list[tuple[Any, ...]] = []
    reporting: list[Mapping[str, Any]] = []
    for outcome in outcomes:
        clip, measured = outcome.trial.arguments["footage"], outcome.measured
        if "refused" in measured:
            yield f"{clip}: {measured['refused']}"
            continue
        within = _means(_numbers(measured["within"]))
        widths = _means(_numbers(measured["half_widths"]))
        rows.append(
            (clip, measured["frames"], measured["blocks"], *map(_rounded, [*(100.0 * within), *widths]))
        )
        if not clip.startswith(CHOOSING):
            reporting.append(measured)
    shares = [_numbers(one["within"]) for one in reporting]
    for at, level in enumerate(PERCENT):
        by_clip = [100.0 * float(_means(one)[at]) for one in shares]
        yield number(f"{level} % promised, {REPORTING} half: frames within", by_clip, "%")
    yield number("processor time, over that of tracking", [one["times"] for one in reporting], "×")
    heads = ("clip", "frames", "blocks", *(f"within {level} % (%)" for level in PERCENT))
    yield Table("Every clip", (*heads, *(f"half width, {level} % (mm)" for level in PERCENT)), tuple(rows))
    if reporting:
        joints = tuple(reporting[0]["joints"])
        pooled = 100.0 * _means(np.stack(shares)) if shares else np.zeros((len(joints), len(LEVELS)))
        series = tuple(
            Series(
                f"{level} % promised", tuple(map(float, range(len(joints)))), tuple(pooled[:, at].tolist())
            )
            for at, level in enumerate(PERCENT)
            if np.isfinite(pooled[:, at]).all()
        )
        yield Chart(
            f"Promised against found, {REPORTING} half",
            "bars",
            "joint",
            "frames within (%)",
            series,
            categories=joints,
        )
    yield (
        "A level holds where as many frames or more are within. Few blocks make half widths wider than need be, and"
        " fewer than 19 give none of 95 %."
    )
    yield {"clips": ", ".join(KINDS)}


def _numbers(values: Sequence[Sequence[float | None]]) -> Array:
    """(M, L), NaN where there is none."""
    return np.array([[math.nan if one is None else one for one in row] for row in values])


def _means(values: Array) -> Array:
    """The mean over the first axis of what is known; NaN where nothing is."""
    known = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0)


def _rounded(value: float) -> float | None:
    return round(value, 1) if math.isfinite(value) else None


CLIPS = tuple(clip_name(half, kind) for half in HALVES for kind in KINDS)
EXPERIMENTS = (listed("half-widths", trials, measure, shown, footage=CLIPS),)
