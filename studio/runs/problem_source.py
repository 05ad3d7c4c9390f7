"""Frames of a session as functions of poses: footage → evidence → weighting, with the last few kept.

Evidence is cached by frame and evidence settings, problems by frame and all settings that they depend on, so that
annealing or displaying a frame again decodes and computes nothing twice. With an executor the next frame is prepared
while this one is searched; a request for a cached frame never waits for one in preparation. Prepared are also the
distances that a refinement needs and the silhouettes that a pose is compared with after its search.
"""

import threading
from collections.abc import Hashable
from concurrent.futures import CancelledError, Executor, Future
from typing import Any, TypeVar

from cachetools import LRUCache

from studio.body.model import BodyModel
from studio.evidence.backgrounds import Backgrounds
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence
from studio.evidence.pipeline import EvidenceMaker
from studio.footage.capture.footage import Footage
from studio.foundations.errors import RunError
from studio.foundations.geometry.camera import Camera
from studio.foundations.tracing import span
from studio.runs.run_footage import filmed_cameras
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.silhouette_areas import HALF, silhouettes_of
from studio.search.settings import RunSettings
from studio.search.trackers.frame_refinement import followed_along_lines
from studio.search.trackers.loss_detection import anything_seen, shown_by
from studio.search.trackers.recovery_settings import OFF
from studio.search.trackers.tracker import FrameLikelihood
from studio.sessions.session import Session

KEPT_FRAMES = 4
"""Evidence kept: the current frame, the prepared one, and two earlier ones."""
KEPT_LIKELIHOODS = 4
"""For two settings, each with all cameras and without one that has stopped."""

T = TypeVar("T")


