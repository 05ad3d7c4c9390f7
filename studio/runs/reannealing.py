"""Anneals a frame again with other settings: the same start and random keys, only the knobs differ.

Nothing is stored unless it is kept. One set of settings holds for the whole frame.
"""

from studio.foundations.errors import RunError
from studio.runs.tracking_run import TrackingRun
from studio.search.settings import RunSettings
from studio.search.trackers.tracker import FrameResult, LayerRecord


class Reannealing:
    """A stored frame, or the next one, annealed again layer by layer. Raises NotFoundError for any other frame."""

    def __init__(self, tracking: TrackingRun, frame: int, version: int, settings: RunSettings) -> None:
        self.frame, self.version, self.settings = frame, version, settings
        self._tracking = tracking
        self._search = tracking.search_again(frame)
        self.layers: list[LayerRecord] = []

    @property
    def finished(self) -> bool:
        return self._search.finished

    @property
    def search_layers(self) -> int:
        """Layers of one search of the frame; 0 before the first layer."""
        return self._search.layer_count

    @property
    def searches(self) -> int:
        """How many searches the frame has."""
        return self._search.repeats

    def step_layer(self) -> LayerRecord:
        """Do the next layer and return its record."""
        problem = self._tracking.problems.problem(self.frame, self.settings)
        record = self._search.step(problem, self.version, self.settings.tracker)
        self.layers.append(record)
        return record

    def result(self) -> FrameResult:
        """The frame's result. Raises RunError while layers are left."""
        return self._tracking.result_of(self._search, self.settings, self.layers)

    def keep(self, *, alone: bool = False) -> None:
        """Make this the run's frame; later frames, which followed from the old one, are dropped unless `alone`."""
        if not self.finished:
            raise RunError(f"Frame {self.frame} is not finished.", "Wait for its last layer.")
        self._tracking.keep(self.result(), self.layers, self.version, self.settings, alone=alone)
