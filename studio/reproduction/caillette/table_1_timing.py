"""How long the stages of the paper's tracker take on the dance: carving, fitting blobs, searching."""

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.behaviour.model import BehaviourModel
from studio.comparison.footage_shelf import FootageShelf
from studio.reproduction.caillette.problems import Known
from studio.reproduction.caillette.setting import BLOBS, GUIDED, guided
from studio.runs.behaviour_models import fitting
from studio.runs.search_space import search_space, session_sigma
from studio.sessions.session import Session
from studio.settings import changed_settings, default_settings
from studio.tracking.catalogue import TRACKERS
from studio.tracking.frame_loop import search_frame
from studio.tracking.tracker import Carried, FrameResult, start_of
from studio.volume.blob_fitting import fit_blobs
from studio.volume.hull import Hull
from studio.volume.reconstruction import Reconstructor
from studio.volume.tracking_space import box_of
from studio.weighting.blobs import BlobProblem, BlobWeigher
from studio.weighting.catalogue import WEIGHTINGS

Array = NDArray[np.float64]

ROUNDS = 3


def carving(
    shelf: FootageShelf, session: Session, last: int, depth: int, views: int
) -> tuple[float, list[Hull]]:
    """Milliseconds of a hull, and the hulls of the first frames. Pictures are read and decoded before."""
    settings = changed_settings(default_settings(GUIDED, BLOBS), {"hull_depth": depth})
    weighting, cameras = WEIGHTINGS[BLOBS], session.cameras()
    reconstructor = Reconstructor(cameras[:views], box_of(cameras), settings.weighting)
    fewer = []
    for frame in range(last):
        seen = shelf.evidence(
            session, cameras, frame, settings.evidence, weighting.edge_kind, weighting.reads_pictures
        )
        fewer.append(dataclasses.replace(seen, views=seen.views[:views]))
    hulls = [reconstructor.hull(frame) for frame in fewer]
    return _milliseconds([lambda frame=frame: reconstructor.hull(frame) for frame in fewer]), hulls


def blob_fitting(session: Session, hulls: Sequence[Hull], truth: Array) -> float:
    """Milliseconds of a fit from one prediction, the true pose (F, D) of the frame before, with blobs learnt from the
    frames themselves.
    """
    weigher, body = _weigher(session), session.body()
    memory: Mapping[str, Array] = {}
    for hull, pose in zip(hulls, truth, strict=True):
        memory = BlobProblem(weigher, hull).expecting(pose[None], memory).remembered(pose)
    model = weigher.model(memory)
    starts = truth[[max(0, frame - 1) for frame in range(len(hulls))]]
    return _milliseconds(
        [
            lambda hull=hull, start=start: fit_blobs(hull, model, body, start[None])
            for hull, start in zip(hulls, starts, strict=True)
        ]
    )


def searching(
    session: Session,
    hulls: Sequence[Hull],
    truth: Array,
    particles: int,
    model: BehaviourModel,
    seed: int,
) -> float:
    """Milliseconds of a frame of the guided tracker whose blobs are fitted already: prediction, evaluation, drawing."""
    body, fps = session.body(), session.manifest.fps
    space = search_space(body, session_sigma(session, body, fps), fitting(model, body, fps))
    contender = guided(particles)
    settings = changed_settings(default_settings(contender.tracker, BLOBS), contender.changes).tracker
    weigher = _weigher(session)

    def search(told: Known, before: Carried, frame: int) -> FrameResult:
        return search_frame(
            TRACKERS[contender.tracker],
            told,
            before,
            space,
            seed=seed,
            frame=frame,
            settings_source=lambda: (1, settings),
        )

    carried, frames = start_of(tuple(float(value) for value in truth[0])), []
    for number, (hull, pose) in enumerate(zip(hulls, truth, strict=True)):
        told = Known(BlobProblem(weigher, hull).expecting(pose[None], {}))
        if number:
            frames.append(lambda told=told, before=carried, number=number: search(told, before, number))
        carried = search(told, carried, number).carried
    return _milliseconds(frames)


def _milliseconds(works: Sequence[Callable[[], Any]]) -> float:
    """The mean over several works of the quickest of some rounds each; the first round warms up."""
    best = np.full(len(works), np.inf)
    for _ in range(ROUNDS + 1):
        for place, work in enumerate(works):
            began = time.perf_counter()
            work()
            best[place] = min(best[place], 1000.0 * (time.perf_counter() - began))
    return float(best.mean())


def _weigher(session: Session) -> BlobWeigher:
    settings = default_settings(GUIDED, BLOBS)
    return BlobWeigher(session.body(), session.cameras(), settings.weighting)
