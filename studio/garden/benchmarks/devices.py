"""Speed of edge and region on a graphics card, from a thousand poses to a million; in words where there is none."""

from collections.abc import Sequence

import numpy as np

from studio.body.catalogue import load_body
from studio.foundations.errors import StudioError
from studio.foundations.progress import Progress
from studio.garden.benchmarks.kernels import made_evidence, poses_around, ring_of_cameras
from studio.garden.benchmarks.timing import quickest
from studio.search.likelihood.edge_region import GPU, EdgeRegionLikelihood, EdgeRegionSettings

SIZES = (1_000, 10_000, 100_000, 1_000_000)
COMPARED = 1_000


def run_device_benchmark(
    sizes: Sequence[int] = SIZES, repeats: int = 5, progress: Progress | None = None
) -> dict[str, object]:
    """Evaluations a second of each number of poses, the poses' way to the card and the sums' way back included, and by
    how much a log-weight differs from the processor's at most; "none": why there is no card.
    """
    body = load_body("human31")
    cameras = ring_of_cameras(body)
    try:
        there = EdgeRegionLikelihood(body, cameras, EdgeRegionSettings(device=GPU))
    except StudioError as error:
        return {"none": f"{error.message} {error.hint}"}
    rng = np.random.default_rng(0)
    poses = poses_around(body, max(*sizes, COMPARED), rng)
    evidence = made_evidence(body, cameras, rng)["proximity"]
    problem = there.problem(evidence)
    here = EdgeRegionLikelihood(body, cameras, EdgeRegionSettings()).problem(evidence)
    best = quickest(
        {size: lambda size=size: problem.log_likelihood(poses[:size]) for size in sizes},
        repeats,
        on_round=lambda done: progress("Weighing on the card", done, repeats) if progress else None,
    )
    difference = np.abs(
        problem.log_likelihood(poses[:COMPARED]) - here.log_likelihood(poses[:COMPARED])
    ).max()
    return {
        "evaluations_per_second": {str(size): round(size / best[size]) for size in sizes},
        "samples": there.samples_per_evaluation,
        "largest_difference": float(difference),
    }
