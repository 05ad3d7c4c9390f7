"""Speed of pose evaluation, compared with the limit set by memory and by arithmetic that cannot be left out.

The scene is generated: four 640 × 480 cameras like those of the Lee walk around the default body, a
silhouette and a noisy picture. Limits are measured in the same run, on the same poses:

* of map reads, the edge and region weighting's own loads alone, a pose after the other: the index stream that it
  produced, replayed sixteen poses at a time, so that it comes from the cache (read from memory as a whole the loads
  alone would take half as long again, and flatter the weighting). Weightings that read a different number of samples
  are given as much time for each. A weighting may beat it: sixteen poses that read a limb one after the other share
  what they load.
* of areas, the spans of the limbs' rows and the counting of bits alone.

Everything is repeated in turns and the best of each counts, so that other processes change little."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.evidence.edges import bodytrack_edges, proximity_edges
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.numba_in_threads import numba
from studio.foundations.progress import Progress
from studio.garden.benchmarks.timing import quickest
from studio.results.drawing_footage.arm_footage import filled
from studio.results.drawing_footage.cameras import ring_camera
from studio.search.likelihood.area_kernels import FIELDS, record_tables, spans_only
from studio.search.likelihood.bodytrack import BodytrackLikelihood, BodytrackSettings
from studio.search.likelihood.edge_region import (
    EdgeRegionFrameLikelihood,
    EdgeRegionLikelihood,
    EdgeRegionSettings,
)
from studio.search.likelihood.edge_region_kernels import CHUNK, loads_only
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.likelihood.edge_silhouette import EdgeSilhouetteLikelihood, EdgeSilhouetteSettings
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.problem import FrameLikelihood
from studio.search.likelihood.silhouette_areas import FULL, HALF, silhouettes_of
from studio.search.likelihood.template import TemplateLikelihood, TemplateSettings
from studio.search.likelihood.visible_edges import body_edges

WIDTH, HEIGHT = 640, 480
FOCAL, DISTANCE, ABOVE = 560.0, 3300.0, 1700.0
"""Pixels and mm: a person about 200 pixels tall, seen from above as by the Lee walk's cameras."""
FRAMES_PER_SECOND = 60.0
POSES = 1008
LIMIT_BLOCKS, LIMIT_PASSES = 4, 20
"""The limit takes about as long as weighing all poses, so that other load disturbs both alike."""


@dataclass(frozen=True, slots=True)
class Contest:
    """One timed task. run : executes it once. evaluations : of one run."""

    name: str
    run: Callable[[], object]
    evaluations: int
    threads: int = 1


def run_benchmark(
    body_name: str = "human31", repeats: int = 80, progress: Progress | None = None
) -> dict[str, object]:
    """Evaluations a second of every weighting, on one thread unless noted, the limit of each, and the fraction of it
    that is reached.

    repeats : of every measurement. progress : called with (step, done, total). Changes the number of Numba's threads
    while it runs, and sets it back."""
    body = load_body(body_name)
    cameras = ring_of_cameras(body)
    rng = np.random.default_rng(0)
    poses = poses_around(body, POSES, rng)
    evidence = made_evidence(body, cameras, rng)
    likelihood = EdgeRegionLikelihood(body, cameras, EdgeRegionSettings())
    problem = likelihood.problem(evidence["proximity"])
    limit = limit_contest(problem, poses)
    spans = [spans_contest(problem, evidence["proximity"], poses, resolution) for resolution in (HALF, FULL)]
    contests = [*weighing_contests(body, cameras, evidence, problem, poses), limit, *spans]
    best = timed(contests, repeats, progress)
    rates = {contest.name: contest.evaluations / best[contest.name] for contest in contests}
    most, half, full = (rates.pop(contest.name) for contest in (limit, *spans))
    rate, two = rates["edge_region"], rates.get("edge_region_two_threads")
    samples = likelihood.samples_per_evaluation
    bodytrack = BodytrackLikelihood(body, cameras, BodytrackSettings()).problem(evidence["bodytrack"])
    bodytrack_samples = float(bodytrack.terms(poses)[2].sum(axis=1).mean())
    areas = ((HALF, half), (FULL, full))
    edge_samples = CHUNK * len(body_edges(body).whole) * len(cameras)
    limits = {
        "edge_region_occlusion_aware": most,
        "bodytrack": most * samples / bodytrack_samples,
        "template": full,
        **{f"edge_silhouette_{name}": one_after(most * samples / edge_samples, area) for name, area in areas},
        **{f"edge_region_silhouette_{name}": one_after(most, area) for name, area in areas},
    }
    return {
        "edge_region": {
            "evaluations_per_second": round(rate),
            "samples": samples,
            "load_limit_per_second": round(most),
            "fraction_of_load_limit": round(rate / most, 3),
            **({"two_threads": round(two / rate, 3)} if two else {}),
        },
        "limits_per_second": {name: round(limit) for name, limit in limits.items()},
        "fractions": {name: round(rates[name] / limit, 3) for name, limit in limits.items()},
        "others_evaluations_per_second": {
            name: round(measured) for name, measured in rates.items() if name != "edge_region"
        },
        "body": body.name,
        "cameras": len(cameras),
        "poses": POSES,
        "repeats": repeats,
    }


