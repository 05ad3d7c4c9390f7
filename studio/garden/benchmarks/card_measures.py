"""What is measured of a graphics card; imported only where there is one.

What is timed on the card is timed by its own events, the median of some; what includes the host by the host's clock.
"""

import dataclasses
import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.numba_on_devices import cuda
from studio.garden.benchmarks.timing import quickest
from studio.search.likelihood.device_weighing import ProblemOnDevice, WeighingDevice
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteFrameLikelihood,
    EdgeRegionSilhouetteLikelihood,
)
from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.device_search import DeviceFilter, Moment
from studio.search.trackers.frame_loop import FrameSearch, search_frame, search_together
from studio.search.trackers.particle_swarm import ParticleSwarm
from studio.search.trackers.settings import AnnealedSettings, TemperedSettings
from studio.search.trackers.swarm_settings import SwarmSettings
from studio.search.trackers.tempered import TemperedFilter
from studio.search.trackers.tracker import AnyTracker, FilterState, FrameResult, ParticleSet, SearchSpace

LAYERS, SMALL, LAUNCHES = 10, 100, 10
LOADS, WORDS, ROUNDS = 64, 1 << 20, 256


def timed(work: Callable[[], object], repeats: int) -> float:
    """Milliseconds that a card takes for `work`, by its events: the median."""
    work()
    times: list[float] = []
    for _ in range(max(repeats, 1)):
        begin, end = cuda.event(), cuda.event()
        begin.record()
        work()
        end.record()
        end.synchronize()
        times.append(float(begin.elapsed_time(end)))
    return float(np.median(times))


def clocked(work: Callable[[], object], repeats: int) -> float:
    """Milliseconds of `work`, which ends when its result is on the host: the median."""
    work()
    times: list[float] = []
    for _ in range(max(repeats, 1)):
        began = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - began))
    return float(np.median(times))


def resident_rates(
    problem: EdgeRegionSilhouetteFrameLikelihood, poses: Array, repeats: int
) -> dict[str, float]:
    """Million evaluations a second of poses that lie on the card, weights left there: edge and region, and all three
    terms.
    """
    there = problem.on_device()
    assert there is not None
    projector = problem.likelihood.edge_region.projector
    settings = problem.likelihood.settings
    chunks = settings.edge_chunks, settings.region_chunks
    two = WeighingDevice(projector.program, projector.camera_table, chunks)
    count = len(poses)
    given = cuda.to_device(np.ascontiguousarray(poses.T, dtype=np.float32))
    weights = cuda.device_array((2, count), np.float64)
    found: dict[str, float] = {}
    for name, device in (("two", two), ("three", there.device)):
        edges = device.edges_of(None)
        factors = there.factors if name == "three" else (*there.factors[:2], 0.0)
        asked = ProblemOnDevice(device, there.frame, factors)

        def weigh(asked: ProblemOnDevice = asked, edges: Any = edges) -> None:  # noqa: ANN401
            asked.device.weigh(given, asked, edges, count, weights, 0, asked.device.memory)

        milliseconds = timed(weigh, repeats)
        found[f"{name}_ms"] = round(milliseconds, 4)
        found[f"{name}_M_per_s"] = round(count / milliseconds / 1e3, 2)
    return found


def called_rates(problem: Any, poses: Array, sizes: Sequence[int], repeats: int) -> dict[str, float]:  # noqa: ANN401
    """Million evaluations a second of the weighting's own call: poses of the host in, log-weights of the host out."""
    best = quickest({size: lambda size=size: problem.log_likelihood(poses[:size]) for size in sizes}, repeats)
    return {str(size): round(1e-6 * size / best[size], 3) for size in sizes}


def agreement(there: Any, here: Any, poses: Array) -> dict[str, float]:  # noqa: ANN401
    """By how much log-weights of the same poses differ, on the card and here."""
    apart = np.abs(there.log_likelihood(poses) - here.log_likelihood(poses))
    again = np.abs(there.log_likelihood(poses) - there.log_likelihood(poses)).max()
    return {
        "poses": len(poses),
        "mean": float(apart.mean()),
        "999_of_1000": float(np.quantile(apart, 0.999)),
        "largest": float(apart.max()),
        "again": float(again),
    }


