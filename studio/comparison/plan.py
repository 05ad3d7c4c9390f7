"""Trackers compared fairly on one session with a known truth: the same evidence, weighting, start, σ0 and number of
evaluations a frame, the same seeds.

A comparison is a plan, its trials (one a tracker and seed, any of them in any process) and what follows from all of
them: `trials`, `conclude`. Trials are made and measured as those of the experiments are (`tracking_trials`).
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio.body.model import BodyModel
from studio.comparison.candidates import Candidate, Lineup, candidates
from studio.comparison.statistics import SignTest, sign_test
from studio.comparison.tracked import Attempt
from studio.comparison.tracking_trials import tracking_trial
from studio.comparison.trials import Outcome, Trial
from studio.errors import RunError, TruthError
from studio.runs.behaviour_models import ChosenModel, chosen_model, needs_model
from studio.runs.new_run import checked_frames, start_of
from studio.sessions.session import Session
from studio.settings import DEFAULT_WEIGHTING
from studio.tracking.frame_refinement import FrameRefinementSettings
from studio.weighting.catalogue import WEIGHTINGS

MOST_SEEDS = 1000


@dataclass(frozen=True, slots=True)
class Plan:
    """What is compared. footage : the session's folder. session : its name. first, last : frames, half open. fps : of
    the footage. body : a name, "" for the session's own. behaviour : name of the model of those that need one, "" for
    none; behaviour_digest : of its file; behaviour_path : where it lies now.
    """

    footage: str
    session: str
    entrants: tuple[Candidate, ...]
    evaluations: int
    seeds: tuple[int, ...]
    first: int
    last: int
    fps: float
    body: str = ""
    behaviour: str = ""
    behaviour_digest: str = ""
    behaviour_path: str = ""

    @property
    def frame_count(self) -> int:
        """How many frames every trial tracks."""
        return self.last - self.first


@dataclass(frozen=True, slots=True)
class SeedResult:
    """One tracker with one seed, mm without alignment.

    worst_mm : mean of the markers in the worst frame. lost_frames : frames with any limb lost. seconds : of the
    search. per_frame_mm : in the order of the comparison's frames. lost : in that order the limbs that are lost.
    """

    tracker: str
    evaluations: int
    mean_mm: float
    worst_mm: float
    lost_frames: int
    seconds: float
    seed: int
    per_frame_mm: tuple[float, ...]
    lost: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class TrackerResult:
    """One tracker over all seeds, taken together: the mean error, the worst frame of any seed, the frames with a limb
    lost and the seconds of all seeds.
    """

    tracker: str
    evaluations: int
    mean_mm: float
    worst_mm: float
    lost_frames: int
    seconds: float
    seeds: tuple[SeedResult, ...]


@dataclass(frozen=True, slots=True)
class PairTest:
    """Two trackers against each other, pair by pair; `better` counts where the first has the smaller error.

    frames : each frame's error, mean over the seeds. Neighbouring frames are not independent, so its p is too small.
    seeds : each seed's mean error; with n seeds its p is never below 2^(1-n).
    """

    first: str
    second: str
    frames: SignTest
    seeds: SignTest


@dataclass(frozen=True, slots=True)
class Comparison:
    """What was found. frames : numbers of those with a truth. pairs : every two trackers."""

    plan: Plan
    frames: tuple[int, ...]
    trackers: tuple[TrackerResult, ...]
    pairs: tuple[PairTest, ...]


def plan_comparison(
    session: Session,
    lineup: Lineup,
    seeds: Sequence[int],
    *,
    first: int = 0,
    last: int | None = None,
    body: str = "",
    behaviour: str = "",
) -> Plan:
    """Everything checked that can be before anything is tracked; lineup.weighting "" means the session's own,
    behaviour "" the only model that fits where somebody needs one.

    Raises TruthError for a session without truth, SettingsError, RunError and BodyError for what cannot be done.
    """
    if session.truth_path is None:
        raise TruthError(
            f"Session '{session.name}' has no truth to measure trackers against.",
            "Take one made by 'studio synthesize', or import it with a truth/*.trc.",
        )
    weighting = WEIGHTINGS[lineup.weighting or session.manifest.weighting or DEFAULT_WEIGHTING].name
    if (
        not 0 < len(seeds) <= MOST_SEEDS
        or len(set(seeds)) < len(seeds)
        or not all(0 <= one < 2**63 for one in seeds)
    ):
        raise RunError(
            f"The seeds {list(seeds)[:8]} cannot be used.", "Give different whole numbers of 0 or more."
        )
    begin, end = checked_frames(session, first, last)
    model = session.body(body or None)
    start_of(session, model, None)
    taking_part = candidates(
        Lineup(lineup.names, weighting, lineup.evaluations, lineup.layers, lineup.changes)
    )
    chosen = _chosen_model(session, model, taking_part, behaviour)
    return Plan(
        footage=str(session.path.absolute()),
        session=session.name,
        entrants=taking_part,
        evaluations=lineup.evaluations,
        seeds=tuple(seeds),
        first=begin,
        last=end,
        fps=session.manifest.fps,
        body=body,
        behaviour=chosen.name if chosen else "",
        behaviour_digest=hashlib.sha256(chosen.path.read_bytes()).hexdigest()[:16] if chosen else "",
        behaviour_path=str(chosen.path) if chosen else "",
    )


def trials(plan: Plan) -> tuple[Trial, ...]:
    """One a tracker and seed; every tracker's first seed first, so that an early look compares them all."""
    return tuple(
        tracking_trial(candidate.name, _attempt(plan, candidate, seed))
        for seed in plan.seeds
        for candidate in plan.entrants
    )


