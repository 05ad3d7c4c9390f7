"""Trackers compared on one session with exact truth: same evidence, same number of evaluations, several seeds.

The rows are the improved filter (Eq. 3-12, 18, 19), the filter with Eq. 13 alone, and Condensation with its
likelihood scaled so that it selects (no straw man: the scale stands in the report).
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.capture.trc import read_trc
from studio.errors import TruthError
from studio.evaluation.errors import Evaluation, evaluate
from studio.evaluation.report import SeedsSummary, summarize
from studio.runs.problem_source import ProblemSource
from studio.runs.search_space import default_sigma, search_space
from studio.runs.tracking_run import start_of
from studio.sessions.session import Session
from studio.settings import changed_settings, default_settings
from studio.tracking.catalogue import TRACKERS
from studio.tracking.frame_loop import search_frame

IMPROVED, PLANNED, BASELINE = "improved filter", "Eq. 13 alone", "Condensation"


@dataclass(frozen=True, slots=True)
class Contender:
    """A tracker with settings. changes : knobs by flat name."""

    name: str
    tracker: str
    changes: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Row:
    """What a contender reached. likelihood_scales : exponent of the last layer of each seed's last frame."""

    contender: str
    evaluations_per_frame: int
    summary: SeedsSummary
    per_seed_mm: tuple[float, ...]
    likelihood_scales: tuple[float, ...]


def contenders(layers: int = 10, particles: int = 200) -> tuple[Contender, ...]:
    """The three rows with the same number of evaluations a frame."""
    planned = {"adaptive_diffusion": False, "crossover": 0.0}
    return (
        Contender(IMPROVED, "annealed", {"layers": layers, "particles": particles}),
        Contender(PLANNED, "annealed", {"layers": layers, "particles": particles, **planned}),
        Contender(BASELINE, "condensation", {"particles": layers * particles}),
    )


def compare(
    session_folder: Path,
    rows: Sequence[Contender],
    seeds: Sequence[int],
    executor: Executor,
    frames: int | None = None,
) -> tuple[Row, ...]:
    """Track the session with every contender and seed. frames : the first so many, None for all.

    Raises TruthError for a session without truth.
    """
    jobs = {
        (row.name, seed): executor.submit(track_and_measure, session_folder, row, seed, frames)
        for row in rows
        for seed in seeds
    }
    return tuple(_row(row, [jobs[row.name, seed].result() for seed in seeds]) for row in rows)


def _row(contender: Contender, found: Sequence[tuple[Evaluation, int, float]]) -> Row:
    evaluations = [one for one, _, _ in found]
    return Row(
        contender.name,
        found[0][1],
        summarize(evaluations),
        tuple(round(one.mean_mm, 2) for one in evaluations),
        tuple(scale for _, _, scale in found),
    )


def track_and_measure(
    session_folder: Path, contender: Contender, seed: int, frames: int | None = None
) -> tuple[Evaluation, int, float]:
    """One run, kept in memory only: its errors, evaluations a frame and the last layer's exponent."""
    session = Session(session_folder)
    if session.truth_path is None:
        raise TruthError(f"Session '{session.name}' has no truth.", "Take one made by 'studio synthesize'.")
    body, fps = session.body(), session.manifest.fps
    own_sigma = session.sigma(fps, body)
    space = search_space(body, default_sigma(body, fps) if own_sigma is None else own_sigma)
    settings = changed_settings(default_settings(contender.tracker), contender.changes)
    count = frames or session.manifest.frame_count
    pose = session.start_pose(body)
    carried = start_of(None if pose is None else tuple(pose))
    poses, evaluations, scale = np.zeros((count, len(body.parameters))), 0, float("nan")
    problems = ProblemSource(session, body)
    try:
        for frame in range(count):
            betas: list[float] = []
            result = search_frame(
                TRACKERS[contender.tracker],
                problems.problem(frame, settings),
                carried,
                space,
                seed=seed,
                frame=frame,
                settings_source=lambda: (1, settings.tracker),
                repeats=settings.tracker.start_repeats if frame == 0 else 1,
                on_layer=lambda record, betas=betas: betas.append(record.beta),
            )
            carried, poses[frame] = result.carried, result.estimate.pose
            evaluations, scale = result.evaluations, betas[-1]
    finally:
        problems.close()
    found = evaluate(poses, np.arange(count), body, read_trc(session.truth_path), fps)
    return found, evaluations, scale
