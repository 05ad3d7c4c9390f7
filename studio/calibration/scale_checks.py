"""Lengths that are known, against what the calibration makes of them."""

from collections.abc import Mapping, Sequence

import numpy as np

from studio.calibration.boards import Board
from studio.calibration.findings import Finding
from studio.geometry.camera import Camera

TOLERANCE = 0.05
UNITS = {
    1e-3: ("metres were taken for millimetres", "Multiply the translations by 1000, or name the unit (m)."),
    1e-2: ("decimetres were taken for millimetres", "Multiply the translations by 100."),
    1e-1: (
        "centimetres were taken for millimetres",
        "Multiply the translations by 10, or name the unit (cm).",
    ),
    1e3: ("millimetres were taken for metres", "Divide the translations by 1000, or name the unit (mm)."),
    1.0 / 25.4: ("inches were taken for millimetres", "Multiply the translations by 25.4."),
}
UNIT_TOLERANCE = 0.25


def unit_finding(ratio: float, known: str, tolerance: float = UNIT_TOLERANCE) -> Finding | None:
    """The unit that was mistaken, None for none. ratio : measured by the calibration over known. known : the length, in
    words. tolerance : of the length, a share.
    """
    for factor, (said, remedy) in UNITS.items():
        if abs(np.log(ratio / factor)) < np.log(1.0 + tolerance):
            return Finding(
                "scale",
                "blocks",
                f"By the calibration {known} is {ratio:.4g} times what it is: {said}.",
                remedy,
            )
    return None


def scale_finding(ratio: float, known: str, board: Board | None = None) -> Finding:
    """What a length says that was measured and comes out wrong; parameters as of `unit_finding`."""
    return unit_finding(ratio, known) or Finding(
        "square-size",
        "blocks",
        f"By the calibration {known} is {ratio:.3f} times what it is: its board's squares were not of the size told.",
        f"Measure the printed squares and calibrate again with their true size{_true_size(ratio, board)}; or divide"
        f" lengths by {ratio:.3f}.",
    )


def height_finding(seen_mm: float, known_mm: float, known: str, board: Board | None = None) -> Finding:
    """What the height of a person who stands says: that it, or the calibration's size, is wrong. known : the height, in
    words.
    """
    ratio = seen_mm / known_mm
    return unit_finding(ratio, known) or Finding(
        "square-size",
        "blocks",
        f"By the calibration the person, who stands, is {seen_mm:.0f} mm tall, {ratio:.3f} times {known}.",
        f"Check the height. If it is right, the calibration board's squares were not of the size given: measure them"
        f" and calibrate again{_true_size(ratio, board)}, or divide lengths by {ratio:.3f}.",
    )


def _true_size(ratio: float, board: Board | None) -> str:
    return (
        f" ({board.square_mm / ratio:.4g} mm instead of {board.square_mm:.4g} mm)"
        if board is not None
        else ""
    )


def distance_findings(
    cameras: Sequence[Camera], distances_mm: Mapping[tuple[str, str], float], board: Board | None = None
) -> tuple[Finding, ...]:
    """Distances between lenses that were measured in the room, against the calibration's; names that are not there are
    passed over.
    """
    centres = {camera.name: camera.centre for camera in cameras}
    ratios = {
        pair: float(np.linalg.norm(centres[pair[0]] - centres[pair[1]])) / length
        for pair, length in distances_mm.items()
        if pair[0] in centres and pair[1] in centres and length > 0.0
    }
    if not ratios:
        return ()
    ratio = float(np.median(list(ratios.values())))
    if abs(ratio - 1.0) <= TOLERANCE or ratio <= 0.0:
        return ()
    pair = next(iter(ratios))
    return (scale_finding(ratio, f"the distance from camera {pair[0]} to {pair[1]}", board),)
