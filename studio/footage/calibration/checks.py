"""The checks that a reprojection error cannot make, together."""

from collections.abc import Mapping, Sequence

from studio.footage.calibration.board_checks import board_findings
from studio.footage.calibration.boards import Board, Detection
from studio.footage.calibration.findings import Finding, Severity, blocking
from studio.footage.calibration.rig_checks import distance_findings, rig_findings, size_findings
from studio.footage.calibration.silhouette_checks import Masks, silhouette_findings
from studio.foundations.geometry.camera import Camera

__all__ = ["Finding", "Masks", "Severity", "blocking", "check_calibration"]

FIRST_CAUSES = frozenset(("resolution", "rotation", "handedness", "transposed-rotation"))


def check_calibration(
    cameras: Sequence[Camera],
    *,
    footage_sizes: Mapping[str, tuple[int, int]] | None = None,
    board: Board | None = None,
    detections: Sequence[Detection] = (),
    masks: Masks | None = None,
    height_mm: float | None = None,
    scale: float = 1.0,
    distances_mm: Mapping[tuple[str, str], float] | None = None,
    up: str = "z",
) -> tuple[Finding, ...]:
    """All findings on a calibration, blocking ones first; none for a good one.

    footage_sizes : (width, height) of each camera's footage. board, detections : board footage taken with these
    cameras. masks : silhouettes of one person, frame → camera → (H, W), nonzero = person. height_mm : the person's.
    scale : of the body beside a person (`scale_of`).
    distances_mm : measured distances between two cameras' lenses. Each argument adds checks. up : the axis of the
    file's world that was taken for the cameras' z: findings name the file's axes.
    """
    sizes = {detection.camera: detection.size for detection in detections} | dict(footage_sizes or {})
    findings = [*size_findings(cameras, sizes), *rig_findings(cameras, up)]
    # Where sizes or rotations are wrong, views disagree for that reason; nothing more is to be learnt from them.
    if not any(finding.code in FIRST_CAUSES for finding in findings):
        if board is not None and detections:
            findings += board_findings(cameras, board, detections)
        if masks and not blocking(findings):
            findings += silhouette_findings(cameras, masks, height_mm, board, scale)
        if not any(finding.code in ("scale", "square-size") for finding in findings):
            findings += distance_findings(cameras, distances_mm or {}, board)
    return tuple(sorted(findings, key=lambda finding: finding.severity != "blocks"))