def poses_around(body: BodyModel, count: int, rng: np.random.Generator) -> Array:
    """(N, D) poses around the neutral one, as far apart as a frame's particles."""
    sigma = np.array([entry.max_step for entry in body.parameters]) / (2.0 * FRAMES_PER_SECOND)
    return body.neutral + sigma * rng.normal(size=(count, len(sigma)))


def ring_of_cameras(body: BodyModel) -> tuple[Camera, ...]:
    """Four cameras around a body in its neutral pose, looking at its middle."""
    middle = limb_ends(body, body.neutral[None]).reshape(-1, 3).mean(axis=0)
    bearings = np.deg2rad(45.0 + 90.0 * np.arange(4))
    return tuple(
        ring_camera(f"made{number}", (WIDTH, HEIGHT), FOCAL, middle, (bearing, DISTANCE, ABOVE))
        for number, bearing in enumerate(bearings, 1)
    )


def made_evidence(
    body: BodyModel, cameras: tuple[Camera, ...], rng: np.random.Generator
) -> dict[str, FrameEvidence]:
    """A frame of the body's cones in its neutral pose on a darker noisy background, by kind of edge map."""
    corners, _ = OutlineProjector.of_body(body, cameras).corners(body.neutral[None])
    frames: dict[str, list[ViewEvidence]] = {"proximity": [], "bodytrack": []}
    for camera, outlines in zip(cameras, corners[0], strict=True):
        mask = filled(outlines, camera.width, camera.height)
        grey = np.clip(60.0 + 90.0 * (mask > 0) + rng.normal(0.0, 4.0, mask.shape), 0, 255).astype(np.uint8)
        picture = np.repeat(grey[:, :, None], 3, axis=2)
        proximity = proximity_edges(picture, 12.0, 2.0)
        frames["proximity"].append(ViewEvidence(camera.name, picture, mask, proximity))
        frames["bodytrack"].append(ViewEvidence(camera.name, picture, mask, bodytrack_edges(picture)))
    return {kind: FrameEvidence(0, tuple(views)) for kind, views in frames.items()}


def weighing_contests(
    body: BodyModel,
    cameras: tuple[Camera, ...],
    evidence: dict[str, FrameEvidence],
    problem: EdgeRegionFrameLikelihood,
    poses: Array,
) -> list[Contest]:
    """Every weighting on one thread, edge-region on two as well."""
    aware = EdgeRegionLikelihood(body, cameras, EdgeRegionSettings(occlusion_aware=True))
    problems: dict[str, FrameLikelihood] = {
        "edge_region": problem,
        "edge_region_occlusion_aware": aware.problem(evidence["proximity"]),
        "bodytrack": BodytrackLikelihood(body, cameras, BodytrackSettings()).problem(evidence["bodytrack"]),
        "template": TemplateLikelihood(body, cameras, TemplateSettings()).problem(evidence["proximity"]),
        **silhouette_problems(body, cameras, evidence["proximity"]),
    }
    contests = [Contest(name, _weighing(entry, poses), len(poses)) for name, entry in problems.items()]
    if numba.get_num_threads() > 1:
        many = np.concatenate([poses] * 4)
        contests.append(Contest("edge_region_two_threads", _weighing(problem, many), len(many), threads=2))
    return contests


