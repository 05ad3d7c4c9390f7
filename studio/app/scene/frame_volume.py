"""A frame's visual hull and blobs, computed in a separate thread, so that they never delay scene or search.

The hull is carved from the evidence of the run's own settings. In a run with the likelihood `blobs` it is the run's own
hull, with the blobs fitted from the shown result and the memory that came into the frame; in other runs it is carved
with the default knobs of that likelihood.
"""

import dataclasses
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from cachetools import LRUCache

from studio.app.scene.opened_run import Moment, OpenedRun
from studio.evidence.volume.alignment import root_parameters
from studio.evidence.volume.blob_model import BlobMixture, BlobModel
from studio.evidence.volume.hull import Hull
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.low_priority import step_back
from studio.foundations.memory import give_back_freed_memory
from studio.runs.problem_source import ProblemSource
from studio.search.likelihood.blob_settings import BlobSettings
from studio.search.likelihood.blobs import BlobFrameLikelihood, blob_mixture
from studio.search.settings import RunSettings, default_settings

BLOBS = "blobs"
FEWEST_VIEWS = 2
KEPT = 6
REST_SECONDS = 20.0
"""Footage and background models are released after so many seconds without a request."""
LEAST_PAUSE_SECONDS, LONGEST_PAUSE_SECONDS = 0.05, 0.5
"""Pause between two frames in times of the last one's duration, so that at most half a core is used."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameVolume:
    """The hull of a frame with its blobs. model : the blobs that the run had then; fitted : to the voxels; None without
    blobs, the latter also in an empty hull.
    """

    frame: int
    hull: Hull
    model: BlobModel | None = None
    fitted: BlobMixture | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Request:
    key: tuple[object, ...]
    frame: int
    settings: RunSettings
    pose: Array | None
    memory: Mapping[str, Array]


def has_blobs(settings: RunSettings) -> bool:
    return isinstance(settings.weighting, BlobSettings)


class FrameVolumes:
    """Makes the volumes of an opened run on demand, the newest request first, and keeps the last few.

    ready : called from the thread when one was made. failed : called from it with a reason, once for each.
    """

    def __init__(
        self, opened: OpenedRun, ready: Callable[[], None], failed: Callable[[StudioError], None]
    ) -> None:
        self._opened, self._ready, self._failed = opened, ready, failed
        self._kept = LRUCache[tuple[object, ...], FrameVolume | None](KEPT)
        self._newest: FrameVolume | None = None
        self._requested: _Request | None = None
        self._reported: set[str] = set()
        self._lock = threading.Lock()
        self._wake, self._stopping = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None

    def of(self, moment: Moment, settings: RunSettings, *, blobs: bool) -> FrameVolume | None:
        """The volume of a moment; until it is made, the one shown before. blobs : requested with the hull."""
        frame = self._opened.span[0] if moment.frame is None else moment.frame
        request = self._request_for(frame, moment.pose, settings, blobs=blobs and has_blobs(settings))
        with self._lock:
            if request.key in self._kept:
                self._newest = self._kept[request.key]
                return self._newest
            self._requested = request
        self._wake.set()
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="scene-volumes", daemon=True)
            self._thread.start()
        return self._newest

    def close(self) -> None:
        """End the thread and release the footage."""
        self._stopping.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join(timeout=10.0)

    def _request_for(self, frame: int, pose: Array | None, settings: RunSettings, *, blobs: bool) -> _Request:
        chosen = settings if has_blobs(settings) else _carving(settings)
        if not blobs or pose is None:
            return _Request((frame, chosen.evidence, chosen.weighting), frame, chosen, None, {})
        key = (frame, chosen.evidence, chosen.weighting, pose.tobytes())
        before = self._opened.result(frame - 1) if key not in self._kept else None
        memory: Mapping[str, Array] = before.carried.memory if before is not None else {}
        return _Request(key, frame, chosen, pose.copy(), memory)

    def _work(self) -> None:
        step_back()
        problems: ProblemSource | None = None
        try:
            while not self._stopping.is_set():
                if not self._wake.wait(REST_SECONDS) and problems is not None:
                    problems.close()
                    problems = None
                    give_back_freed_memory()
                self._wake.clear()
                with self._lock:
                    request, self._requested = self._requested, None
                if request is None or self._stopping.is_set():
                    continue
                problems = self._make(request, problems)
        finally:
            if problems is not None:
                problems.close()

    def _make(self, request: _Request, problems: ProblemSource | None) -> ProblemSource | None:
        opened, began = self._opened, time.monotonic()
        made: FrameVolume | None = None
        try:
            if len(opened.cameras) < FEWEST_VIEWS and len(root_parameters(opened.body)):
                raise StudioError(
                    "One camera makes no visual hull.", "Visual hulls need two cameras or more."
                )
            problems = problems or ProblemSource(opened.session, opened.body, opened.cameras)
            made = _volume(problems, request)
        except StudioError as problem:
            self._report(problem)
        with self._lock:
            self._kept[request.key] = made
        self._ready()
        took = time.monotonic() - began
        self._stopping.wait(min(LONGEST_PAUSE_SECONDS, max(LEAST_PAUSE_SECONDS, took)))
        return problems

    def _report(self, problem: StudioError) -> None:
        if str(problem) not in self._reported:
            self._reported.add(str(problem))
            self._failed(problem)


def _volume(problems: ProblemSource, request: _Request) -> FrameVolume:
    """Raises FootageError, NotFoundError, CalibrationError."""
    problem = problems.problem(request.frame, request.settings)
    assert isinstance(problem, BlobFrameLikelihood)
    if request.pose is None:
        return FrameVolume(request.frame, problem.hull)
    expected = problem.expecting(request.pose[None], request.memory)
    return FrameVolume(request.frame, problem.hull, expected.model, blob_mixture(expected))


def _carving(settings: RunSettings) -> RunSettings:
    """The settings for the hull of a run with another likelihood: its own evidence, default knobs."""
    return dataclasses.replace(
        default_settings(settings.tracker_name, BLOBS), evidence=settings.evidence, recovery=settings.recovery
    )
