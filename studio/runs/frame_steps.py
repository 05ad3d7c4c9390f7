"""The start of a search after dropped frames.

σ0 and the last movement (Eq. 10 of Deutscher & Reid 2005) are given from one frame to the next. σ0 is a share of the
largest movement expected in the time between two frames (`search_space.default_sigma`), so over k frames it is k times
as large: a run that drops every second frame searches as one of footage at half the rate does. The last movement is
scaled to the number of frames ahead; a behaviour model propagates once a frame (`SearchSpace.steps`).
"""

import dataclasses
from collections.abc import Sequence

from studio.search.trackers.tracker import FilterState, FrameResult, SearchSpace, start_of
from studio.sessions.results_reader import ResultsReader
from studio.sessions.run_record import RunRecord

LONGEST_SECONDS = 0.25
"""Limbs swing: after a longer time than this a body is no further from where it was."""


def steps_between(before: int | None, frame: int, fps: float) -> int:
    """Frames from the last tracked one to the next one, 1 in a run's first; at most LONGEST_SECONDS."""
    if before is None:
        return 1
    return max(1, min(frame - before, round(LONGEST_SECONDS * fps)))


def space_over(space: SearchSpace, steps: int) -> SearchSpace:
    """The search space of a frame `steps` frames after the last tracked one."""
    if steps == 1:
        return space
    return dataclasses.replace(space, sigma=steps * space.sigma, steps=steps)


def carried_over(carried: FilterState, steps: int, steps_before: int) -> FilterState:
    """The last frame's state with its last movement scaled from `steps_before` frames to `steps`."""
    last, before = carried.estimate, carried.previous_estimate
    if steps == steps_before or last is None or before is None:
        return carried
    return dataclasses.replace(carried, previous_estimate=last - (last - before) * (steps / steps_before))


class FrameHistory:
    """The state that each frame of a run starts from. results : of the run. tracked : its finished frames, ascending.

    The last frames are kept in memory, so that a live run may store them a little later.
    """

    def __init__(self, results: ResultsReader, record: RunRecord, tracked: Sequence[int]) -> None:
        self._results, self._record = results, record
        self._recent = tuple(tracked[-2:])
        self._carried: tuple[int, FilterState] | None = None

    def stored(self, result: FrameResult) -> None:
        """Add the next finished frame."""
        self._carried = (result.frame, result.carried)
        self._recent = (*self._recent[-1:], result.frame)

    def is_first(self, frame: int) -> bool:
        """Whether the search begins here: no earlier frame was tracked, or this one was corrected."""
        return frame == self._record.corrected or self._before(frame)[0] is None

    def steps_to(self, frame: int) -> int:
        """Frames since the previously tracked one."""
        if self._record.is_restarted(frame):
            return 1
        return steps_between(self._before(frame)[0], frame, self._record.fps)

    def into(self, frame: int) -> FilterState:
        """The state that a frame starts from: the result of the frame tracked before; in a run's first frame its start
        pose; in a corrected frame the given pose; when tracking backwards, the result of the frame after it.
        """
        if frame == self._record.corrected:
            return start_of(self._record.corrected_pose)
        if self._record.is_restarted(frame) and self._results.last_before(frame + 2) == frame + 1:
            return self._results.result(frame + 1).carried
        before, second = self._before(frame)
        if before is None:
            return start_of(self._record.start_pose)
        if self._carried is None or self._carried[0] != before:
            self._carried = (before, self._results.result(before).carried)
        steps_before = steps_between(second, before, self._record.fps)
        return carried_over(self._carried[1], self.steps_to(frame), steps_before)

    def _before(self, frame: int) -> tuple[int | None, int | None]:
        """The last two frames tracked before this one."""
        if self._recent and self._recent[-1] < frame:
            return self._recent[-1], self._recent[-2] if len(self._recent) > 1 else None
        before = self._results.last_before(frame)
        return before, None if before is None else self._results.last_before(before)
