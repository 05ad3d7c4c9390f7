"""Time to carve a visual hull, compared with the paper's Table 1 (Caillette, Galata & Howard 2007).

The scene is generated: a person of cones in the middle of a ring of 320 × 240 cameras, before an empty view with a
sensor's noise. "From pixels" is measured as in the paper (background test, octree and colours); "from masks" leaves out
making the masks. The best of the repeats counts, on as many threads as Numba is set to.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.evidence.volume.reconstruction import HullSettings, Reconstructor
from studio.evidence.volume.tracking_space import box_of
from studio.evidence.yuv_background import learn_background
from studio.foundations.arrays import Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.cones import limb_outlines
from studio.foundations.geometry.projection import project
from studio.foundations.numba_in_threads import numba
from studio.foundations.progress import Progress
from studio.garden.benchmarks.timing import quickest
from studio.results.drawing_footage.arm_footage import filled
from studio.results.drawing_footage.cameras import ring_camera

WIDTH, HEIGHT, FOCAL = 320, 240, 300.0
DISTANCE, LOW, HIGH, MIDDLE = 3300.0, 1500.0, 2500.0, 950.0
"""mm: the ring's radius, the cameras' alternating heights, and that of a person's middle."""
VIEWS, DEPTHS = (3, 4, 5), (6, 7, 8)
TABLE_1 = {3: (11.0, 24.1, 73.5), 4: (11.1, 22.8, 66.0), 5: (12.8, 28.1, 78.6)}
"""Milliseconds by number of views, at depths 6, 7 and 8."""
DARK, LIGHT, NOISE, EMPTY_FRAMES = 90.0, 60.0, 2.0, 20
"""Grey levels: the empty view, how much the person is brighter, a sensor's noise; pictures from which the view is
learnt."""


def run_hull_benchmark(
    body_name: str = "human25", repeats: int = 12, progress: Progress | None = None
) -> dict[str, object]:
    """Milliseconds a hull with 3, 4 and 5 views at depths 6, 7 and 8, from pixels and from masks, beside Table 1.

    repeats : of every measurement, in turns, so that other load disturbs all alike. progress : called with (step, done,
    total).
    """
    rng = np.random.default_rng(0)
    body = load_body(body_name)
    contests: dict[tuple[int, int, str], Callable[[], object]] = {}
    for views in VIEWS:
        cameras = ring_of_small_cameras(views)
        seen = hull_evidence(body, cameras, rng)
        for depth in DEPTHS:
            reconstructor = Reconstructor(cameras, box_of(cameras), HullSettings(hull_depth=depth))
            for kind, evidence in seen.items():
                contests[views, depth, kind] = _carving(reconstructor, evidence)
    best = quickest(
        contests,
        repeats,
        on_round=lambda done: progress("Carving hulls", done, repeats) if progress else None,
    )
    rows = [
        {
            "views": views,
            "depth": depth,
            "pixels_ms": round(1e3 * best[views, depth, "pixels"], 2),
            "masks_ms": round(1e3 * best[views, depth, "masks"], 2),
            "paper_ms": paper,
        }
        for views in VIEWS
        for depth, paper in zip(DEPTHS, TABLE_1[views], strict=True)
    ]
    return {
        "reconstruction": rows,
        "pictures": f"{WIDTH}x{HEIGHT}",
        "threads": int(numba.get_num_threads()),
        "body": body.name,
        "repeats": repeats,
    }


def ring_of_small_cameras(count: int) -> tuple[Camera, ...]:
    """Cameras around the world's origin, looking at a person's middle, alternately lower and higher."""
    middle, size = np.array([0.0, 0.0, MIDDLE]), (WIDTH, HEIGHT)
    places = (
        (2.0 * np.pi * number / count + 0.3, DISTANCE, (HIGH if number % 2 else LOW) - MIDDLE)
        for number in range(count)
    )
    return tuple(ring_camera(f"ring{at}", size, FOCAL, middle, place) for at, place in enumerate(places, 1))


def hull_evidence(
    body: BodyModel, cameras: tuple[Camera, ...], rng: np.random.Generator
) -> dict[str, FrameEvidence]:
    """A frame of the body standing in the middle, as evidence of "pixels" and of "masks"."""
    shapes, frames = kinematic_tables(body).limb_shape, limb_frames(body, body.neutral[None])
    masks: list[ViewEvidence] = []
    pixels: list[ViewEvidence] = []
    for camera in cameras:
        outlines, _ = project(camera, limb_outlines(shapes, frames, camera)[0])
        mask = filled(outlines, camera.width, camera.height)
        empty = [_picture(np.zeros_like(mask), rng) for _ in range(EMPTY_FRAMES)]
        view = ViewEvidence(camera.name, _picture(mask, rng), mask, np.zeros_like(mask))
        masks.append(view)
        pixels.append(dataclasses.replace(view, background=learn_background(empty)))
    return {"pixels": FrameEvidence(0, tuple(pixels)), "masks": FrameEvidence(0, tuple(masks))}


def _picture(mask: Bytes, rng: np.random.Generator) -> Bytes:
    level = DARK + LIGHT * (mask[..., None] > 0) + rng.normal(0.0, NOISE, (*mask.shape, 3))
    return np.clip(np.round(level), 0, 255).astype(np.uint8)


def _carving(reconstructor: Reconstructor, evidence: FrameEvidence) -> Callable[[], object]:
    return lambda: reconstructor.hull(evidence)
