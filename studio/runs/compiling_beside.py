"""Kernels of what follows a frame's first layer, compiled in another process while this one compiles that layer's.

Numba compiles one kernel at a time in a process, and half of a frame's kernels are those that compare and refine the
pose that was found. They are compiled by being called with a frame whose masks are the body itself; this process finds
them stored (`kernel_cache`), or waits for the one in progress.
"""

import contextlib
import dataclasses
import threading
from collections.abc import Generator, Sequence
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array
from studio.foundations.children import Child
from studio.foundations.geometry.camera import Camera
from studio.foundations.kernel_cache import when_compiling
from studio.foundations.numba_in_threads import numba
from studio.runs.search_space import search_space
from studio.search.likelihood.outline_kernels import LANES, ROWS
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.silhouette_areas import HALF, silhouettes_of
from studio.search.trackers.agreement import Agreement, limb_names
from studio.search.trackers.agreement_kernels import FIELDS, count_cells, view_counts
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.frame_refinement import FrameRefinementSettings, FrameRefiner
from studio.search.trackers.hidden_areas import cell_size, counts_of
from studio.search.trackers.limb_colours import FEWEST, LimbColours
from studio.search.trackers.limbs_elsewhere import Change, changes_by_camera
from studio.search.trackers.refinement import RefinementSettings, Refiner
from studio.search.trackers.settings import AnnealedSettings
from studio.search.trackers.tracker import Estimate, FrameResult, start_of
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@contextlib.contextmanager
def compiling_beside(run: StoredRun) -> Generator[None]:
    """Compile what follows a frame's search in another process, if anything has to be compiled inside."""
    if numba.get_num_threads() < 2:
        yield
        return
    with when_compiling(partial(_start, run)):
        yield


def compile_for(_inbox: Connection, _outbox: Connection, session_folder: Path, run_name: str) -> None:
    """The process."""
    run = Session(session_folder).run(run_name)
    body, cameras = run.body(), run.cameras()
    start = run.record.start_pose
    pose = body.neutral if start is None else np.array(start)
    _compile_without_outlines(body, cameras, pose)
    corners = Agreement(body, cameras).corners(pose)
    evidence = FrameEvidence(0, tuple(_view(*seen) for seen in zip(cameras, corners, strict=True)))
    result = FrameResult(0, Estimate(pose, pose, pose, 0.0), 0, 0, 0, 0.0, start_of(tuple(pose.tolist())))
    settings = dataclasses.replace(FrameRefinementSettings(), redraw_limbs=False)
    silhouettes = partial(silhouettes_by_camera, evidence)
    changes = partial(changes_by_camera, evidence)
    FrameRefiner(body, cameras, 0).refined(result, silhouettes, _Alike(), settings, changes)
    _compile_colours(body, cameras, pose, tuple(changes().values()))


def _compile_colours(
    body: BodyModel, cameras: tuple[Camera, ...], pose: Array, changed: Sequence[Change]
) -> None:
    """What compares colours, called as if those of all limbs were known."""
    colours = LimbColours(body, cameras)
    views = colours.views(pose, changed)
    for name, counts in colours.learnt(pose, views, {}, {}).items():
        colours.gains(pose[None], limb_names(body)[0], views, colours.known({name: counts + FEWEST}))


def _compile_without_outlines(body: BodyModel, cameras: tuple[Camera, ...], pose: Array) -> None:
    """What takes outlines, called with none: the other process is about to compile how they are made, and to wait for
    it costs this one three seconds.
    """
    shown = FrameEvidence(0, tuple(_view(camera, _middle_of(camera)[None]) for camera in cameras))
    limbs = len(body.drawn)
    outlines = np.zeros((1, len(cameras), limbs, ROWS * LANES), np.float32)
    silhouettes_of(shown, HALF).areas(outlines, 1)
    borders = tuple(silhouettes_by_camera(shown).values())
    refiner = Refiner(body, cameras, RefinementSettings())
    refiner.projector = _NoOutlines.of_body(body, cameras)
    refiner.loss(pose, borders)
    for camera, view in zip(cameras, borders, strict=True):
        none, counts = np.full((limbs, 4, 2), np.nan), counts_of({}, camera)
        view_counts(none, view.signed, view.corner, view.size, 1, 1.0, np.zeros((limbs, FIELDS)))
        count_cells(none, view.signed, view.corner, cell_size(camera), 1.0, counts)
    # Of the search what a filter does between two layers, which its first layer leaves time for.
    settings = AnnealedSettings(layers=2, particles=2)
    search_frame(
        TRACKERS["annealed"],
        _Alike(),
        start_of(tuple(pose.tolist())),
        search_space(body, np.ones(len(pose))),
        seed=0,
        frame=0,
        settings_source=lambda: (1, settings),
    )


def _start(run: StoredRun) -> None:
    child = Child(compile_for, run.folder.parents[1], run.name, name="studio-compiling", quiet=True)
    # Nobody else waits for it: what it has compiled is found.
    threading.Thread(target=child.end, args=(None,), name="compiling beside", daemon=True).start()


def _view(camera: Camera, corners: Array) -> ViewEvidence:
    """A view of limbs with outlines (L, 4, 2)."""
    mask = np.zeros((camera.height, camera.width), np.uint8)
    for outline in corners[np.isfinite(corners).all(axis=(1, 2))]:
        cv2.fillConvexPoly(mask, np.rint(outline).astype(np.int32), 255)
    return ViewEvidence(camera.name, np.zeros((*mask.shape, 3), np.uint8), mask, np.zeros_like(mask))


def _middle_of(camera: Camera) -> Array:
    """(4, 2) corners of the middle of its picture."""
    return np.array(((1, 1), (3, 1), (3, 3), (1, 3))) / 4 * (camera.width, camera.height)


class _NoOutlines(OutlineProjector):
    """Sees no limb."""

    def slopes(self, pose: Array, steps: Array, difference: float) -> tuple[Array, Array]:
        unseen = np.full((len(self.cameras), self.limb_count, 4, 2), np.nan)
        return unseen, np.zeros((*unseen.shape, len(pose)))


class _Alike:
    """A frame in which all poses are alike."""

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        return np.zeros(len(poses))

    def fitness(self, poses: Array, stage: int = 0) -> Array:
        return np.zeros(len(poses))

    def feasible(self, poses: Array, *, limbs_apart: bool = False) -> NDArray[np.bool_]:
        return np.ones(len(poses), np.bool_)