def frame_time(
    problem: EdgeRegionSilhouetteFrameLikelihood, space: SearchSpace, pose: Array, count: int, repeats: int
) -> dict[str, float]:
    """Milliseconds of a frame of LAYERS × `count` particles, from the last frame's particles on the host to this one's,
    records read; and of its kernels alone.
    """
    settings = AnnealedSettings(layers=LAYERS, particles=count)
    tracker = AnnealedParticleFilter()
    last = FilterState(ParticleSet(np.repeat(pose[None], count, axis=0), np.full(count, -math.log(count))))

    def search() -> None:
        search_frame(tracker, problem, last, space, seed=0, frame=1, settings_source=lambda: (0, settings))

    whole = clocked(search, repeats)
    alone, _ = searching(problem, space, pose, settings, 1)
    return {"frame": round(whole, 3), "kernels": round(timed(alone, repeats), 3)}


def searching(
    problem: EdgeRegionSilhouetteFrameLikelihood,
    space: SearchSpace,
    pose: Array,
    settings: AnnealedSettings,
    runs: int,
) -> tuple[Callable[[], None], Callable[[], Array]]:
    """A frame's search by as many runs, nothing of which is read, and their weighted means (R, D) after it."""
    there, tracker = problem.on_device(), AnnealedParticleFilter()
    assert there is not None
    side_by_side = DeviceFilter(there.device, space, runs)
    start = side_by_side.take([ParticleSet(pose[None], np.zeros(1)) for _ in range(runs)])
    plans = [tracker.plan_layer(layer, space, settings, {}) for layer in range(settings.layers)]

    def search() -> None:
        now = side_by_side.begin(
            start,
            [Moment(run, 1, 1 << 31) for run in range(runs)],
            settings.particles,
            np.tile(space.sigma, (runs, 1)),
        )
        for layer, plan in enumerate(plans):
            assert plan is not None
            moments = [Moment(run, 1, layer) for run in range(runs)]
            _, now = side_by_side.step(now, there, moments, [plan] * runs)

    return search, side_by_side.means


def many_runs(
    problem: EdgeRegionSilhouetteFrameLikelihood, space: SearchSpace, pose: Array, runs: int, repeats: int
) -> dict[str, float | bool]:
    """Frames of LAYERS × SMALL particles: how many times one run's are done a second by many runs at once, and whether
    a run beside others is the run alone, bit for bit.
    """
    settings = AnnealedSettings(layers=LAYERS, particles=SMALL)
    one, means_of_one = searching(problem, space, pose, settings, 1)
    all_of_them, means = searching(problem, space, pose, settings, runs)
    alone, together = timed(one, repeats), timed(all_of_them, repeats)
    return {
        "runs": runs,
        "one_ms": round(alone, 3),
        "all_ms": round(together, 3),
        "times_one": round(runs * alone / together, 2),
        "same_as_alone": bool((means_of_one()[0] == means()[0]).all()),
    }


def seeds_together(
    problem: EdgeRegionSilhouetteFrameLikelihood,
    space: SearchSpace,
    pose: Array,
    settings: AnnealedSettings,
    seeds: int,
    repeats: int,
) -> dict[str, float | bool]:
    """The same as a comparison has it, with every layer's records on the host: milliseconds of a frame of one seed and
    of all, and how many times one's frames are done a second.
    """
    tracker, last = AnnealedParticleFilter(), FilterState(ParticleSet(pose[None], np.zeros(1)))

    def search(count: int) -> list[FrameResult]:
        searches = [FrameSearch(tracker, last, space, seed=seed, frame=1) for seed in range(count)]
        return search_together(searches, problem, lambda: (0, settings))

    alone, together = clocked(lambda: search(1), repeats), clocked(lambda: search(seeds), repeats)
    first, beside = search(1)[0].estimate.pose, search(seeds)[0].estimate.pose
    return {
        "seeds": seeds,
        "one_ms": round(alone, 3),
        "all_ms": round(together, 3),
        "times_one": round(seeds * alone / together, 2),
        "same_as_alone": bool((first == beside).all()),
    }


def swarm_time(
    problem: EdgeRegionSilhouetteFrameLikelihood,
    space: SearchSpace,
    pose: Array,
    settings: SwarmSettings,
    repeats: int,
) -> dict[str, float | int]:
    """As `resident_frame`, of a swarm."""
    return resident_frame(ParticleSwarm(), problem, space, pose, settings, repeats)


