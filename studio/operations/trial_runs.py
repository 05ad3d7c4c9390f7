"""A trial of a comparison as a stored run: tracked again with its settings and seed, so that its search can be
inspected.

Trials are tracked in memory and keep their errors only; with the same settings and seed the run finds the same poses.
"""

from dataclasses import dataclass

import numpy as np
from pydantic import FiniteFloat

from studio.foundations.errors import NotFoundError
from studio.operations.comparison_folders import runs_of
from studio.results.comparison.candidates import Candidate
from studio.results.comparison.kept_comparison import KeptComparison
from studio.results.comparison.plan import Plan
from studio.results.comparison.tracked import start_of_trial
from studio.runs.behaviour_models import needs_model
from studio.runs.new_run import prepare_run
from studio.search.settings import values
from studio.sessions.names import free_name
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

LONGEST_NAME = 64


@dataclass(frozen=True, slots=True)
class TrialLine:
    """A measured trial.

    worst_frame : where its error, worst_mm, is largest.
    run : the run made from it, "" for none.
    """

    tracker: str
    seed: int
    mean_mm: FiniteFloat
    worst_mm: FiniteFloat
    worst_frame: int
    lost_frames: int
    run: str = ""


def trial_lines(session: Session, kept: KeptComparison) -> list[TrialLine]:
    """The trials of a finished comparison, tracker by tracker; none of a sweep, whose trials are runs."""
    result = kept.result()
    if result is None or kept.plan(session).vary:
        return []
    frames, errors = result["per_frame"]["frames"], result["per_frame"]["error_mm"]
    made = runs_of(session, kept)
    return [
        TrialLine(
            tracker["tracker"],
            entry["seed"],
            entry["mean_mm"],
            entry["worst_mm"],
            int(frames[int(np.argmax(errors[tracker["tracker"]][at]))]),
            entry["lost_frames"],
            run.name if (run := made.get(_note(kept, tracker["tracker"], entry["seed"]))) else "",
        )
        for tracker in result["trackers"]
        for at, entry in enumerate(tracker["seeds"])
    ]


def run_of_trial(session: Session, kept: KeptComparison, tracker: str, seed: int) -> StoredRun:
    """The run of a trial, newly made and ready to be tracked where there is none yet. tracker : its name in the
    comparison.

    Raises NotFoundError where the comparison has no such trial, StudioError where the run cannot be made.
    """
    plan = kept.plan(session)
    candidate = next((one for one in plan.candidates if one.name == tracker), None)
    if candidate is None or seed not in plan.seeds:
        names = ", ".join(one.name for one in plan.candidates)
        raise NotFoundError(
            f"Comparison '{kept.name}' has no trial of '{tracker[:64]}' with seed {seed}.",
            f"It has {names}, seeds {plan.seeds[0]} to {plan.seeds[-1]}.",
        )
    note = _note(kept, tracker, seed)
    return runs_of(session, kept).get(note) or _make_run(session, kept, plan, candidate, seed, note)


def _make_run(
    session: Session, kept: KeptComparison, plan: Plan, candidate: Candidate, seed: int, note: str
) -> StoredRun:
    settings, body = candidate.settings(), candidate.body or plan.body
    guided = bool(plan.behaviour_path) and needs_model(candidate.tracker, settings.tracker)
    wanted = f"{kept.name}-{candidate.name.replace(':', '-')}-{seed}"[-LONGEST_NAME:].lstrip("-_")
    return prepare_run(
        session,
        tracker=candidate.tracker,
        weighting=candidate.weighting,
        body=body,
        behaviour=plan.behaviour_path if guided else "",
        start_pose=start_of_trial(session, body, plan.first),
        first=plan.first,
        last=plan.last,
        seed=seed,
        # Trials are tracked without the search for a lost body.
        knobs={**values(settings), **dict(candidate.changes), "recovery": "off"},
        name=free_name(wanted, {run.name for run in session.runs()}),
        # A comparison takes the calibration as it is.
        allow_inconsistent=True,
        fit_shape=False,
        note=note,
    )


def _note(kept: KeptComparison, tracker: str, seed: int) -> str:
    return kept.note_of(f"{tracker}, seed {seed}")
