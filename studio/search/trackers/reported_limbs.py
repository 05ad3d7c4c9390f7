"""Limbs whose place a source beside the silhouettes reports, as a network does that knows people.

Asking takes long, so it is done in a run's first frame and every few frames, not where all limbs show by themselves,
and sooner again while one is reported lost. A limb that is reported elsewhere is drawn over its whole range
(`limb_resampling.drawn_where_reported`); of the draws whose markers come nearest to the reported places those that the
silhouettes deny least are refined. One is kept if its markers then are at these places and the silhouettes agree with
it about as well as before, or if it is nearer and they agree clearly better.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, Bytes
from studio.search.trackers.limbs_elsewhere import Elsewhere, is_shown
from studio.search.trackers.tracker import MOVED

REPORTED = f"{MOVED}reported"
"""Memory: (1 + G,) frames since the source was asked; 1 for each limb that was then lost."""
SOONER = 3
"""Frames until the source is asked again while a limb is reported lost."""
THERE_MM = 80.0
"""mm at a person's size: nearer, on the mean, a limb's markers are at the reported places."""


@dataclass(frozen=True, slots=True, eq=False)
class ReportedLimb:
    """A limb that is reported to be elsewhere. markers : (M,) rows of the body's markers on it. places : (M, 3) mm,
    where these are. belief : 0 to 1, in that. is_lost : whether it is so far from there, and that so sure, that it is
    named; any other is looked for only.
    """

    markers: Sequence[int]
    places: Array
    belief: float = 1.0
    is_lost: bool = True


class LimbSource(Protocol):
    """Reports where limbs are. limbs : of which it knows."""

    @property
    def limbs(self) -> Sequence[str]: ...

    def elsewhere(self, pose: Array, pictures: Mapping[str, Bytes]) -> Mapping[str, ReportedLimb]:
        """The limbs of a pose (D,) that are elsewhere. pictures : (H, W, 3), BGR, by camera."""
        ...


def is_asked(every: int, memory: Mapping[str, Array]) -> bool:
    """Whether the source is asked in a frame: in the first one, and then. every : frames, 0 for never. memory : at the
    frame's start.
    """
    since, *lost = memory.get(REPORTED, [float(every)])
    return 0 < (min(every, SOONER) if any(lost) else every) <= since + 1.0


def reported_limbs(
    source: LimbSource, pose: Array, pictures: Mapping[str, Bytes], shown: Mapping[str, Elsewhere]
) -> dict[str, ReportedLimb]:
    """The limbs of a pose (D,) that are reported elsewhere and do not show by themselves where it has them; the source
    is not asked where all show. pictures : (H, W, 3), BGR, by camera. shown : by limb how it shows in them.
    """
    if not hidden_of(source.limbs, shown):
        return {}
    reported = source.elsewhere(pose, pictures)
    return {limb: reported[limb] for limb in hidden_of(reported, shown)}


def hidden_of(limbs: Collection[str], shown: Mapping[str, Elsewhere]) -> list[str]:
    """Those of some limbs that do not show by themselves where the pose has them: an arm that is held out explains what
    changed there, whatever is reported of it.
    """
    return [limb for limb in limbs if limb not in shown or not is_shown(shown[limb])]


def reported_lost(body: BodyModel, pose: Array, reported: Mapping[str, ReportedLimb]) -> list[str]:
    """The reported limbs that are named lost in a pose (D,): not at the reported places."""
    return [
        limb
        for limb, one in reported.items()
        if one.is_lost and float(off_from(body, pose[None], one)[0]) > THERE_MM
    ]


def off_from(body: BodyModel, poses: Array, reported: ReportedLimb) -> Array:
    """(N,) mm at a person's size by which a limb's markers are off from the reported places, on the mean, in poses
    (N, D).
    """
    apart = marker_points(body, poses)[:, list(reported.markers)] - reported.places
    return np.linalg.norm(apart, axis=2).mean(axis=1) / scale_of(body)


def remembered(limbs: Sequence[str], lost: Collection[str]) -> Array:
    """What is remembered (`REPORTED`) of a frame in which the source was asked. limbs : all. lost : of them."""
    return np.array([0.0, *(float(limb in lost) for limb in limbs)])


def remembered_longer(limbs: Sequence[str], memory: Mapping[str, Array]) -> Array:
    """The same of a frame in which it was not. memory : at the frame's start."""
    before = memory.get(REPORTED, np.zeros(1 + len(limbs)))
    return np.concatenate([before[:1] + 1.0, before[1:]])


def last_lost(limbs: Sequence[str], memory: Mapping[str, Array]) -> list[str]:
    """Those of all limbs that were lost when the source was last asked."""
    known = memory.get(REPORTED, np.zeros(1 + len(limbs)))[1:]
    return [limb for limb, one in zip(limbs, known, strict=True) if one]