class ProblemSource:
    """The frames of a session for one body. Thread-safe. Close it when done.

    cameras : the run's snapshot, by default the session's; those whose footage was taken away since are left out.
    executor : prepares the next frame; None:
    no preparation. views : another executor, for a frame's cameras in parallel. last : the frame after the last one to
    prepare. footage : closed with this, by default the session's.
    """

    def __init__(
        self,
        session: Session,
        body: BodyModel,
        cameras: tuple[Camera, ...] | None = None,
        *,
        last: int | None = None,
        executor: Executor | None = None,
        views: Executor | None = None,
        footage: Footage | None = None,
    ) -> None:
        self.body = body
        self.cameras = filmed_cameras(session, cameras, footage) if cameras else session.cameras()
        self.footage = footage or session.footage()
        self._last = self.footage.frame_count if last is None else last
        self._backgrounds = Backgrounds(self.footage)
        self._executor = executor
        self._views = views
        self._keeping, self._making = threading.Lock(), threading.Lock()
        self._coming: tuple[Hashable, Future[FrameLikelihood]] | None = None
        self._latest: tuple[int, RunSettings, FrameLikelihood] | None = None
        """Asked for again by every layer of a search; the frame after it is on its way."""
        self._evidence = LRUCache[Hashable, FrameEvidence](KEPT_FRAMES)
        self._problems = LRUCache[Hashable, FrameLikelihood](KEPT_FRAMES)
        self._likelihoods = LRUCache[Hashable, Any](KEPT_LIKELIHOODS)

    def problem(self, frame: int, settings: RunSettings) -> FrameLikelihood:
        """The frame as a function of poses. Raises FootageError, NotFoundError."""
        latest = self._latest
        if latest is not None and latest[0] == frame and latest[1] is settings:
            return latest[2]
        key = problem_key(frame, settings)
        self._await(key)
        problem = self._problem(frame, settings, key)
        executor = self._executor if frame + 1 < self._last else None
        if executor is None or self._prepare(frame + 1, settings, executor):
            self._latest = frame, settings, problem
        return problem

    def evidence(self, frame: int, settings: RunSettings) -> FrameEvidence:
        """The frame's evidence for the settings' likelihood. Raises FootageError, NotFoundError."""
        key = evidence_key(frame, settings)
        evidence = self._get(self._evidence, key)
        if evidence is not None:
            return evidence
        with self._making:
            evidence = self._get(self._evidence, key)
            if evidence is None:
                maker = EvidenceMaker(
                    self.cameras_in(frame),
                    self.footage,
                    self._backgrounds,
                    settings.evidence,
                    WEIGHTINGS[settings.weighting_name].edge_kind,
                    self._views,
                    with_empty=bool(followed_along_lines(self.body, settings.refinement)),
                )
                evidence = self._keep(self._evidence, key, maker.evidence(frame))
            return evidence

    def cameras_in(self, frame: int) -> tuple[Camera, ...]:
        """The cameras that have a picture of the frame; the others are left out of evidence and weight."""
        absent = self.footage.absent(frame)
        return tuple(camera for camera in self.cameras if camera.name not in absent)

    def close(self) -> None:
        """Release the footage and the caches."""
        if self._coming is not None and not self._coming[1].cancel():
            # The preparing thread must be done with the files before they close.
            self._coming[1].exception()
        self._coming = self._latest = None
        with self._making, self._keeping:
            self._problems.clear()
            self._evidence.clear()
            self._likelihoods.clear()
            self.footage.close()

    def _problem(self, frame: int, settings: RunSettings, key: Hashable) -> FrameLikelihood:
        problem = self._get(self._problems, key)
        if problem is not None:
            return problem
        with span("prepare", frame):
            return self._make(frame, settings, key)

    def _make(self, frame: int, settings: RunSettings, key: Hashable) -> FrameLikelihood:
        evidence = self.evidence(frame, settings)
        if settings.refinement.refine_frames:
            with span("distances", frame):
                silhouettes_by_camera(evidence, settings.refinement.refine_frame_points)
        if settings.recovery.recovery != OFF:
            with span("silhouettes", frame):
                shown_by(evidence)
                if any(view.background is None for view in evidence.views):
                    silhouettes_of(evidence, HALF)
        with self._making, span("maps", frame):
            likelihood = self._likelihood(settings, self.cameras_in(frame))
            return self._keep(self._problems, key, likelihood.problem(evidence))

    def _likelihood(self, settings: RunSettings, cameras: tuple[Camera, ...]) -> Any:  # noqa: ANN401 - as weightings are
        key = (settings.weighting_name, settings.weighting, tuple(camera.name for camera in cameras))
        likelihood = self._get(self._likelihoods, key)
        if likelihood is None:
            weighting = WEIGHTINGS[settings.weighting_name]
            made = weighting.prepare(self.body, cameras, settings.weighting)
            likelihood = self._keep(self._likelihoods, key, made)
        return likelihood

    def _prepare(self, frame: int, settings: RunSettings, executor: Executor) -> bool:
        """Begin to prepare a frame; whether it is ready or on its way."""
        key = problem_key(frame, settings)
        if key in self._problems or (self._coming is not None and self._coming[0] == key):
            return True
        if self._coming is not None and not self._coming[1].done():
            return False
        self._coming = (key, executor.submit(self._problem, frame, settings, key))
        return True

    def _await(self, key: Hashable) -> None:
        """Wait for this frame if it is in preparation; its error is raised again where the frame is used."""
        coming = self._coming
        if coming is not None and coming[0] == key:
            self._coming = None
            try:
                coming[1].exception()
            except CancelledError:
                return

    def _get(self, store: LRUCache[Hashable, T], key: Hashable) -> T | None:
        with self._keeping:
            return store.get(key)

    def _keep(self, store: LRUCache[Hashable, T], key: Hashable, value: T) -> T:
        with self._keeping:
            store[key] = value
            return value


def check_seen(session: Session, evidence: FrameEvidence) -> None:
    """Raise RunError for a frame that shows no body."""
    if not anything_seen(evidence):
        raise RunError(
            f"Frame {evidence.frame} of session '{session.name}' shows no body.",
            "Choose a frame in which the person is in view, or check the masks.",
        )


def evidence_key(frame: int, settings: RunSettings) -> Hashable:
    """What a frame's evidence depends on."""
    kind = WEIGHTINGS[settings.weighting_name].edge_kind
    return (frame, settings.evidence, kind, settings.refinement.thin_limbs)


def problem_key(frame: int, settings: RunSettings) -> Hashable:
    """What a frame as a function of poses depends on."""
    return (frame, settings.evidence, settings.weighting_name, settings.weighting)
