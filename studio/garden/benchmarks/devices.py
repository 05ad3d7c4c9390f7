"""What a graphics card does: poses weighed, frames searched, many runs at once, beside what the card can do at most.

In words where there is no card.
"""

import importlib
from collections.abc import Callable, Sequence

import numpy as np

from studio.body.catalogue import load_body
from studio.foundations.errors import StudioError
from studio.foundations.progress import Progress, no_progress
from studio.garden.benchmarks.kernels import made_evidence, poses_around, ring_of_cameras
from studio.runs.search_space import default_sigma, search_space
from studio.search.likelihood.bodytrack import BodytrackLikelihood, BodytrackSettings
from studio.search.likelihood.devices import CPU, GPU
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.trackers.settings import AnnealedSettings

SIZES = (1_000, 10_000, 100_000, 1_000_000)
PARTICLES, RUNS, SWARM, TEMPERED = (1_000, 10_000, 100_000), 64, 10_000, 10_000
COMPARED = 2_000
FRAMES_PER_SECOND = 60.0
MEASURES = "studio.garden.benchmarks.card_measures"


def run_device_benchmark(
    sizes: Sequence[int] = SIZES,
    particles: Sequence[int] = PARTICLES,
    runs: int = RUNS,
    repeats: int = 5,
    progress: Progress | None = None,
) -> dict[str, object]:
    """Evaluations a second of each number of poses, milliseconds a frame of each number of particles, of a swarm
    and of tempered SMC, and how much more many runs do at once; "none": why there is no card.
    """
    body = load_body("human31")
    cameras = ring_of_cameras(body)
    try:
        there = EdgeRegionSilhouetteLikelihood(body, cameras, EdgeRegionSilhouetteSettings(device=GPU))
    except StudioError as error:
        return {"none": f"{error.message} {error.hint}"}
    measures = importlib.import_module(MEASURES)
    report = progress or no_progress
    rng = np.random.default_rng(0)
    poses = poses_around(body, max(*sizes, COMPARED), rng)
    made = made_evidence(body, cameras, rng)
    evidence = made["proximity"]
    problem = there.problem(evidence)
    here = EdgeRegionSilhouetteLikelihood(body, cameras, EdgeRegionSilhouetteSettings(device=CPU))
    on_host = here.problem(evidence)
    score, score_on_host = (
        BodytrackLikelihood(body, cameras, BodytrackSettings(device=device)).problem(made["bodytrack"])
        for device in (GPU, CPU)
    )
    space = search_space(body, default_sigma(body, FRAMES_PER_SECOND))
    steps: dict[str, Callable[[], object]] = {
        "card": lambda: measures.card_limits(there.edge_region.samples_per_evaluation, repeats),
        "resident": lambda: {
            str(size): measures.resident_rates(problem, poses[:size], repeats) for size in sizes
        },
        "called": lambda: measures.called_rates(problem, poses, sizes, repeats),
        "host": lambda: measures.called_rates(on_host, poses, sizes[:1], repeats),
        "agreement": lambda: measures.agreement(problem, on_host, poses[:COMPARED]),
        "score_called": lambda: measures.called_rates(score, poses, sizes, repeats),
        "score_agreement": lambda: measures.agreement(score, score_on_host, poses[:COMPARED]),
        "frame_ms": lambda: {
            str(count): measures.frame_time(problem, space, body.neutral, count, repeats)
            for count in particles
        },
        "many_runs": lambda: measures.many_runs(problem, space, body.neutral, runs, repeats),
        "seeds_together": lambda: measures.seeds_together(
            problem, space, body.neutral, AnnealedSettings(), runs, repeats
        ),
        "swarm_ms": lambda: measures.swarm_time(
            problem, space, body.neutral, measures.swarm_of(SWARM), repeats
        ),
        "tempered_ms": lambda: measures.tempered_time(
            problem, space, body.neutral, measures.tempered_of(TEMPERED), repeats
        ),
        "copies_ms": lambda: measures.copy_times(there, evidence, repeats),
    }
    found: dict[str, object] = {"samples": there.edge_region.samples_per_evaluation}
    for done, (name, measure) in enumerate(steps.items()):
        report("Measuring the card", done, len(steps))
        found[name] = measure()
    return found
