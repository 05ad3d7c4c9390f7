"""Whose fault the trackers' errors are, over how much they search: the search's part falls, the floor stays.

Parts as in `results.inspection.error_parts`, nothing refined: the search's is what the error would lose were the
heaviest known pose of the frame found; the likelihood's how much farther off that pose is than the body laid on the
truth; the body's what is left. The heaviest known pose is that of long climbs (`results.inspection.long_search`) from
the truth and from what two filters with 20 000 evaluations find from the frame before, or a tracker's own pose where
that weighs more.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.foundations.arrays import Array
from studio.foundations.progress import report
from studio.garden.reproduction.deutscher_reid.weight_of_a_knee import true_poses
from studio.garden.reproduction.experiment import Part, each_seed, group_of, listed
from studio.garden.reproduction.open_questions.searched_clip import SearchedClip
from studio.garden.reproduction.tracking import Candidate
from studio.results.comparison.findings import Chart, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import TrackingTrial
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.inspection.long_search import FIRST_STEP_MM, climb, parameters_a_mm
from studio.search.likelihood.problem import FrameLikelihood
from studio.search.settings import DEFAULT_WEIGHTING, changed_settings, default_settings
from studio.search.trackers.catalogue import TRACKERS, knobs_for_evaluations
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.tracker import start_of

CLIPS = ("walk", "choosing-turns", "choosing-kick")
WEIGHTING = DEFAULT_WEIGHTING
EVALUATIONS = (250, 1000, 4000, 16_000)
CANDIDATES = tuple(
    Candidate(name, tracker, WEIGHTING, {"refine_frames": False})
    for name, tracker in (
        ("annealed", "annealed"),
        ("swarm", "swarm"),
        ("Condensation", "condensation"),
        ("tempered", "tempered"),
    )
)
FRAMES, EVERY, QUICK_FRAMES = 48, 6, 13
SEEDS_AT_MOST = 3
REFERENCE, STEPS, LONG = "reference", 300, 20_000
PARTS = ("body", "likelihood", "search")


def trials(scale: Scale) -> tuple[Trial, ...]:
    """The heaviest poses of each clip, then every tracker at every size with every seed."""
    clips = CLIPS[: 1 if scale.quick else None]
    last = QUICK_FRAMES if scale.quick else FRAMES
    sizes = EVALUATIONS[1:3] if scale.quick else EVALUATIONS
    steps = STEPS // 6 if scale.quick else STEPS
    references = tuple(
        Trial(f"{REFERENCE} on {clip}, seed 0", {"clip": clip, "last": last, "steps": steps})
        for clip in clips
    )

    def arguments(one: Candidate, clip: str, size: int, seed: int) -> dict[str, Any]:
        return one.attempt(clip, seed, size, last=last).plain()

    return references + tuple(
        trial
        for clip in clips
        for one in CANDIDATES
        for size in sizes
        for trial in each_seed(
            f"{one.name}, {size} on {clip}", scale.seeds[:SEEDS_AT_MOST], partial(arguments, one, clip, size)
        )
    )


@kept_as("open_questions.error_split.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """By looked-at frame: of a reference the errors of the laid and of the heaviest body, mm, and what that weighs; of
    a tracker the error and the weight of its pose.
    """
    if "clip" in arguments:
        return _reference(arguments, cache)
    attempt = TrackingTrial.of_plain(arguments)
    settings = changed_settings(default_settings(attempt.tracker, attempt.weighting), attempt.changes)
    scene = SearchedClip(cache, attempt.footage, settings)
    run = scene.followed(attempt.seed)
    weights, last = dict[int, float](), int(attempt.last or 0)
    for frame in range(last):
        problem = scene.problem(frame)
        run.step(frame, problem)
        if frame % EVERY == 0:
            weights[frame] = float(problem.log_likelihood(run.poses[-1][None])[0])
        report("tracking", frame + 1, last)
    poses = np.array(run.poses)[list(weights)]
    return {
        "frames": list(weights),
        "errors": scene.errors(poses, list(weights)),
        "weights": [*weights.values()],
    }


def _reference(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    settings = changed_settings(default_settings("annealed", WEIGHTING), {"refine_frames": False})
    scene = SearchedClip(cache, str(arguments["clip"]), settings)
    frames = list(range(0, int(arguments["last"]), EVERY))
    before = true_poses(scene.session, scene.body, [max(frame - 1, 0) for frame in frames])
    laid, best = true_poses(scene.session, scene.body, frames), list[Array]()
    heaviest = list[float]()
    for at, frame in enumerate(frames):
        problem = scene.problem(frame)
        poses = [
            laid[at],
            *(_searched(scene, problem, before[at], frame, name) for name in ("annealed", "tempered")),
        ]
        climbed = [_climb(scene.body, problem, pose, frame, int(arguments["steps"])) for pose in poses]
        pose, weight = max(climbed, key=lambda one: one[1])
        best.append(pose)
        heaviest.append(weight)
        report("long climbs", at + 1, len(frames))
    return {
        "frames": frames,
        "laid": scene.errors(laid, frames),
        "errors": scene.errors(np.array(best), frames),
        "weights": heaviest,
    }


def _searched(
    scene: SearchedClip, problem: FrameLikelihood, before: Array, frame: int, tracker: str
) -> Array:
    """(D,) the heaviest that a search with LONG evaluations finds about the pose of the frame before."""
    own = TRACKERS[tracker]
    knobs = dataclasses.replace(own.settings_type(), **knobs_for_evaluations(tracker, LONG))
    result = search_frame(
        own,
        problem,
        start_of(tuple(map(float, before))),
        scene.space,
        seed=7,
        frame=frame,
        settings_source=lambda: (1, knobs),
    )
    return result.estimate.mode


def _climb(
    body: BodyModel, problem: FrameLikelihood, start: Array, frame: int, steps: int
) -> tuple[Array, float]:
    scale = FIRST_STEP_MM * scale_of(body) * parameters_a_mm(body, start)

    def weigh(poses: Array) -> Array:
        return np.where(problem.feasible(poses), problem.log_likelihood(poses), -np.inf)

    return climb(weigh, start, scale, (body.lower, body.upper), steps, np.random.default_rng((404, frame)))


def parts_of(tracked: Mapping[str, Any], reference: Mapping[str, Any]) -> dict[str, float]:
    """The mean parts of a tracker's error over the frames that both have, mm; they add up to its mean error."""
    at = {frame: place for place, frame in enumerate(reference["frames"])}
    rows = list[tuple[float, float, float]]()
    for frame, error, weight in zip(tracked["frames"], tracked["errors"], tracked["weights"], strict=True):
        if frame in at:
            place = at[frame]
            is_heavier = reference["weights"][place] > weight
            best = reference["errors"][place] if is_heavier else error
            body = reference["laid"][place]
            rows.append((body, best - body, error - best))
    return dict(zip(PARTS, np.mean(rows, axis=0).tolist(), strict=True))


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """By clip: bars of the parts over evaluations, and a table."""
    references = {
        group_of(one.trial).removeprefix(f"{REFERENCE} on "): one.measured
        for one in outcomes
        if one.trial.label.startswith(REFERENCE)
    }
    groups: dict[tuple[str, str], list[dict[str, float]]] = {}
    for one in outcomes:
        name, _, clip = group_of(one.trial).rpartition(" on ")
        if name != REFERENCE and clip in references:
            groups.setdefault((clip, name), []).append(parts_of(one.measured, references[clip]))
    rows = list[tuple[Any, ...]]()
    for clip in references:
        names = [name for own, name in groups if own == clip]
        means = {
            name: {part: float(np.mean([one[part] for one in groups[clip, name]])) for part in PARTS}
            for name in names
        }
        for name in names:
            whole = [sum(one.values()) for one in groups[clip, name]]
            rows.append(
                (
                    clip,
                    name,
                    round(float(np.mean(whole)), 1),
                    *(round(means[name][part], 1) for part in PARTS),
                )
            )
        places = tuple(float(at) for at in range(len(names)))
        series = tuple(
            Series(part, places, tuple(means[name][part] for name in names), group=part) for part in PARTS
        )
        yield Chart(
            f"Whose fault: {clip}", "bars", "tracker, evaluations a frame", "mean error (mm)", series,
            categories=tuple(names), stacked=True,
        )  # fmt: skip
        for one in CANDIDATES:
            own = [name for name in names if name.startswith(f"{one.name}, ")]
            if len(own) > 1:
                fewest, most = (
                    [parts["search"] for parts in groups[clip, name]] for name in (own[0], own[-1])
                )
                gone = [less - more for less, more in zip(most, fewest, strict=True)]
                yield number(f"{clip}: {one.name}, search's part, most less fewest evaluations", gone, "mm")
    heads = ("clip", "tracker, evaluations a frame", "error (mm)", *(f"{part} (mm)" for part in PARTS))
    yield Table("Parts of the error", heads, tuple(rows))
    yield {
        "weighting": WEIGHTING,
        "frames": FRAMES,
        "every frames": EVERY,
        "refined": "no",
        "climbs' steps": STEPS,
    }


EXPERIMENTS = (listed("error-split", trials, measure, shown, footage=CLIPS),)
