"""A stored run's frame as a problem, and the long search that says how heavy its poses get.

The reference climbs by CMA-ES (`inspection.long_search.climb`), CLIMB evaluations each time: from the frame's start,
from what the run reported and what its search ended with, from the truth where there is one, from poses drawn about the
start, and in the end again from the heaviest. A problem is hard where fewer than half of the climbs that know only the
prior end so near the heaviest that NEARLY of the way from the start pose to it is left.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studio.body.writing import body_text
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array, Indices, evenly_spread
from studio.foundations.errors import NotFoundError, RunError
from studio.foundations.knobs import knobs_of
from studio.foundations.progress import Progress
from studio.foundations.words import counted, enumerated
from studio.results.arena.problem import (
    EASY,
    HARD,
    REACH,
    ArenaError,
    Definition,
    FrameMaps,
    Prior,
    Problem,
    ViewMaps,
)
from studio.results.inspection.likelihoods import source_of
from studio.results.inspection.long_search import SET, climb
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.reference import true_pose
from studio.runs.frame_steps import FrameHistory, space_over
from studio.runs.run_behaviour import RunBehaviour
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.devices import CPU, DEVICE_KNOB
from studio.search.settings import RunSettings
from studio.search.trackers.tracker import FilterState

REFERENCE, CLIMB = 1_000_000, 40_000
SEED = 31
AGAIN = 3
"""Last climbs, from the heaviest pose, ever finer."""
KNOWN_STEP, DRAWN_STEP, DRAWN_SPREAD = 0.25, 0.5, 1.5
"""First steps of climbs from known and from drawn poses, and how far these are drawn, in σ0."""
NEARLY, MOST_EASY = 0.01, 0.5
LARGEST_CLOUD = 1000
MARGIN = 0.5
"""By how much bounds reach beyond a known pose, in σ0."""
TIMED = 2000


@dataclass(frozen=True, slots=True, eq=False)
class FrameStart:
    """A frame before it is searched. known : poses of the body that are known of it, the truth's among them."""

    maps: FrameMaps
    prior: Prior
    reported: Array
    known: tuple[Array, ...]
    about: str


def frame_start(run: InspectedRun, number: int) -> FrameStart:
    """A frame of a run as its search began it, with the whole σ0, of which a run that refines its frames takes a share.

    Raises NotFoundError for a frame that is not finished, RunError for one that began without a pose, ArenaError where
    the likelihood reads the pictures themselves.
    """
    frame = run.frame(number)
    if frame.result is None:
        raise NotFoundError(
            f"Frame {number} of run '{run.run.name}' is not finished.", "Choose a finished frame."
        )
    settings = frame.settings
    with run.run.results() as results:
        behaviour = RunBehaviour(run.run, results)
        history = FrameHistory(results, run.run.record, [one for one in results.frames() if one < number])
        carried = behaviour.carried_into(number, history.into(number))
        space = space_over(behaviour.space_in(number), history.steps_to(number))
    reported, truth = frame.result.estimate.pose, true_pose(run, number)
    known = (reported, frame.searched(), *(() if truth is None else (truth.pose,)))
    return FrameStart(
        _maps(run, number, settings),
        _prior(run, number, carried, space.sigma),
        reported,
        tuple(np.clip(pose, run.body.lower, run.body.upper) for pose in known),
        f"frame {number} of {run.session.name} / {run.run.name}",
    )


def _maps(run: InspectedRun, number: int, settings: RunSettings) -> FrameMaps:
    weighting = WEIGHTINGS[settings.weighting_name]
    if weighting.reads_pictures or weighting.edge_kind == "hull":
        raise ArenaError(
            f"The likelihood '{weighting.name}' reads pictures and a hull, which a problem does not keep.",
            "Track the run with another likelihood.",
        )
    source = source_of(run)
    evidence: FrameEvidence = source.evidence(number, settings)
    knobs = {one.name: getattr(settings.weighting, one.name) for one in knobs_of(settings.weighting)}
    if DEVICE_KNOB in knobs:
        # A problem goes to machines that have no card.
        knobs[DEVICE_KNOB] = CPU
    return FrameMaps(
        number,
        run.body.name,
        body_text(run.body),
        source.cameras_in(number),
        tuple(ViewMaps(view.mask, view.edges, view.unknown) for view in evidence.views),
        weighting.name,
        knobs,
    )


def _prior(run: InspectedRun, number: int, carried: FilterState, sigma: Array) -> Prior:
    """What a frame begins with, within the body's limits. Raises RunError where it begins anywhere."""
    cloud, limits = carried.particles, (run.body.lower, run.body.upper)
    if cloud is None:
        raise RunError(
            f"Frame {number} of run '{run.run.name}' begins without a pose.", "Choose a later frame."
        )
    rows = evenly_spread(len(cloud.poses), LARGEST_CLOUD)
    log_weights = cloud.log_weights[rows] - np.logaddexp.reduce(cloud.log_weights[rows])
    poses = np.clip(cloud.poses[rows], *limits)
    start = np.exp(log_weights) @ poses if carried.estimate is None else np.clip(carried.estimate, *limits)
    return Prior(start, sigma, poses, log_weights, carried.estimate, carried.previous_estimate)


