"""The checks that a reprojection error cannot make, together."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from studio.calibration.boards import Board
from studio.calibration.findings import Finding, Severity, blocking
from studio.calibration.rig_checks import rig_findings, size_findings
from studio.calibration.sightings import Sighting
from studio.geometry.camera import Camera

__all__ = ["Finding", "Masks", "Severity", "blocking", "check_calibration"]

Masks: TypeAlias = Mapping[int, Mapping[str, NDArray[np.uint8]]]


def check_calibration(
    cameras: Sequence[Camera],
    *,
    footage_sizes: Mapping[str, tuple[int, int]] | None = None,
    board: Board | None = None,
    sightings: Sequence[Sighting] = (),
    masks: Masks | None = None,
    height_mm: float | None = None,
    distances_mm: Mapping[tuple[str, str], float] | None = None,
) -> tuple[Finding, ...]:
    """Everything that is wrong or doubtful, what blocks first; none for a good calibration.

    footage_sizes : (width, height) of each camera's footage. board, sightings : board footage taken with these
    cameras. masks : silhouettes of one person, frame → camera → (H, W), nonzero = person. height_mm : the person's.
    distances_mm : measured distances between two cameras' lenses. Give what there is; each adds checks.
    """
    found = [*size_findings(cameras, footage_sizes or {}), *rig_findings(cameras)]
    return tuple(sorted(found, key=lambda finding: finding.severity != "blocks"))
