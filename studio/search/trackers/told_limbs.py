"""Limbs whose place a source beside the silhouettes tells, as a network does that knows people.

Asking takes long, so it is done in a run's first frame and every few frames, not where all limbs show by themselves,
and sooner again while one is said to be lost. A limb that is elsewhere is drawn over its whole range
(`frame_refinement.drawn_where_told`); of the draws whose markers come nearest to the places told those that the
silhouettes deny least are refined. One is kept if its markers then are where they are told to be and the silhouettes
agree with it about as well as before, or if it is nearer and they agree clearly better.
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

TOLD = f"{MOVED}told"
"""Memory: (1 + G,) frames since it was asked; 1 for each limb that was last said to be lost."""
SOONER = 3
"""Frames until it is asked again while a limb is said to be lost."""
THERE_MM = 80.0
"""mm at a person's size: nearer, on the mean, a limb's markers are where they are told to be."""


@dataclass(frozen=True, slots=True, eq=False)
class ToldLimb:
    """A limb that is told to be elsewhere. markers : (M,) rows of the body's markers on it. places : (M, 3) mm, where
    these are. belief : 0 to 1, in that. is_lost : whether it is so far from there, and that so sure, that it is named;
    any other is looked for only.
    """

    markers: Sequence[int]
    places: Array
    belief: float = 1.0
    is_lost: bool = True


class LimbTeller(Protocol):
    """Who tells where limbs are. limbs : of which it knows."""

    @property
    def limbs(self) -> Sequence[str]: ...

    def lost(self, pose: Array, pictures: Mapping[str, Bytes]) -> Mapping[str, ToldLimb]:
        """The limbs of a pose (D,) that are elsewhere. pictures : (H, W, 3), BGR, by camera."""
        ...


def is_asked(every: int, memory: Mapping[str, Array]) -> bool:
    """Whether it is asked in a frame: in the first one, and then. every : frames, 0 for never. memory : at the frame's
    start.
    """
    since, *elsewhere = memory.get(TOLD, [float(every)])
    return 0 < (min(every, SOONER) if any(elsewhere) else every) <= since + 1.0


def told_memory(body: BodyModel, pose: Array, limbs: Sequence[str], told: Mapping[str, ToldLimb]) -> Array:
    """What is remembered (`TOLD`) of a frame in which it was asked and that ended with a pose (D,). limbs : all."""
    lost = {
        limb for limb, one in told.items() if one.is_lost and off_from(body, pose[None], one)[0] > THERE_MM
    }
    return np.array([0.0, *(float(limb in lost) for limb in limbs)])


def not_asked(limbs: Sequence[str], memory: Mapping[str, Array]) -> Array:
    """The same of a frame in which it was not. memory : at the frame's start."""
    before = memory.get(TOLD, np.zeros(1 + len(limbs)))
    return np.concatenate([before[:1] + 1.0, before[1:]])


def elsewhere_still(limbs: Sequence[str], memory: Mapping[str, Array]) -> list[str]:
    """Those of all limbs that were last said to be lost and have not been found."""
    known = memory.get(TOLD, np.zeros(1 + len(limbs)))[1:]
    return [limb for limb, one in zip(limbs, known, strict=True) if one]


def limbs_told(
    teller: LimbTeller, pose: Array, pictures: Mapping[str, Bytes], shown: Mapping[str, Elsewhere]
) -> dict[str, ToldLimb]:
    """The limbs of a pose (D,) that are told to be elsewhere and do not show by themselves where it has them; the
    teller is not asked where all show. pictures : (H, W, 3), BGR, by camera. shown : by limb how it shows in them.
    """
    if not missed(teller.limbs, shown):
        return {}
    told = teller.lost(pose, pictures)
    return {limb: told[limb] for limb in missed(told, shown)}


def missed(limbs: Collection[str], shown: Mapping[str, Elsewhere]) -> list[str]:
    """Of limbs that are said to be elsewhere those that do not show by themselves where the pose has them: an arm that
    is held out explains what changed there, whatever is said of it.
    """
    return [limb for limb in limbs if limb not in shown or not is_shown(shown[limb])]


def off_from(body: BodyModel, poses: Array, told: ToldLimb) -> Array:
    """(N,) mm at a person's size by which a limb's markers are off from where they are told to be, on the mean, in
    poses (N, D).
    """
    apart = marker_points(body, poses)[:, list(told.markers)] - told.places
    return np.linalg.norm(apart, axis=2).mean(axis=1) / scale_of(body)
