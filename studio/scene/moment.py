"""What there is to draw of one moment: the pose, what stands beside it, and the clouds."""

from collections.abc import Sequence
from dataclasses import dataclass

from numpy import float64
from numpy.typing import NDArray

from studio.runs.tracks import RAW
from studio.scene.live_search import LiveSearch
from studio.scene.opened_run import OpenedRun
from studio.tracking.tracker import LayerRecord

Array = NDArray[float64]


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """frame : None while there is nothing. pose : (D,) drawn as the body. beside : (D,) the stored answer
    while a re-annealed one, or another track's, is shown. records : the layers whose clouds are drawn. layer_count :
    how many layers the frame takes. truth : (M, 3) mm. tracking : how a stored frame went, "" unknown.
    edited : whether the pose is under a person's hands, and not an answer.
    """

    frame: int | None
    pose: Array | None
    beside: Array | None
    records: Sequence[LayerRecord]
    layer_count: int
    truth: Array | None
    tracking: str = ""
    edited: bool = False


def moment_of(
    opened: OpenedRun,
    frame: int | None,
    live: LiveSearch,
    *,
    edited: Array | None = None,
    layers: int = 0,
    track: str = RAW,
) -> Moment:
    """The moment at `frame`: stored, in progress, annealed again, or a pose being edited.

    live : used where it is about this frame. edited : the pose under a person's hands, shown instead of an
    answer. layers : how many layers a frame takes with the settings in use (for the colours of a frame in
    progress). track : whose poses are shown of stored frames, where it has one.
    """
    truth = None if frame is None else opened.truth_at(frame)
    if edited is not None:
        return Moment(frame, edited, None, (), 0, truth, edited=True)
    if frame is not None and frame == live.frame and live.is_whole and not live.reannealed:
        # Heard whole, so it need not be read.
        assert live.result is not None
        return Moment(frame, live.pose, None, live.records, live.result.layers, truth)
    stored = None if frame is None else opened.result(frame)
    if frame is not None and live.frame == frame and (live.reannealed or stored is None):
        beside = stored.estimate.pose if stored is not None and live.reannealed else None
        count = live.result.layers if live.result is not None else layers
        return Moment(frame, live.pose, beside, live.records, max(count, _layers_in(live.records)), truth)
    if frame is not None and stored is not None:
        records = opened.layers(frame)
        count = max(stored.layers, _layers_in(records))
        made = opened.pose_in(track, frame)
        if made is not None:
            return Moment(frame, made, stored.estimate.pose, records, count, truth, stored.tracking)
        return Moment(frame, stored.estimate.pose, None, records, count, truth, stored.tracking)
    records = [] if frame is None else opened.layers(frame)
    pose = records[-1].mean if records else opened.start_pose()
    return Moment(frame, pose, None, records, max(layers, _layers_in(records)), truth)


def _layers_in(records: Sequence[LayerRecord]) -> int:
    return max((record.layer for record in records), default=-1) + 1
