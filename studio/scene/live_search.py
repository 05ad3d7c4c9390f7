"""The search as it happens: the layers of the frame in progress, or of a frame that is being annealed
again.
"""

from dataclasses import dataclass, field

from numpy import float64
from numpy.typing import NDArray

from studio.tracking.tracker import FrameResult, LayerRecord
from studio.worker.events import Event, FrameFinished, LayerFinished

Array = NDArray[float64]


@dataclass(frozen=True, slots=True, eq=False)
class LiveSearch:
    """frame : None while nothing is known. reannealed : a what-if beside the stored answer.

    records : the layers so far, in order. result : the frame's result once it is there.
    """

    frame: int | None = None
    reannealed: bool = False
    records: tuple[LayerRecord, ...] = field(default=())
    result: FrameResult | None = None

    @property
    def pose(self) -> Array | None:
        """The answer so far: the result's pose, else the mean of the newest layer."""
        if self.result is not None:
            return self.result.estimate.pose
        return self.records[-1].mean if self.records else None

    @property
    def is_whole(self) -> bool:
        """Whether the result is there, and every layer of it."""
        return self.result is not None and len(self.records) == self.result.layers

    def after(self, event: Event) -> "LiveSearch":
        """The search after an event; others than layers and frames change nothing.

        A layer of another frame, of the other kind, or with a number that was there already begins anew.
        """
        if isinstance(event, LayerFinished):
            record = event.record
            goes_on = (
                self.result is None
                and self.frame == record.frame
                and self.reannealed == event.reannealed
                and bool(self.records)
                and self.records[-1].layer < record.layer
            )
            records = (*self.records, record) if goes_on else (record,)
            return LiveSearch(record.frame, event.reannealed, records)
        if isinstance(event, FrameFinished):
            same = self.frame == event.result.frame and self.reannealed == event.reannealed
            return LiveSearch(
                event.result.frame, event.reannealed, self.records if same else (), event.result
            )
        return self