def silhouette_problems(
    body: BodyModel, cameras: tuple[Camera, ...], evidence: FrameEvidence
) -> dict[str, FrameLikelihood]:
    """The weightings with the bidirectional silhouette, at half and at full resolution."""
    problems: dict[str, FrameLikelihood] = {}
    for resolution in (HALF, FULL):
        edges = EdgeSilhouetteSettings(silhouette_resolution=resolution)
        three = EdgeRegionSilhouetteSettings(silhouette_resolution=resolution)
        problems[f"edge_silhouette_{resolution}"] = EdgeSilhouetteLikelihood(body, cameras, edges).problem(
            evidence
        )
        problems[f"edge_region_silhouette_{resolution}"] = EdgeRegionSilhouetteLikelihood(
            body, cameras, three
        ).problem(evidence)
    return problems


def limit_contest(problem: EdgeRegionFrameLikelihood, poses: Array) -> Contest:
    """The loads alone, of up to LIMIT_BLOCKS blocks of sixteen poses spread over all."""
    outlines, maps = some_blocks(problem.likelihood.projector.blocks(poses)), problem.maps
    blocks, views = outlines.shape[:2]
    edge_pairs, region_pairs = (
        stream.reshape(blocks, views, LANES, -1, LANES).view(np.uint64)
        for stream in problem.recorded_indices(outlines)
    )
    sums = np.zeros((blocks, views, LANES, 2), dtype=np.int64)

    def load() -> NDArray[np.int64]:
        for block in range(blocks):
            one = slice(block, block + 1)
            loads_only(maps, edge_pairs[one], region_pairs[one], LIMIT_PASSES, sums[one])
        return sums

    return Contest("limit", load, blocks * LANES * LIMIT_PASSES)


def spans_contest(
    problem: EdgeRegionFrameLikelihood, evidence: FrameEvidence, poses: Array, resolution: str
) -> Contest:
    """The spans and counts of areas alone, of the poses of `limit_contest`."""
    silhouettes = silhouettes_of(evidence, resolution)
    outlines = some_blocks(problem.likelihood.projector.blocks(poses))
    tables = np.zeros((*outlines.shape[:3], FIELDS * LANES))
    record_tables(outlines, silhouettes.scale, silhouettes.maps.views, tables)
    sums = np.zeros((*outlines.shape[:2], LANES))

    def spans() -> Array:
        spans_only(tables, silhouettes.maps, LIMIT_PASSES, sums)
        return sums

    return Contest(f"spans_{resolution}", spans, len(outlines) * LANES * LIMIT_PASSES)


def some_blocks(outlines: NDArray[np.float32]) -> NDArray[np.float32]:
    """Up to LIMIT_BLOCKS blocks of sixteen poses, spread over all."""
    return np.ascontiguousarray(outlines[:: max(1, len(outlines) // LIMIT_BLOCKS)][:LIMIT_BLOCKS])


def one_after(first: float, second: float) -> float:
    """Evaluations a second of two parts, one after the other, of which each reaches so many alone."""
    return 1.0 / (1.0 / first + 1.0 / second)


def timed(contests: list[Contest], repeats: int, progress: Progress | None) -> dict[str, float]:
    """The best time of each, seconds, all run in turns."""
    return quickest(
        {contest.name: contest.run for contest in contests},
        repeats,
        {contest.name: contest.threads for contest in contests},
        lambda done: progress("Weighing", done, repeats) if progress else None,
    )


def _weighing(problem: FrameLikelihood, poses: Array) -> Callable[[], object]:
    return lambda: problem.log_likelihood(poses)
