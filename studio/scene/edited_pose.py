"""A pose under a person's hands: what it was, what it is, and the way between."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REMEMBERED = 200


class EditedPose:
    """original : (D,) where `reset` goes back to. pose : (D,) as it is now. Used by one thread at a time."""

    def __init__(self, pose: Array) -> None:
        self.original = pose.copy()
        self.pose = pose.copy()
        self._past: deque[Array] = deque(maxlen=REMEMBERED)
        self._hand = ""

    @property
    def is_moved(self) -> bool:
        """Whether it is another pose than the original."""
        return not np.array_equal(self.pose, self.original)

    @property
    def can_undo(self) -> bool:
        """Whether there is something to be undone."""
        return bool(self._past)

    def put(self, pose: Array, hand: str = "") -> None:
        """Take a pose. hand : what moves it; all that the same one does without a `settle` between is undone at once
        ("" : each on its own).
        """
        if np.array_equal(pose, self.pose):
            return
        if not hand or hand != self._hand:
            self._past.append(self.pose)
        self._hand = hand
        self.pose = np.array(pose, dtype=np.float64)

    def settle(self) -> None:
        """The hand has let go: what comes next is undone by itself."""
        self._hand = ""

    def undo(self) -> None:
        """Go back by one change, if there was one."""
        self._hand = ""
        if self._past:
            self.pose = self._past.pop()

    def reset(self) -> None:
        """Go back to the original; that can be undone."""
        self.put(self.original)

    def saved(self) -> None:
        """The pose was stored: it is the original now."""
        self.original = self.pose.copy()
