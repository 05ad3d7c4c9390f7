"""The frames of a live run: one is prepared while another is searched.

The preparing and the searching thread share only prepared frames (`Ready`), so neither waits for the other. Anything
else, such as a frame with other settings or the masks for recovery, comes from the run's `ProblemSource`.
"""

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.footage.capture.frame_clock import Arrival
from studio.foundations.geometry.camera import Camera
from studio.runs.problem_source import ProblemSource, evidence_key, problem_key
from studio.search.settings import RunSettings
from studio.search.trackers.tracker import FrameLikelihood


@dataclass(frozen=True, slots=True, eq=False)
class Ready:
    """A prepared frame. arrival : of its pictures. began, done : start and end of its preparation, seconds.
    evidence_key, problem_key : what evidence and problem depend on (`problem_source`).
    """

    arrival: Arrival
    evidence: FrameEvidence
    problem: FrameLikelihood
    evidence_key: Hashable
    problem_key: Hashable
    began: float
    done: float

    @property
    def frame(self) -> int:
        return self.arrival.frame


class LiveProblems:
    """The frames of a live run. Call `ready` in one thread and all else in another.

    clock : that of the arrivals, seconds.
    """

    def __init__(self, source: ProblemSource, clock: Callable[[], float] = time.monotonic) -> None:
        self._source, self._clock = source, clock
        self._at_hand: Ready | None = None

    @property
    def body(self) -> BodyModel:
        return self._source.body

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """In the order of the views."""
        return self._source.cameras

    def ready(self, arrival: Arrival, settings: RunSettings) -> Ready:
        """Decode a set's pictures and prepare the frame. Raises FootageError, NotFoundError."""
        began, frame = self._clock(), arrival.frame
        evidence = self._source.evidence(frame, settings)
        problem = self._source.problem(frame, settings)
        keys = evidence_key(frame, settings), problem_key(frame, settings)
        return Ready(arrival, evidence, problem, *keys, began, self._clock())

    def take(self, ready: Ready) -> None:
        """Make a prepared frame the current one."""
        self._at_hand = ready

    def problem(self, frame: int, settings: RunSettings) -> FrameLikelihood:
        """The frame as a function of poses."""
        ready = self._at_hand
        if ready is not None and ready.problem_key == problem_key(frame, settings):
            return ready.problem
        return self._source.problem(frame, settings)

    def evidence(self, frame: int, settings: RunSettings) -> FrameEvidence:
        """The frame's evidence."""
        ready = self._at_hand
        if ready is not None and ready.evidence_key == evidence_key(frame, settings):
            return ready.evidence
        return self._source.evidence(frame, settings)
