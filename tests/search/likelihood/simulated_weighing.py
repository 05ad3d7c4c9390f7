"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: what a card's kernels give, in Numba's simulator of one,
whose scalar helpers are plain Python then. Writes it to the file named."""

import sys

import numpy as np
from threads_in_turn import take_threads_in_turn
from weighting_scene import four_cameras, scattered, smooth_evidence

from studio.body.catalogue import load_body
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.likelihood.problem import TRUNK_FIRST, WHOLE_BODY

SAMPLES = {"edge_samples": 64, "region_samples": 48}
SCENES = {
    "human31": ("human31", 5, {}),
    "hidden edges": ("human31", 2, {"occlusion_aware": True}),
    "in bands": ("planar_arm4", 2, {"silhouette_resolution": "full"}),
}
"""Body, poses, and the weighting's knobs. The last one's union does not fit the words that are kept at once."""
FEW_WORDS = 6
FEW_POSES = 2
"""Sent at once: five go in three parts."""


def scene_of(name):
    """A body, cameras, a frame, and poses of which some leave the pictures and some are behind a camera."""
    body, cameras = load_body(name), four_cameras()
    poses = scattered(body, 7)
    if name == "human31":
        poses[3:5, 3:6] += np.random.default_rng(4).uniform(-1500, 1500, (2, 3))
        poses[5:, 3:6] += np.random.default_rng(5).uniform(-6000, 6000, (2, 3))
    return body, cameras, smooth_evidence(cameras, seed=3), poses


def terms_of(scene, device):
    """Terms and areas of a scene's poses, the trunk's edges, and log-weights in both stages."""
    name, count, knobs = SCENES[scene]
    body, cameras, evidence, poses = scene_of(name)
    poses = poses[-count:]
    settings = EdgeRegionSilhouetteSettings(device=device, **SAMPLES, **knobs)
    problem = EdgeRegionSilhouetteLikelihood(body, cameras, settings).problem(evidence)
    edge, region, areas = problem._found(poses, WHOLE_BODY)
    return {
        "edge": edge,
        "region": region,
        "both": areas.both,
        "projected": areas.projected,
        "outside": areas.outside,
        "trunk": problem._found(poses, TRUNK_FIRST)[0],
        "weights": problem.log_likelihood(poses),
        "trunk weights": problem.log_likelihood(poses, TRUNK_FIRST),
    }


if __name__ == "__main__":
    take_threads_in_turn()
    from studio.search.likelihood import device_weighing, device_weighing_kernels

    device_weighing.POSES_AT_ONCE = FEW_POSES
    found = {}
    for scene in SCENES:
        if scene == "in bands":
            device_weighing_kernels.WORDS = FEW_WORDS
        found |= {f"{scene}.{key}": value for key, value in terms_of(scene, "gpu").items()}
    np.savez(sys.argv[1], **found)