def tempered_time(
    problem: EdgeRegionSilhouetteFrameLikelihood,
    space: SearchSpace,
    pose: Array,
    settings: TemperedSettings,
    repeats: int,
) -> dict[str, float | int]:
    """As `resident_frame`, of tempered sequential Monte Carlo."""
    return resident_frame(TemperedFilter(), problem, space, pose, settings, repeats)


def resident_frame(
    tracker: AnyTracker,
    problem: EdgeRegionSilhouetteFrameLikelihood,
    space: SearchSpace,
    pose: Array,
    settings: object,
    repeats: int,
) -> dict[str, float | int]:
    """Milliseconds of a frame whose particles stay on the card, records read. evaluations : of the frame."""
    start = FilterState(ParticleSet(pose[None], np.zeros(1)))
    last = search_frame(
        tracker, problem, start, space, seed=0, frame=0, settings_source=lambda: (0, settings)
    ).carried

    def search() -> FrameResult:
        return search_frame(
            tracker, problem, last, space, seed=0, frame=1, settings_source=lambda: (0, settings)
        )

    return {"frame": round(clocked(search, repeats), 3), "evaluations": search().evaluations}


def swarm_of(evaluations: int) -> SwarmSettings:
    """A swarm that a card does, of about so many evaluations a frame."""
    sizes = ParticleSwarm().evaluation_knobs(evaluations, 0)
    return dataclasses.replace(SwarmSettings(limbs_apart=False), **sizes)


def tempered_of(evaluations: int) -> TemperedSettings:
    """Tempered sequential Monte Carlo of about so many evaluations a frame."""
    return dataclasses.replace(TemperedSettings(), **TemperedFilter().evaluation_knobs(evaluations, 0))


def copy_times(likelihood: EdgeRegionSilhouetteLikelihood, evidence: Any, repeats: int) -> dict[str, float]:  # noqa: ANN401
    """What a frame's copies cost: its maps and silhouettes to the card."""
    problem = likelihood.problem(evidence)
    device, maps = likelihood.edge_region.device, problem.edge_region.maps
    assert device is not None
    return {
        "maps_and_silhouettes": round(clocked(lambda: device.frame(maps, problem.silhouettes), repeats), 3)
    }


def card_limits(samples: int, repeats: int) -> dict[str, object]:
    """The card's name, and what limits it in the same run: milliseconds of an empty launch, billion bytes loaded one by
    one from its cache a second, billion words of 64 bits counted; what these allow: million evaluations of so many
    samples a second where none shares what it loads with a neighbour, milliseconds of a frame's launches.
    """

    @cuda.jit
    def nothing(values: Any) -> None:  # noqa: ANN401
        pass

    @cuda.jit
    def load(values: Any, found: Any) -> None:  # noqa: ANN401
        at = cuda.grid(1)
        total, place = np.int32(0), np.int32(at * 97 % values.shape[0])
        for _ in range(LOADS):
            total += np.int32(values[place])
            place += np.int32(4099)
            if place >= values.shape[0]:
                place -= np.int32(values.shape[0])
        found[at] = total

    @cuda.jit
    def count(found: Any) -> None:  # noqa: ANN401
        at = cuda.grid(1)
        word, total = np.uint64(at), np.int32(0)
        for _ in range(ROUNDS):
            word = word * np.uint64(6364136223846793005) + np.uint64(1)
            total += np.int32(cuda.popc(word))
        found[at] = total

    values = cuda.to_device(np.random.default_rng(0).integers(0, 255, 8 * 640 * 480).astype(np.uint8))
    found = cuda.device_array(WORDS, np.int32)
    grid = WORDS // 128, 128
    many = 20
    launch = timed(lambda: [nothing[1, 32](values) for _ in range(many)], repeats) / many
    loads = timed(lambda: load[grid](values, found), repeats)
    counts = timed(lambda: count[grid](found), repeats)
    device = cuda.get_current_device()
    name = device.name
    return {
        "name": name.decode() if isinstance(name, bytes) else str(name),
        "multiprocessors": int(getattr(device, "MULTIPROCESSOR_COUNT", 0)),
        "launch_ms": round(launch, 5),
        "loads_G_per_s": round(WORDS * LOADS / loads / 1e6, 1),
        "words_counted_G_per_s": round(WORDS * ROUNDS / counts / 1e6, 1),
        "loads_allow_M_per_s": round(1e-3 * WORDS * LOADS / loads / samples, 1),
        "launches_take_ms": round(LAUNCHES * LAYERS * launch, 3),
    }