def conclude(plan: Plan, outcomes: Sequence[Outcome]) -> Comparison:
    """The comparison from the outcomes of all trials, in the order of `trials`."""
    measured = iter(outcome.measured for outcome in outcomes)
    found: dict[str, list[SeedResult]] = {candidate.name: [] for candidate in plan.entrants}
    frames: tuple[int, ...] = ()
    for seed in plan.seeds:
        for candidate in plan.entrants:
            values = next(measured)
            frames = tuple(values["frames"])
            found[candidate.name].append(_seed_result(candidate.name, seed, values))
    trackers = tuple(_tracker_result(name, tuple(seeds)) for name, seeds in found.items())
    pairs = tuple(_pair(first, second) for at, first in enumerate(trackers) for second in trackers[at + 1 :])
    return Comparison(plan, frames, trackers, pairs)


def mean_curve(result: TrackerResult) -> tuple[float, ...]:
    """The error of each frame, mean over the seeds, mm."""
    rows = np.array([seed.per_frame_mm for seed in result.seeds])
    return tuple(float(value) for value in rows.mean(axis=0))


def _chosen_model(
    session: Session, body: BodyModel, taking_part: Sequence[Candidate], asked: str
) -> ChosenModel | None:
    """The model of all who need one; None where nobody does. Raises BehaviourError, NotFoundError."""
    for candidate in taking_part:
        if needs_model(candidate.tracker, candidate.settings().tracker):
            return chosen_model(session, body, candidate.settings(), asked)
    return None


def _attempt(plan: Plan, candidate: Candidate, seed: int) -> Attempt:
    return Attempt(
        plan.footage,
        candidate.tracker,
        candidate.weighting,
        seed,
        {"refine_frames": FrameRefinementSettings().refine_frames, **candidate.changes},
        plan.first,
        plan.last,
        body=plan.body,
        behaviour=_behaviour_of(plan, candidate),
    )


def _behaviour_of(plan: Plan, candidate: Candidate) -> str:
    """The file of the model that an candidate is guided by, "" for one that is not."""
    guided = plan.behaviour_path and needs_model(candidate.tracker, candidate.settings().tracker)
    return plan.behaviour_path if guided else ""


def _seed_result(name: str, seed: int, values: Mapping[str, Any]) -> SeedResult:
    return SeedResult(
        tracker=name,
        evaluations=values["evaluations"],
        mean_mm=values["mean_mm"],
        worst_mm=values["worst_mm"],
        lost_frames=values["lost_frames"],
        seconds=values["seconds"],
        seed=seed,
        per_frame_mm=tuple(values["per_frame_mm"]),
        lost=tuple(tuple(limbs) for limbs in values["lost"]),
    )


def _tracker_result(name: str, seeds: tuple[SeedResult, ...]) -> TrackerResult:
    return TrackerResult(
        tracker=name,
        evaluations=seeds[0].evaluations,
        mean_mm=float(np.mean([seed.mean_mm for seed in seeds])),
        worst_mm=max(seed.worst_mm for seed in seeds),
        lost_frames=sum(seed.lost_frames for seed in seeds),
        seconds=sum(seed.seconds for seed in seeds),
        seeds=seeds,
    )


def _pair(first: TrackerResult, second: TrackerResult) -> PairTest:
    return PairTest(
        first.tracker,
        second.tracker,
        sign_test(mean_curve(first), mean_curve(second)),
        sign_test([seed.mean_mm for seed in first.seeds], [seed.mean_mm for seed in second.seeds]),
    )
