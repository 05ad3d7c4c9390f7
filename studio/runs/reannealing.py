"""What a frame would have become with other settings: the same start, the same random keys, only the knobs
differ.

Nothing of it reaches the store unless it is kept. One set of settings holds for the whole frame, so that the
answer is to one question.
"""

from studio.errors import RunError
from studio.runs.tracking_run import TrackingRun
from studio.settings import RunSettings
from studio.tracking.tracker import FrameResult, LayerRecord


class Reannealing:
    """A stored frame, or the next one, annealed again layer by layer. Raises NotFoundError for any other
    frame."""

    def __init__(self, tracking: TrackingRun, frame: int, version: int, settings: RunSettings) -> None:
        self.frame, self.version, self.settings = frame, version, settings
        self._tracking = tracking
        self._search = tracking.search_again(frame)
        self.layers: list[LayerRecord] = []

    @property
    def finished(self) -> bool:
        """Whether the last layer is done."""
        return self._search.finished

    def step_layer(self) -> LayerRecord:
        """Do the next layer and return its record."""
        problem = self._tracking.problems.problem(self.frame, self.settings)
        record = self._search.step(problem, self.version, self.settings.tracker)
        self.layers.append(record)
        return record

    def result(self) -> FrameResult:
        """The frame's result. Raises RunError while layers are left."""
        return self._tracking.result_of(self._search, self.settings)

    def keep(self, *, alone: bool = False) -> None:
        """Make this the run's own frame; later frames are dropped, as they followed from the old one, unless it stands
        `alone`.
        """
        if not self.finished:
            raise RunError(f"Frame {self.frame} is not annealed to its end.", "Wait for its last layer.")
        self._tracking.keep(self.result(), self.layers, self.version, self.settings, alone=alone)
