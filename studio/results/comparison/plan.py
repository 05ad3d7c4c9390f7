"""Trackers compared fairly on one session with a known truth: the same evidence, weighting, start, σ0 and number of
evaluations a frame, the same seeds.

A comparison is a plan, its trials (one a tracker and seed, any of them in any process) and the conclusion from all of
them: `trials`, `conclude`. Trials are made and measured as those of the experiments are (`tracked`).
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from studio.body.model import BodyModel
from studio.foundations.errors import RunError, TruthError
from studio.foundations.foreign_files import read_file
from studio.foundations.knobs import Value
from studio.results.comparison.candidates import Candidate, Lineup, candidates
from studio.results.comparison.statistics import SignTest, sign_test
from studio.results.comparison.tracked import Tracked, TrackingTrial, tracking_trial
from studio.results.comparison.trials import Outcome, Trial
from studio.runs.behaviour_models import ChosenModel, chosen_model, needs_model
from studio.runs.new_run import start_of
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import DEFAULT_WEIGHTING
from studio.search.trackers.frame_refinement import FrameRefinementSettings
from studio.sessions.session import Session

MOST_SEEDS = 1000


@dataclass(frozen=True, slots=True)
class Plan:
    """The plan of a comparison. footage : the session's folder. session : its name. first, last : frames, half open.
    fps : of the footage. body : a name, "" for the session's own. behaviour : name of the model of those that need one,
    "" for none; behaviour_digest : of its file; behaviour_path : its present path. vary : of a sweep the values of each
    knob, whose combinations are the candidates, and evaluations are then the most of any; empty where trackers are
    compared. fit_shape, allow_inconsistent : of a sweep's runs. split_frames : in how many frames of each trial it is
    measured whose fault the error is.
    """

    footage: str
    session: str
    candidates: tuple[Candidate, ...]
    evaluations: int
    seeds: tuple[int, ...]
    first: int
    last: int
    fps: float
    body: str = ""
    behaviour: str = ""
    behaviour_digest: str = ""
    behaviour_path: str = ""
    vary: Mapping[str, tuple[Value, ...]] = field(default_factory=dict[str, tuple[Value, ...]])
    fit_shape: bool = False
    allow_inconsistent: bool = False
    split_frames: int = 0

    @property
    def frame_count(self) -> int:
        """Number of frames that every trial tracks."""
        return self.last - self.first


@dataclass(frozen=True, slots=True)
class TrackerResult:
    """One tracker over all seeds. seeds : its runs, in the order of the plan's."""

    tracker: str
    seeds: tuple[Tracked, ...]

    @property
    def evaluations(self) -> int:
        """Poses weighed in a frame."""
        return self.seeds[0].evaluations

    @property
    def means(self) -> list[float]:
        """The mean error of each seed, mm."""
        return [seed.mean_mm for seed in self.seeds]

    @property
    def mean_mm(self) -> float:
        """The mean error over all seeds."""
        return float(np.mean(self.means))

    @property
    def worst_mm(self) -> float:
        """The mean of the markers in the worst frame of any seed."""
        return max(seed.worst_mm for seed in self.seeds)

    @property
    def lost_frames(self) -> int:
        """Frames with any limb lost, of all seeds."""
        return sum(seed.lost_frames for seed in self.seeds)

    @property
    def log_evidence(self) -> float | None:
        """Nats a frame, mean over the seeds; None where the tracker has none."""
        known = [seed.log_evidence for seed in self.seeds if seed.log_evidence is not None]
        return float(np.mean(known)) if len(known) == len(self.seeds) else None

    @property
    def parts_mm(self) -> dict[str, float]:
        """Mean parts of the error by whose fault they are, over the seeds; {} where it was not split."""
        split = [seed.parts_mm for seed in self.seeds if seed.parts_mm]
        return {part: float(np.mean([one[part] for one in split])) for part in split[0]} if split else {}

    @property
    def seconds(self) -> float:
        """Seconds of the search, over all seeds."""
        return sum(seed.seconds for seed in self.seeds)

    @property
    def curve(self) -> list[float]:
        """The error of each frame, mean over the seeds, mm."""
        return np.array([seed.per_frame_mm for seed in self.seeds]).mean(axis=0).tolist()


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
    """The result of a comparison. frames : numbers of those with a truth. pairs : every two trackers."""

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
    split_frames: int = 0,
) -> Plan:
    """A checked plan; lineup.weighting "" means the session's own, behaviour "" the only model that fits where a
    tracker needs one.

    Raises TruthError for a session without truth, SettingsError, RunError and BodyError for impossible requests.
    """
    if session.truth_path is None:
        raise TruthError(
            f"Session '{session.name}' has no truth to compare trackers with.",
            "Take one made by 'studio synthesize', or import it with a truth/*.trc.",
        )
    weighting = WEIGHTINGS[lineup.weighting or session.manifest.weighting or DEFAULT_WEIGHTING].name
    check_seeds(seeds)
    begin, end = session.checked_frames(first, last)
    taking_part = candidates(replace(lineup, weighting=weighting))
    bodies = {one.name: session.body(one.body or body or None) for one in taking_part}
    for own in bodies.values():
        start_of(session, own, None)
    chosen = _chosen_model(session, bodies, taking_part, behaviour)
    plan = plan_of(session, taking_part, lineup.evaluations, seeds, (begin, end), body, chosen)
    return replace(plan, split_frames=split_frames)


