"""How the particles of one layer become those of the next: from whose places they come, which ones leave nothing.

A layer's record keeps for every particle of the next layer which ones it was drawn from. A child of two takes each limb
from one of them: it sets out from the parent whose limb ends nearer to its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.app.scene import METRES_PER_MM
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices
from studio.search.trackers.tracker import NO_PARENT, LayerRecord

FAR_END = 1
TRAVEL_SHARE = 0.75
"""Of a layer's time in which its particles travel; then they rest."""


@dataclass(frozen=True, slots=True, eq=False)
class Journey:
    """A layer's particles on their way.

    start, end : (N, L, 2, 3) metres, both ends of the drawn limbs of each particle; one whose parents are not known
    starts where it ends. dead : (K, L, 2, 3) of the particles of the layer before from which none was drawn.
    """

    start: Array
    end: Array
    dead: Array

    def at(self, share: float) -> Array:
        """(N, L, 2, 3) metres: where the particles are after a share 0..1 of the way."""
        return self.end if share >= 1.0 else self.start + share * (self.end - self.start)


class Journeys:
    """The journeys of a frame's layers; what was computed of a record is kept while the frame is shown."""

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        self._places: dict[int, tuple[LayerRecord, Array]] = {}
        self._kept: tuple[tuple[LayerRecord | None, LayerRecord], Journey] | None = None

    def places(self, record: LayerRecord) -> Array:
        """(N, L, 2, 3) metres: both ends of the drawn limbs of a layer's particles."""
        stored = self._places.get(record.layer)
        if stored is None or stored[0] is not record:
            ends = limb_ends(self._body, np.ascontiguousarray(record.poses, dtype=np.float64))
            stored = self._places[record.layer] = record, ends * METRES_PER_MM
        return stored[1]

    def to(self, record: LayerRecord, before: LayerRecord | None) -> Journey:
        """The journey to a layer from the one before it (None: there is none)."""
        if self._kept is None or self._kept[0] != (before, record):
            end = self.places(record)
            if before is None:
                way = Journey(end, end, np.zeros((0, *end.shape[1:])))
            else:
                way = journey(self.places(before), end, parent_rows(before, record))
            self._kept = (before, record), way
        return self._kept[1]


def journey(before: Array, after: Array, parents: Indices) -> Journey:
    """The journey between places (M, L, 2, 3) and (N, L, 2, 3). parents : (2, N) rows of `before`."""
    if not len(before) or not (parents != NO_PARENT).any():
        return Journey(after, after, np.zeros((0, *after.shape[1:])))
    first, second = before[parents[0]], before[parents[1]]
    ways = [np.linalg.norm((place - after)[:, :, FAR_END], axis=-1) for place in (first, second)]
    is_second = (parents[1] != NO_PARENT)[:, None] & (ways[1] < ways[0])
    start = np.where(is_second[:, :, None, None], second, first)
    start = np.where((parents[0] == NO_PARENT)[:, None, None, None], after, start)
    is_dead = np.ones(len(before), dtype=bool)
    is_dead[parents[parents != NO_PARENT]] = False
    return Journey(start, after, before[is_dead])


def parent_rows(before: LayerRecord, after: LayerRecord) -> Indices:
    """(2, N) for each row of a layer which rows of the layer before it was drawn from: both parents, NO_PARENT where
    there is none, it was not kept, or the layers belong to different searches.
    """
    count = len(after.poses)
    nothing = np.full((2, count), NO_PARENT)
    numbers = after.rows if len(after.rows) else np.arange(count)
    if before.layer + 1 != after.layer or not before.parents.shape[1] or not count:
        return nothing
    if numbers.max() >= before.parents.shape[1]:
        return nothing
    drawn = before.parents[:, numbers]
    if not len(before.rows):
        return np.where(drawn < len(before.poses), drawn, NO_PARENT)
    row_of = np.full(max(int(before.rows.max()), int(drawn.max())) + 1, NO_PARENT)
    row_of[before.rows] = np.arange(len(before.rows))
    return np.where(drawn == NO_PARENT, NO_PARENT, row_of[drawn])


def lines_back(records: Sequence[LayerRecord]) -> list[Indices]:
    """For each layer (N,) the rows that the particles of the last one of `records` come from by their first parents;
    NO_PARENT where the line is not known any more.
    """
    if not records:
        return []
    lines = [np.arange(len(records[-1].poses))]
    for before, after in zip(reversed(records[:-1]), reversed(records[1:]), strict=True):
        first = parent_rows(before, after)[0]
        lines.insert(
            0, np.where(lines[0] == NO_PARENT, NO_PARENT, first[lines[0]]) if len(first) else lines[0]
        )
    return lines


def travelled(phase: float) -> float:
    """The share of its way that a particle has travelled after a share of the layer's time, eased at both ends."""
    share = min(1.0, max(0.0, phase / TRAVEL_SHARE))
    return share * share * (3.0 - 2.0 * share)


def glow(record: LayerRecord) -> Array:
    """(N,) 0..1 how much each particle counts: its weight at the layer's β beside the heaviest one's; where there is no
    β its place between the lowest and the highest log-weight.
    """
    weights = record.log_weights
    finite = np.isfinite(weights)
    if not finite.any():
        return np.zeros_like(weights)
    highest = weights[finite].max()
    if np.isfinite(record.beta):
        return np.where(finite, np.exp(record.beta * (weights - highest)), 0.0)
    spread = highest - weights[finite].min()
    return np.where(finite, (weights - highest) / spread + 1.0 if spread > 0.0 else 1.0, 0.0)
