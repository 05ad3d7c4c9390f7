"""Distances between a body's markers by its dimensions, and which of them do not depend on the pose."""

import itertools
import math
from collections.abc import Mapping

import numpy as np

from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices

# Bend of joints in an ordinary standing posture, and the largest change by it of a distance that is measured
# standing.
STANDING_BEND = math.radians(15.0)
STANDING_CHANGE = 0.05

# Rounding: the relative change below which a distance is the same in all poses, and the slope below which a
# dimension is without effect.
SAME = 1e-9

# Replaces a distance of zero as divisor, mm.
TINY = 1e-6


class MarkerDistances:
    """The distances of a body's markers in its rest pose.

    The markers' positions are linear in the dimensions (each moves a part of the tree along a fixed
    direction), so one body a dimension gives all positions, distances and their exact slopes.

    names : its dimensions in mm (those that are not zero), start : their values, index : name to place.
    """

    def __init__(self, body: BodyModel) -> None:
        entries = body.definition.dimensions if body.definition else {}
        self.body = body
        lengths = [name for name, entry in entries.items() if entry.ratio is None]
        self.names = [name for name in lengths if body.dimensions[name] > 0.0]
        self.index = {name: place for place, name in enumerate(self.names)}
        self.start = np.array([body.dimensions[name] for name in self.names])
        self.markers = {marker.name: place for place, marker in enumerate(body.markers)}
        neutral = marker_points(body, body.neutral)[0]
        self._directions = np.zeros((len(self.names), *neutral.shape))
        for place, name in enumerate(self.names):
            longer = with_dimensions(body, {name: self.start[place] + 1.0})
            self._directions[place] = marker_points(longer, body.neutral)[0] - neutral
        self._origin = neutral - np.tensordot(self.start, self._directions, axes=1)

    def usable(
        self, lengths: Mapping[str, float], fixed: frozenset[str]
    ) -> tuple[dict[str, tuple[float, bool]], list[str]]:
        """The pairs that set dimensions: pair to (mm, whether no pose changes it), and notes on all others.

        fixed : dimensions that are given directly.
        """
        measured: dict[str, tuple[float, bool]] = {}
        notes: list[str] = []
        for pair, length in lengths.items():
            ignored = f"Length '{pair}' was ignored:"
            if self._ends(pair) is None:
                known = ", ".join(self.markers) or "none"
                notes.append(f"{ignored} it names no two markers of '{self.body.name}' ({known}).")
                continue
            change = self.change_by_pose(pair)
            slopes = self.slopes([pair], self.start)[0]
            free = [name for name in self.names if name not in fixed]
            if not any(slopes[self.index[name]] for name in free):
                notes.append(f"{ignored} no dimension sets it.")
            elif change > STANDING_CHANGE:
                notes.append(f"{ignored} it changes with the pose, no dimension sets it.")
            else:
                measured[pair] = (length, change < SAME)
                if change >= SAME:
                    notes.append(f"Length '{pair}' changes with the pose: it was read as measured standing.")
        return measured, notes

    def rigid(self) -> dict[str, float]:
        """All pairs whose distance no pose changes and some dimension sets, mm."""
        lengths: dict[str, float] = {}
        for one, two in itertools.combinations(self.markers, 2):
            pair = f"{one}_{two}"
            length = float(self.distances([pair], self.start)[0])
            if length > 0.0 and self.change_by_pose(pair) < SAME:
                lengths[pair] = length
        return lengths

    def distances(self, pairs: list[str], values: Array) -> Array:
        """(K,) mm of the pairs with these dimensions (mm, as `names`)."""
        return np.linalg.norm(self._across(pairs, values), axis=-1)

    def slopes(self, pairs: list[str], values: Array) -> Array:
        """(K, names) derivatives of the distances by the dimensions."""
        across = self._across(pairs, values)
        length = np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), TINY)
        ends = self._places(pairs)
        directions = self._directions[:, ends[:, 0]] - self._directions[:, ends[:, 1]]
        slopes = np.einsum("dkx,kx->kd", directions, across / length)
        return np.where(np.abs(slopes) < SAME, 0.0, slopes)

    def change_by_pose(self, pair: str) -> float:
        """The largest relative change of a distance when one angle bends by 15 degrees from the rest pose."""
        neutral = self.body.neutral
        angles = [place for place, entry in enumerate(self.body.parameters) if entry.kind == "angle"]
        poses = np.repeat(neutral[None], 1 + 2 * len(angles), axis=0)
        for row, (place, sign) in enumerate(itertools.product(angles, (1.0, -1.0)), 1):
            poses[row, place] += sign * STANDING_BEND
        ends = self._places([pair])[0]
        points = marker_points(self.body, poses)
        lengths = np.linalg.norm(points[:, ends[0]] - points[:, ends[1]], axis=-1)
        return float(np.abs(lengths - lengths[0]).max() / max(lengths[0], TINY))

    def _across(self, pairs: list[str], values: Array) -> Array:
        """(K, 3) vectors from the second to the first marker of each pair."""
        points = self._origin + np.tensordot(values, self._directions, axes=1)
        ends = self._places(pairs)
        return points[ends[:, 0]] - points[ends[:, 1]]

    def _places(self, pairs: list[str]) -> Indices:
        return np.array([self._ends(pair) for pair in pairs], dtype=np.int64)

    def _ends(self, pair: str) -> tuple[int, int] | None:
        """The places of the two markers that a pair names, None when it names no two of them."""
        for cut in (place for place, letter in enumerate(pair) if letter == "_"):
            one, two = pair[:cut], pair[cut + 1 :]
            if one in self.markers and two in self.markers and one != two:
                return self.markers[one], self.markers[two]
        return None