def plan_of(
    session: Session,
    candidates: tuple[Candidate, ...],
    evaluations: int,
    seeds: Sequence[int],
    frames: tuple[int, int],
    body: str,
    chosen: ChosenModel | None,
) -> Plan:
    """The plan of checked parts. frames : first, last. chosen : the behaviour model, None without one."""
    return Plan(
        footage=str(session.path.absolute()),
        session=session.name,
        candidates=candidates,
        evaluations=evaluations,
        seeds=tuple(seeds),
        first=frames[0],
        last=frames[1],
        fps=session.manifest.fps,
        body=body,
        behaviour=chosen.name if chosen else "",
        behaviour_digest=hashlib.sha256(read_file(chosen.path)).hexdigest()[:16] if chosen else "",
        behaviour_path=str(chosen.path) if chosen else "",
    )


def check_seeds(seeds: Sequence[int]) -> None:
    """Raise RunError for seeds that cannot be used."""
    if (
        not 0 < len(seeds) <= MOST_SEEDS
        or len(set(seeds)) < len(seeds)
        or not all(0 <= one < 2**63 for one in seeds)
    ):
        raise RunError(
            f"The seeds {list(seeds)[:8]} cannot be used.", "Give different whole numbers of 0 or more."
        )


def trials(plan: Plan) -> tuple[Trial, ...]:
    """One a tracker and seed; every tracker's first seed first, so that an early look compares them all."""
    return tuple(
        tracking_trial(candidate.name, tracking_trial_of(plan, candidate, seed))
        for seed in plan.seeds
        for candidate in plan.candidates
    )


def conclude(plan: Plan, outcomes: Sequence[Outcome]) -> Comparison:
    """The comparison from the outcomes of all trials, in the order of `trials`."""
    count = len(plan.candidates)
    runs = [Tracked(**outcome.measured) for outcome in outcomes]
    trackers = tuple(
        TrackerResult(candidate.name, tuple(runs[place::count]))
        for place, candidate in enumerate(plan.candidates)
    )
    pairs = tuple(
        PairTest(
            first.tracker,
            second.tracker,
            sign_test(first.curve, second.curve),
            sign_test(first.means, second.means),
        )
        for first, second in combinations(trackers, 2)
    )
    return Comparison(plan, tuple(runs[-1].frames), trackers, pairs)


def _chosen_model(
    session: Session, bodies: Mapping[str, BodyModel], taking_part: Sequence[Candidate], behaviour: str
) -> ChosenModel | None:
    """The model for all candidates that need one; None where none does. bodies : by candidate.

    Raises BehaviourError, NotFoundError.
    """
    chosen = None
    for candidate in taking_part:
        if needs_model(candidate.tracker, candidate.settings().tracker):
            wanted = behaviour if chosen is None else str(chosen.path)
            chosen = chosen_model(session, bodies[candidate.name], candidate.settings(), wanted)
    return chosen


def tracking_trial_of(plan: Plan, candidate: Candidate, seed: int) -> TrackingTrial:
    guided = plan.behaviour_path and needs_model(candidate.tracker, candidate.settings().tracker)
    return TrackingTrial(
        plan.footage,
        candidate.tracker,
        candidate.weighting,
        seed,
        {"refine_frames": FrameRefinementSettings().refine_frames, **candidate.changes},
        plan.first,
        plan.last,
        body=candidate.body or plan.body,
        behaviour=plan.behaviour_path if guided else "",
        split_frames=plan.split_frames,
    )
