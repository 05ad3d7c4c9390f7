"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: terms of edge and region by the device's kernels, in Numba's
simulator of a device, whose scalar helpers are plain Python then. Writes them to the file named."""

import sys

import numpy as np
from weighting_scene import four_cameras, scattered, smooth_evidence

from studio.body.catalogue import load_body
from studio.search.likelihood.edge_region import EdgeRegionLikelihood, EdgeRegionSettings
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.likelihood.problem import TRUNK_FIRST

SAMPLES = {"edge_samples": 64, "region_samples": 48}


def scene_of(name):
    """A body, cameras, a frame, and poses of which some leave the pictures and some are behind a camera."""
    body, cameras = load_body(name), four_cameras()
    poses = scattered(body, 7)
    if name == "human31":
        poses[3:5, 3:6] += np.random.default_rng(4).uniform(-1500, 1500, (2, 3))
        poses[5:, 3:6] += np.random.default_rng(5).uniform(-6000, 6000, (2, 3))
    return body, cameras, smooth_evidence(cameras, seed=3), poses


def terms_of(name, device):
    """Σe and Σr of the poses, the trunk's Σe, and the log-weights of every third."""
    body, cameras, evidence, poses = scene_of(name)
    problem = EdgeRegionLikelihood(body, cameras, EdgeRegionSettings(device=device, **SAMPLES)).problem(
        evidence
    )
    edge, region = problem.terms(poses)
    found = {"edge": edge, "region": region, "weights": problem.log_likelihood(poses[::3])}
    if device == "cpu" or name == "human31":
        settings = EdgeRegionSilhouetteSettings(device=device, **SAMPLES)
        likelihood = EdgeRegionSilhouetteLikelihood(body, cameras, settings)
        three = likelihood.problem(evidence)
        if device == "cpu":
            found["trunk"] = 1.0 - three.terms(poses, TRUNK_FIRST)[0]
        else:
            found["trunk"] = three.edge_region.terms_there(poses, likelihood.trunk)[0]
    return found


if __name__ == "__main__":
    wanted = sys.argv[2:]
    np.savez(
        sys.argv[1],
        **{f"{name}.{key}": value for name in wanted for key, value in terms_of(name, "gpu").items()},
    )
