"""Whether a frame fits, and which of its limbs are lost: the timeline, the badge over the scene, the heat map of limbs
and the view `why` all read it here, so that none contradicts another.

Two sources have a say. The truth: a limb is lost where one of its markers is farther off than `lost_mm`, in the track
that is shown. The silhouettes: as the search stored it with the frame, of the pose that it kept.
"""

import math
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from cachetools import LRUCache

from studio.body.model import BodyModel
from studio.foundations.errors import NotFoundError
from studio.results.inspection.reference import limb_group
from studio.search.trackers.tracker import LIMB_LOST, LOST, NO_EVIDENCE, RECOVERED, TRACKED, FrameResult
from studio.sessions.results_reader import ResultsReader, Timeline

KEPT_RUNS = 64


@dataclass(frozen=True, slots=True)
class Verdict:
    """tracking : one of TRACKING_STATES. by_silhouettes, by_truth : limbs that are lost."""

    tracking: str
    by_silhouettes: tuple[str, ...] = ()
    by_truth: tuple[str, ...] = ()

    @property
    def lost(self) -> tuple[str, ...]:
        """The lost limbs, by either."""
        return tuple(dict.fromkeys((*self.by_truth, *self.by_silhouettes)))

    @property
    def fits(self) -> bool:
        """Whether nothing says that the body or a limb of it is lost."""
        return self.tracking in (TRACKED, RECOVERED) and not self.lost

    def lost_by(self, limb: str) -> str:
        """Which of truth and silhouettes says that a limb is lost, in words; "" for neither."""
        sources = {"truth": self.by_truth, "silhouettes": self.by_silhouettes}
        return " and ".join(source for source, limbs in sources.items() if limb in limbs)


def verdict(tracking: str, by_silhouettes: Iterable[str], by_truth: Iterable[str] = ()) -> Verdict:
    """The verdict on a frame. tracking : the state that the search stored. A limb that the silhouettes contradict is
    more to say than that the frame was tracked or the body found again.
    """
    limbs = tuple(by_silhouettes)
    is_followed = tracking in (TRACKED, RECOVERED)
    return Verdict(LIMB_LOST if limbs and is_followed else tracking, limbs, tuple(by_truth))


def limbs_off(result: FrameResult, body: BodyModel | None = None) -> tuple[str, ...]:
    """The limbs of a stored frame that the silhouettes contradict; () where nothing was seen. body : by which limbs are
    counted together, such as head and trunk.
    """
    if result.tracking == NO_EVIDENCE or _is_settled(result.tracking, result.overlap, result.doubts):
        return ()
    names = result.limbs_lost
    if not names and result.tracking == LIMB_LOST and result.disagreement:
        # Stored when the limit was another one: what was said then holds.
        names = (max(result.disagreement, key=lambda limb: result.disagreement[limb]),)
    return tuple(dict.fromkeys(name if body is None else limb_group(body, name) for name in names))


def verdict_on(result: FrameResult, by_truth: Iterable[str] = (), body: BodyModel | None = None) -> Verdict:
    """The verdict on a stored frame. body : as in `limbs_off`."""
    return verdict(result.tracking, limbs_off(result, body), by_truth)


def verdicts(
    results: ResultsReader,
    folder: Path,
    line: Timeline,
    by_truth: dict[int, tuple[str, ...]],
    body: BodyModel,
) -> dict[int, Verdict]:
    """By frame the verdict on a run. line : its timeline. by_truth : lost limbs by frame. Results are read of those
    frames only in which there can be a lost limb, and once.
    """
    limbs = _known.limbs(results, folder, line, body)
    return {
        frame: verdict(state, limbs.get(frame, ()), by_truth.get(frame, ()))
        for frame, state in zip(line.frames.tolist(), line.tracking, strict=True)
    }


def _is_settled(tracking: str, overlap: float, doubts: int) -> bool:
    """Whether the search itself found, when it watched for losses, that no limb is lost."""
    return tracking == TRACKED and not doubts and not math.isnan(overlap)


class _KnownLimbs:
    """The lost limbs of frames that were read. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._runs = LRUCache[Path, dict[int, tuple[object, tuple[str, ...]]]](KEPT_RUNS)

    def limbs(
        self, results: ResultsReader, folder: Path, line: Timeline, body: BodyModel
    ) -> dict[int, tuple[str, ...]]:
        """By frame the limbs that the silhouettes contradict; frames without any may be missing."""
        with self._lock:
            before = self._runs.get(folder, {})
        by_frame: dict[int, tuple[object, tuple[str, ...]]] = {}
        for at, frame in enumerate(line.frames.tolist()):
            state, overlap, doubts = line.tracking[at], float(line.overlaps[at]), int(line.doubts[at])
            if state == NO_EVIDENCE or _is_settled(state, overlap, doubts):
                continue
            stamp = (state, doubts, float(line.log_weights[at]), float(line.milliseconds[at]))
            if frame in before and before[frame][0] == stamp:
                by_frame[frame] = before[frame]
                continue
            try:
                by_frame[frame] = (stamp, limbs_off(results.result(frame), body))
            except NotFoundError:
                continue
        with self._lock:
            self._runs[folder] = by_frame
        return {frame: limbs for frame, (_, limbs) in by_frame.items()}


_known = _KnownLimbs()

STATE_WORDS = {
    LOST: "The search had lost the body in this frame.",
    NO_EVIDENCE: "No picture shows a body in this frame: the pose of the frame before is kept.",
}
"""Sentences on the states in which the body as a whole is lost."""
