"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: what a card's kernels give of the benchmark's score, in
Numba's simulator of one. Writes it to the file named."""

import dataclasses
import pickle
import sys
from pathlib import Path

import numpy as np
from threads_in_turn import take_threads_in_turn
from weighting_scene import four_cameras, scattered, smooth_evidence

from studio.body.catalogue import load_body
from studio.search.likelihood.bodytrack import BodytrackLikelihood, BodytrackSettings

VIEWS, FEW_POSES = 2, 2


def problem_of(device, **knobs):
    """A frame seen by two cameras, and poses, the last but one partly out of the pictures, the last behind a camera."""
    body, cameras, evidence = (
        load_body("human31"),
        four_cameras(),
        smooth_evidence(four_cameras(), seed=3),
    )
    views = []
    for view in evidence.views[:VIEWS]:
        height, width = view.mask.shape
        stripes = (np.arange(width) // 25 + np.arange(height)[:, None] // 40) % 3 > 0
        views.append(dataclasses.replace(view, mask=np.where(stripes, view.mask, 0)))
    seen = type(evidence)(evidence.frame, tuple(views))
    settings = BodytrackSettings(score_edge_weight=0.7, score_inside_weight=1.3, device=device, **knobs)
    poses = scattered(body, 4)
    poses[2, 3:5] += 1500.0, -1500.0
    poses[3, 3:6] += 1e5
    return BodytrackLikelihood(body, cameras[:VIEWS], settings).problem(seen), poses


def found():
    """Log-weights, and the sums that they are made of."""
    problem, poses = problem_of("gpu")
    there = problem.prepared.device
    given = np.ascontiguousarray(poses.T.astype(np.float32))
    edges = there.edges_of(None)
    sums = there.sum_maps(given, problem._on_device, edges, len(poses), 0, there.memory)
    return {"weights": problem.log_likelihood(poses), "sums": np.array(sums.copy_to_host())}


if __name__ == "__main__":
    take_threads_in_turn()
    from studio.search.likelihood import device_weighing

    device_weighing.POSES_AT_ONCE = FEW_POSES
    Path(sys.argv[1]).write_bytes(pickle.dumps(found()))