def parameters_named(run: InspectedRun, names: Sequence[str]) -> Indices:
    """Numbers of the parameters of limbs, or of parameters, by name; all for no name. Raises NotFoundError."""
    known = [*dict.fromkeys((*run.limbs, *run.names))]
    for name in names:
        if name not in known:
            raise NotFoundError(
                f"Body '{run.body.name}' has no limb and no parameter '{name[:40]}'.",
                f"Its limbs: {', '.join(dict.fromkeys(run.limbs))}.",
            )
    chosen = [
        number
        for number, (limb, parameter) in enumerate(zip(run.limbs, run.names, strict=True))
        if not names or limb in names or parameter in names
    ]
    return np.array(chosen, dtype=np.int64)


def defined(run: InspectedRun, begun: FrameStart, name: str, limbs: Sequence[str] = ()) -> Definition:
    """A frame as a problem without a known best. limbs : that are searched, the rest held as the run reported it."""
    free, prior = parameters_named(run, limbs), begun.prior
    reach, margin = REACH * prior.sigma, MARGIN * prior.sigma
    known = np.stack([prior.start, *begun.known])
    lower = np.minimum(prior.start - reach, known.min(axis=0) - margin)
    upper = np.maximum(prior.start + reach, known.max(axis=0) + margin)
    body = run.body
    about = begun.about if len(free) == len(prior.start) else f"{enumerated(limbs)} in {begun.about}"
    return Definition(
        name,
        EASY,
        about,
        begun.maps,
        free,
        begun.reported,
        np.maximum(lower, body.lower)[free],
        np.minimum(upper, body.upper)[free],
        prior.of(free),
    )


def with_reference(
    definition: Definition,
    known: Sequence[Array],
    evaluations: int = REFERENCE,
    step: Callable[[float], None] = lambda share: None,
) -> Definition:
    """A problem with its heaviest known pose, whether it is hard, and what an evaluation costs.

    known : (D,) poses to climb from, beside the prior. step : is told the share that is done; what it raises ends it.
    """
    problem, prior = Problem(definition), definition.prior
    limits = definition.lower, definition.upper
    climbs = max(evaluations // CLIMB, len(known) + 1 + AGAIN)
    each = max(evaluations // climbs // SET, 1)
    heights, ends, blind = list[float](), list[Array](), list[bool]()
    for at in range(climbs):
        rng = np.random.default_rng((SEED, at))
        last = at - (climbs - AGAIN)
        is_blind = last < 0 and not 0 < at <= len(known)
        if last >= 0:
            begin, scale = ends[int(np.argmax(heights))], KNOWN_STEP * 0.3**last
        elif at <= len(known):
            begin, scale = [prior.start, *known][at], KNOWN_STEP
        else:
            begin, scale = rng.normal(prior.start, DRAWN_SPREAD * prior.sigma), DRAWN_STEP

        def inform(done: int, before: int = at) -> None:
            step((before + done / each) / climbs)

        pose, height = climb(
            problem.weigh, np.clip(begin, *limits), scale * prior.sigma, limits, each, rng, inform
        )
        heights.append(height)
        ends.append(pose)
        blind.append(is_blind)
    step(1.0)
    best = int(np.argmax(heights))
    way = heights[best] - problem.start_log_weight
    near = np.array(heights)[np.array(blind)] >= heights[best] - NEARLY * way
    kind = EASY if near.mean() >= MOST_EASY else HARD
    timed = replace(definition, kind=kind, microseconds=_microseconds(problem))
    return timed.knowing(ends[best], heights[best], climbs * each * SET)


def _microseconds(problem: Problem) -> float:
    rng = np.random.default_rng(SEED)
    prior = problem.prior
    poses = rng.normal(prior.start, prior.sigma, (TIMED, problem.dimensions))
    poses = np.clip(poses, problem.lower, problem.upper)
    problem.weigh(poses)
    began = time.process_time()
    problem.weigh(poses)
    return round(1e6 * (time.process_time() - began) / TIMED, 2)


def problems_of_run(
    run: InspectedRun,
    frames: Sequence[int],
    limbs: Sequence[str] = (),
    evaluations: int = REFERENCE,
    report: Progress = lambda step, done, total: None,
) -> tuple[Definition, ...]:
    """Frames of a run as problems. Raises as `frame_start`, and what `report` raises."""
    made = list[Definition]()
    for at, number in enumerate(frames):
        begun = frame_start(run, number)
        name = "-".join(
            [run.session.name, run.run.name, str(number), *(limb.replace(" ", "-") for limb in limbs)]
        )
        definition = defined(run, begun, name, limbs)
        known = [np.clip(pose[definition.free], definition.lower, definition.upper) for pose in begun.known]

        def step(share: float, before: int = at) -> None:
            report(
                f"searching {counted(len(frames), 'frame')} for long",
                int(100 * (before + share)),
                100 * len(frames),
            )

        made.append(with_reference(definition, known, evaluations, step))
    return tuple(made)
