"""Whether the pictures determine a lens; else what is missing and what to photograph."""

from collections.abc import Iterator

import numpy as np

from studio.footage.calibration.findings import Finding
from studio.footage.calibration.intrinsics import Lens

FEW, TOO_FEW = 10, 4
GOOD_COVERAGE, POOR_COVERAGE = 0.5, 0.2
ENOUGH_TILT = 25.0
"""Degrees; boards that all face the camera cannot separate focal length from distance."""
TILTED_BOARDS = 3
SURE, UNSURE = 0.01, 0.03
"""Two standard deviations of the focal length, as a share of it: above the first it is reported, above the second it
blocks."""
SHARP = 1.0
"""Pixels of residual per 1000 of width, above which the pictures or the board are doubtful."""
UNLIKE_FOCAL = (0.35, 6.0)


def lens_findings(lens: Lens) -> tuple[Finding, ...]:
    """Findings on a lens; none for a reliable one, or one read from a file."""
    findings = _findings(lens) if lens.residuals else ()
    return tuple(sorted(findings, key=lambda finding: finding.severity != "blocks"))


def verdict(lens: Lens) -> str:
    """One sentence: the focal length, its deviation, its source."""
    focal = float(np.mean(np.diag(lens.matrix)[:2]))
    if not lens.residuals:
        return f"Camera {lens.camera}: focal length {focal:.1f} px, {lens.model}."
    return (
        f"Camera {lens.camera}: focal length {focal:.1f} ± {2.0 * lens.focal_deviation:.1f} px (95 %), residual"
        f" {lens.rms:.2f} px over {len(lens.used)} of {len(lens.residuals)} pictures that cover"
        f" {lens.coverage.share:.0%} of the view."
    )


def _findings(lens: Lens) -> Iterator[Finding]:
    camera = f"camera {lens.camera}"

    def finding(code: str, blocks: bool, message: str, remedy: str) -> Finding:
        return Finding(code, "blocks" if blocks else "warns", message, remedy, (lens.camera,))

    count, share = len(lens.used), lens.coverage.share
    if count < FEW:
        yield finding(
            "few-pictures",
            count < TOO_FEW,
            f"Camera {lens.camera} was calibrated from {count} pictures.",
            f"Take {FEW} to 30 pictures, or a minute of video, with the board in other places and tilts.",
        )
    if share < GOOD_COVERAGE:
        empty = ", ".join(lens.coverage.empty_parts) or "the edges"
        yield finding(
            "coverage",
            share < POOR_COVERAGE,
            f"The board was seen in {share:.0%} of the picture of {camera} only; hardly in: {empty}.",
            "Hold the board there too: distortion is not known where no corner was seen.",
        )
    tilts = np.array([residual.tilt for residual in lens.used])
    tilted = np.count_nonzero(tilts >= ENOUGH_TILT)
    if tilted < min(TILTED_BOARDS, len(tilts)):
        yield finding(
            "little-tilt",
            False,
            f"Only {tilted} of {len(tilts)} boards before {camera} were tilted by {ENOUGH_TILT:.0f}° or more (the most:"
            f" {tilts.max():.0f}°).",
            "Tilt the board by 30° to 45° to either side: a board that faces the camera does not separate focal length"
            " from distance.",
        )
    focal = float(np.mean(np.diag(lens.matrix)[:2]))
    unsure = 2.0 * lens.focal_deviation / focal
    if unsure > SURE:
        yield finding(
            "uncertain-focal",
            unsure > UNSURE,
            f"The focal length of {camera} is {focal:.0f} px give or take {unsure:.1%}.",
            "Take more pictures, tilted and at unlike distances.",
        )
    relative = lens.rms * 1000.0 / lens.size[0]
    if relative > SHARP:
        yield finding(
            "residual",
            relative > 5.0 * SHARP,
            f"The corners of {camera} miss the model by {lens.rms:.2f} px.",
            "Use a flat, stiff board and pictures without motion blur; check the board's numbers of squares.",
        )
    if not UNLIKE_FOCAL[0] < focal / max(lens.size) < UNLIKE_FOCAL[1]:
        yield finding(
            "unlikely-focal",
            True,
            f"The focal length of {camera}, {focal:.0f} px, is unlike any usual lens.",
            "Check the board's numbers and take more pictures with the board tilted.",
        )
