"""What a file of markers means by its axes: heads are above feet, whatever the file calls up.

A TRC names no axes. OpenSim's has Y up; QTM, Nexus and many converters write theirs with Z up.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import TruthError
from studio.foundations.geometry.worlds import WORLDS

if TYPE_CHECKING:
    from studio.body.motion_files.trc import MarkerMotion

HIGH = ("head", "nose", "neck", "c7", "ear", "eye", "lfhd", "rfhd", "lbhd", "rbhd", "hdtop")
LOW = ("ankle", "heel", "toe", "foot", "ank", "lhee", "rhee", "ltoe", "rtoe", "calc", "mt5", "mt1")
ON_THE_FLOOR = 0.35
"""Feet are at 0 within this share of the way from feet to head."""
CLEAR = 0.8
"""Cosine with an axis from which on the way from feet to head is along it, in the median of the frames."""


def turned_up(path: Path, motion: "MarkerMotion", up: str, usual: str) -> "MarkerMotion":
    """The motion with z up. motion : in the file's axes. up : the axis that points up, "" as the markers show it.
    usual : the format's, where nothing shows it. Raises TruthError for no axis.
    """
    if up and up not in WORLDS:
        raise TruthError(f"'{up}' is no axis that could point up.", f"Write one of {', '.join(WORLDS)}.")
    seen = up_of_markers(motion.names, motion.positions)
    taken = up or seen or usual
    notes = motion.notes
    if not up and taken != usual:
        notes = (
            *notes,
            f"'{path.name}' has its heads above its feet along {taken}: taken for up instead of {usual} (--truth-up).",
        )
    turned = motion.positions @ np.array(WORLDS[taken], dtype=np.float64).T
    return replace(motion, positions=turned, notes=notes)


def up_of_markers(names: Sequence[str], positions: Array) -> str:
    """The axis along which heads are above feet in most frames and feet are at 0, "" where names or places do not show
    it: who lies has the feet anywhere.

    positions : (F, M, 3), NaN where missing.
    """
    high, low = ([at for at, name in enumerate(names) if _is(name, parts)] for parts in (HIGH, LOW))
    if not high or not low:
        return ""
    feet = _middle(positions[:, low])
    upward = _middle(positions[:, high]) - feet
    length = np.linalg.norm(upward, axis=1)
    known = np.isfinite(length) & (length > 0.0)
    if not known.any():
        return ""
    along = np.median(upward[known] / length[known, None], axis=0)
    axis = int(np.argmax(np.abs(along)))
    at = np.median(feet[known, axis] / length[known])
    if abs(along[axis]) < CLEAR or abs(at) > ON_THE_FLOOR:
        return ""
    return f"{'-' if along[axis] < 0.0 else ''}{'xyz'[axis]}"


def _middle(points: Array) -> Array:
    """(F, 3) means of the points (F, K, 3) that are there, NaN where none is."""
    present = np.asarray(np.isfinite(points).all(axis=2))
    count = present.sum(axis=1)
    total = np.where(present[..., None], points, 0.0).sum(axis=1)
    return np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], np.nan)


def _is(name: str, parts: tuple[str, ...]) -> bool:
    plain = name.lower().split(":")[-1]
    return any(part in plain for part in parts) and "fore" not in plain
