"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: searches on a card, in Numba's simulator of one. Writes what
they give to the file named."""

import dataclasses
import sys

import numpy as np
from simulated_weighing import scene_of
from threads_in_turn import take_threads_in_turn

from studio.body.catalogue import load_body
from studio.runs.search_space import search_space
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.condensation import Condensation
from studio.search.trackers.frame_loop import FrameSearch, search_frame, search_together
from studio.search.trackers.layer_plan import LayerPlan, Noise
from studio.search.trackers.settings import AnnealedSettings, CondensationSettings
from studio.search.trackers.tracker import ParticleSet, start_of

COUNT, LAST = 12, 5
SAMPLES = {"edge_samples": 16, "region_samples": 16}
SEEDS = (3, 1 << 40)
PLAN = LayerPlan(0.4, Noise(None, 0.6, 0.8, correlated=True), crossed=0.7)
SETTINGS = AnnealedSettings(layers=3, particles=COUNT, crossover=0.5)
FEWER = dataclasses.replace(SETTINGS, layers=2, dynamics="constant_velocity")
"""Of runs side by side: a pose takes the simulator a third of a second."""
OF_FRAMES = (SETTINGS, dataclasses.replace(SETTINGS, crossover_by="parameters"))


def problem_of(device):
    """A frame seen by one camera, the body's space, and poses."""
    _, cameras, evidence, poses = scene_of("planar_arm4")
    body = load_body("planar_arm4")
    one_view = type(evidence)(evidence.frame, evidence.views[:1])
    settings = EdgeRegionSilhouetteSettings(device=device, **SAMPLES)
    problem = EdgeRegionSilhouetteLikelihood(body, cameras[:1], settings).problem(one_view)
    return problem, search_space(body, np.full(len(body.parameters), 0.1)), poses


def last_set(poses, run):
    """Weighted particles that a frame left."""
    weights = np.random.default_rng(run).random(LAST)
    return ParticleSet(poses[run : run + LAST - 2].repeat(2, axis=0)[:LAST], np.log(weights / weights.sum()))


def layers_of(runs, found, name):
    """A frame's first layer of some runs side by side, all that it makes."""
    problem, space, poses = problem_of("gpu")
    there = problem.on_device()
    side_by_side = device_search.DeviceFilter(there.device, space, len(runs))
    moments = [device_search.Moment(SEEDS[run], 7, 2) for run in runs]
    start = side_by_side.take([last_set(poses, run) for run in runs])
    first = side_by_side.begin(start, moments, COUNT, np.tile(space.sigma, (len(runs), 1)), carry="resampled")
    begun = np.array(first.poses.copy_to_host())
    weighed, following = side_by_side.step(first, there, moments, [PLAN] * len(runs))
    found |= {
        f"{name}.begun": begun,
        f"{name}.weights": weighed.weights.copy_to_host(),
        f"{name}.annealed": weighed.annealed.copy_to_host(),
        f"{name}.cumulated": weighed.cumulated.copy_to_host(),
        f"{name}.parents": side_by_side._memory("parents", (2, len(runs) * COUNT), np.int32).copy_to_host(),
        f"{name}.survivors": side_by_side._memory(
            "survivors", (len(space.names), len(runs) * COUNT), np.float32
        ).copy_to_host(),
        f"{name}.moments": side_by_side._moments.copy_to_host(),
        f"{name}.root": side_by_side._root.copy_to_host(),
        f"{name}.following": following.poses.copy_to_host(),
    }


def searches(found):
    """A frame searched at once, and one that goes on elsewhere after its first layer; Condensation's two frames."""
    problem, space, poses = problem_of("gpu")
    tracker, start = AnnealedParticleFilter(), start_of(tuple(poses[0]))
    whole = FrameSearch(tracker, start, space, seed=5, frame=0)
    records = []
    while not whole.finished:
        records.append(whole.step(problem, 0, SETTINGS))
        if len(records) == 1:
            kept = whole.state
    resumed = FrameSearch(tracker, start, space, seed=5, frame=0, state=kept)
    while not resumed.finished:
        last = resumed.step(problem, 0, SETTINGS)
    result = whole.result()
    found |= {
        "search.poses": np.stack([record.poses for record in records]),
        "search.log_weights": np.stack([record.log_weights for record in records]),
        "search.resumed": last.poses,
        "search.estimate": result.estimate.pose,
        "search.evaluations": np.array(result.evaluations),
        "search.carried": result.carried.particles.poses,
        "search.carried_weights": result.carried.particles.log_weights,
        "search.variances": np.stack([record.variance_diffused for record in records]),
        "search.weighed": np.stack([record.variance_weighed for record in records]),
    }
    records, previous = [], start
    for frame in range(2):
        previous = search_frame(
            tracker,
            problem,
            previous,
            space,
            seed=5,
            frame=frame,
            settings_source=lambda settings=OF_FRAMES[frame]: (0, settings),
            repeats=2 - frame,
            on_layer=records.append,
        ).carried
    found |= {
        "frames.poses": np.stack([record.poses for record in records]),
        "frames.parents": np.stack([record.parents for record in records if record.parents.size]),
    }
    condensation, settings = Condensation(), CondensationSettings(particles=COUNT, scale_frames=1)
    records, scales = [], []
    for frame in range(2):
        done = search_frame(
            condensation,
            problem,
            start,
            space,
            seed=5,
            frame=frame,
            settings_source=lambda: (0, settings),
            on_layer=records.append,
        )
        start = done.carried
        scales.append(start.particles.extra["log_scales"])
    found |= {
        "condensation.poses": np.stack([record.poses for record in records]),
        "condensation.betas": np.array([record.beta for record in records]),
        "condensation.scales": np.concatenate(scales),
    }


def together(found):
    """Two frames of two runs that differ by seed and σ0, side by side and each alone."""
    problem, space, poses = problem_of("gpu")
    spaces = space, dataclasses.replace(space, sigma=1.5 * space.sigma)
    trackers = {
        "annealed": (AnnealedParticleFilter(), FEWER),
        "condensation": (Condensation(), CondensationSettings(particles=COUNT, scale_frames=3)),
    }
    for name, (tracker, settings) in trackers.items():
        for runs in ((0, 1), (0,), (1,)):
            carried = [start_of(tuple(poses[run])) for run in runs]
            records = []
            for frame in range(2):
                searches = [
                    FrameSearch(tracker, last, spaces[run], seed=SEEDS[run], frame=frame)
                    for run, last in zip(runs, carried, strict=True)
                ]
                source = lambda settings=settings: (0, settings)  # noqa: E731
                done = search_together(searches, problem, source, records.append)
                carried = [result.carried for result in done]
            for place, run in enumerate(runs):
                own = records[place :: len(runs)]
                key = f"{name}.{'both' if len(runs) > 1 else 'one'}.{run}"
                found |= {
                    f"{key}.poses": np.stack([record.poses for record in own]),
                    f"{key}.numbers": np.array([(record.beta, record.best_log_weight) for record in own]),
                    f"{key}.carried": carried[place].particles.log_weights,
                    f"{key}.estimate": carried[place].estimate,
                }


if __name__ == "__main__":
    from studio.search.trackers import device_search, device_search_kernels

    take_threads_in_turn()
    # The simulator runs a thread of the processor for each of the card's.
    device_search_kernels.SUMMING = device_search.SUMMING = 8
    device_search.THREADS = 8
    results = {}
    layers_of((0, 1), results, "both")
    layers_of((1,), results, "one")
    searches(results)
    together(results)
    np.savez(sys.argv[1], **results)
