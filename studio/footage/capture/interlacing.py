"""Interlaced video: each picture holds two fields, taken one after the other in its even and odd lines.

Which of the two is the earlier follows from what moves, as files mark it wrongly or not at all: the later field of a
picture is one step from the earlier one of the next, the earlier field three from the later one of the next.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from studio.foundations.arrays import Array, Bytes

Fields = Literal["", "top", "bottom"]
"""Which field is the earlier: that of the lines 0, 2, 4 … ("top") or the other; "" for pictures of one moment."""
MOVED, ABOVE_NOISE = 12.0, 6.0
"""Grey levels by which a pixel has to change between two pictures to count as moving, and times the usual change."""
FEWEST_MOVED = 20
"""Moving pixels that a pair of pictures needs to say something."""
COLUMNS = 4
"""So many columns are taken together: less noise, and the lines stay what they are."""
CLEAR, CLEAR_IF_MARKED = 0.1, 0.08
"""Of the distances to the third field away and to the next, (d3 - d1) / (d3 + d1) is 0.5 for even motion and 0 for
pictures of one moment: from here on it is clear for a video, and for one whose file says so."""
SAME_MOMENT = 0.5
"""The same of the next picture's field and of the picture's own other one: near 1 where that is of the same moment
(of 15 real cameras 0.41 to 0.89), 0.07 to 0.35 where their pictures were woven of two."""
FIELDS_ALREADY = 0.75
"""Times of more than this share of the fields are theirs; of their pictures there are half as many."""
FEWEST_PAIRS, AGREEING = 3, 0.75
"""Pairs of pictures in which something moves, and the share of them that has to speak for the same order."""


@dataclass(slots=True)
class FieldMotion:
    """What pairs of neighbouring pictures say about their fields. shares : (d3 - d1) / (d3 + d1) of each pair as if the
    top field were the earlier. within : how much nearer the fields of a picture are to each other than to its
    neighbour's.
    """

    shares: list[float] = field(default_factory=list[float])
    within: list[float] = field(default_factory=list[float])

    def compare(self, before: Bytes, after: Bytes) -> None:
        """Take in two neighbouring pictures (H, W) uint8, grey."""
        lines = min(len(before), len(after)) // 2 * 2 - 1
        if lines < 3 or min(before.shape[1], after.shape[1]) < COLUMNS:
            return
        first, second = _columns(before), _columns(after)
        odd = slice(1, lines - 1, 2)
        change = np.abs(first - second)[odd]
        moving = change > max(MOVED, ABOVE_NOISE * float(np.median(change)))
        if np.count_nonzero(moving) < FEWEST_MOVED:
            return
        near = float(np.abs(first[odd] - _between(second, lines))[moving].sum())
        far = float(np.abs(second[odd] - _between(first, lines))[moving].sum())
        own = float(np.abs(first[odd] - _between(first, lines))[moving].sum())
        if min(near, far) > 0.0:
            self.shares.append((far - near) / (near + far))
            self.within.append((min(near, far) - own) / (min(near, far) + own))

    def decide(self, marked: bool) -> tuple[bool, Fields]:
        """Whether the pictures are of two moments, and which field is the earlier, "" where that is not known. marked :
        whether the file says that they are.
        """
        if len(self.shares) < FEWEST_PAIRS:
            return marked, ""
        shares = np.array(self.shares)
        typical = float(np.median(shares))
        agreeing = np.count_nonzero(shares * typical > 0.0) / len(shares)
        one_moment = float(np.median(self.within)) >= SAME_MOMENT
        if not one_moment and abs(typical) >= (CLEAR_IF_MARKED if marked else CLEAR) and agreeing >= AGREEING:
            return True, "top" if typical > 0.0 else "bottom"
        return marked and not one_moment, ""


def _columns(picture: Bytes) -> Array:
    """(H, W / COLUMNS) means of neighbouring columns."""
    height, width = picture.shape[0], picture.shape[1] // COLUMNS
    return picture[:, : width * COLUMNS].reshape(height, width, COLUMNS).mean(axis=2)


def _between(picture: Array, lines: int) -> Array:
    """What the even lines say of the odd ones."""
    return (picture[0 : lines - 2 : 2] + picture[2:lines:2]) / 2.0


def whole_picture(half: Bytes, below: bool, height: int) -> Bytes:
    """(height, W, 3) uint8 of a field (height / 2, W, 3): its own lines where they are, those between as the mean of
    their neighbours. below : whether it is that of the lines 1, 3, 5 …
    """
    whole = np.empty((height, *half.shape[1:]), np.uint8)
    start = int(below)
    whole[start::2] = half
    means = ((half[:-1].astype(np.uint16) + half[1:] + 1) // 2).astype(np.uint8)
    whole[start + 1 : start + 2 * len(half) - 1 : 2] = means
    whole[:start] = half[0]
    whole[start + 2 * len(half) - 1 :] = half[-1]
    return whole


def times_of_fields(times: Array, count: int) -> Array:
    """(2F,) seconds of the fields of pictures at (F,) times: a picture's second field is half a step after it. Times
    that are of fields already stay. count : of the fields.
    """
    if not len(times) or len(times) > FIELDS_ALREADY * count:
        return times
    steps = np.diff(times)
    # A picture that was lost leaves a gap behind the field before it, not a later field.
    usual = float(np.median(steps)) if len(steps) else 0.0
    halves = np.minimum(np.append(steps, usual), usual) / 2.0
    return np.stack([times, times + halves], axis=1).ravel()
