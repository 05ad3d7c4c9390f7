"""Which pictures of several cameras belong together, by their times.

Pictures with one number belong together only as long as all cameras keep one rate and lose none. 59.94 beside 60 a
second is 3.6 frames apart after a minute; a lost frame puts a camera one ahead of the others from there on.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array

APART = 0.5
"""Pictures with one number that lie further apart, in frames, do not belong together."""
LOST = 1.5
"""A step between two time stamps of so many frames or more is a lost one."""
MOST_NAMED = 4
TOGETHER = 2
"""A single late stamp puts nothing out of step: so many frames must lie apart."""
Steps = tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Drift:
    """How far a camera's pictures come to lie from the others' of the same number. first : the frame from which on
    it is more than half a frame, -1 for none. most : the largest distance, frames; behind where positive. fps : its
    own rate. others : that of most cameras. lost : (frame, how many) before which frames were lost.
    """

    camera: str
    first: int
    most: float
    fps: float
    others: float
    lost: tuple[tuple[int, int], ...]

    def words(self, fps: float) -> str:
        """What happened, a sentence. fps : the session's."""
        sentences: list[str] = []
        if self.lost:
            places = [
                f"{count} before frame {frame} ({frame / fps:.2f} s)"
                for frame, count in self.lost[:MOST_NAMED]
            ]
            more = f" and at {len(self.lost) - MOST_NAMED} more places" if len(self.lost) > MOST_NAMED else ""
            sentences.append(f"Camera {self.camera} lost frames: {', '.join(places)}{more}")
        if self.first >= 0:
            how = "later" if self.most > 0.0 else "earlier"
            rate = "" if self.lost else f" ({self.fps:.5g} against {self.others:.5g} a second)"
            who = "its pictures" if self.lost else f"The pictures of camera {self.camera}"
            since = f"from frame {self.first} ({self.first / fps:.2f} s) on by more than half a frame"
            sentences.append(
                f"{who} are up to {abs(self.most):.1f} frames {how} than those of the same number in the"
                f" others{rate}, {since}"
            )
        return "; ".join(sentences) + "."


def drifts(times: Mapping[str, Array], fps: float) -> tuple[Drift, ...]:
    """The cameras whose pictures of one number do not belong to the others', or that lost frames.

    times : seconds of each camera's frames, from the session's frame 0 on. fps : the session's.
    """
    if len(times) < 2:
        return ()
    count = min(map(len, times.values()))
    since = {name: moments[:count] - moments[0] for name, moments in times.items()}
    lost = {name: _gaps_of(moments) for name, moments in since.items()}
    common = _common(since, lost)
    drifting: list[Drift] = []
    for name, moments in since.items():
        late = (moments - common) * fps
        off = np.flatnonzero(np.abs(late) > APART)
        apart = len(off) >= min(TOGETHER, count)
        if not apart and not lost[name]:
            continue
        most = float(late[np.argmax(np.abs(late))]) if apart else 0.0
        rates = (_rate(moments, fps), _rate(common, fps))
        drifting.append(Drift(name, int(off[0]) if apart else -1, most, *rates, lost[name]))
    return tuple(drifting)


def _rate(moments: Array, fps: float) -> float:
    return (len(moments) - 1) / float(moments[-1]) if len(moments) > 1 and moments[-1] > 0.0 else fps


def paired_by_time(times: Mapping[str, Array], fps: float) -> tuple[dict[str, Steps], int]:
    """For each camera what makes its file's frame of the session's: (frame, so many further) from that frame on; and
    the number of frames that all cameras have.

    The picture nearest in time is taken: of a camera that lost one its neighbour twice, of a faster one some never.
    """
    since = {name: moments - moments[0] for name, moments in times.items()}
    count = 1 + int(np.floor(min(float(moments[-1]) for moments in since.values()) * fps + APART - 1e-6))
    wanted = np.arange(count) / fps
    steps: dict[str, Steps] = {}
    for name, moments in since.items():
        after = np.clip(np.searchsorted(moments, wanted), 1, max(1, len(moments) - 1))
        before = after - 1
        nearest = np.where(
            len(moments) > 1
            and (wanted - moments[before] <= moments[np.minimum(after, len(moments) - 1)] - wanted),
            before,
            np.minimum(after, len(moments) - 1),
        )
        further = nearest - np.arange(count)
        changes = np.flatnonzero(np.diff(further, prepend=0))
        steps[name] = tuple((int(frame), int(further[frame])) for frame in changes)
    return steps, count


def _gaps_of(moments: Array) -> tuple[tuple[int, int], ...]:
    """(frame, how many) of the gaps before frames."""
    steps = np.diff(moments)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual <= 0.0:
        return ()
    return tuple(
        (int(at) + 1, round(float(steps[at] / usual)) - 1) for at in np.flatnonzero(steps >= LOST * usual)
    )


def _common(since: Mapping[str, Array], lost: Mapping[str, tuple[tuple[int, int], ...]]) -> Array:
    """(F,) the times that most cameras have: of several their median, of two those of the one that lost less."""
    if len(since) > 2:
        return np.median(np.stack(list(since.values())), axis=0)
    fewest = min(since, key=lambda name: sum(count for _, count in lost[name]))
    return since[fewest]


def file_frame(steps: Steps, frame: int) -> int:
    """The frame of the file, from its offset on, of a frame of the session."""
    further = 0
    for first, by in steps if len(steps) < FEW_STEPS else _around(steps, frame):
        if first > frame:
            break
        further = by
    return frame + further


FEW_STEPS = 16


def _around(steps: Steps, frame: int) -> Steps:
    """The last step up to a frame."""
    low, high = 0, len(steps)
    while low < high:
        middle = (low + high) // 2
        if steps[middle][0] <= frame:
            low = middle + 1
        else:
            high = middle
    return steps[max(0, low - 1) : low]
