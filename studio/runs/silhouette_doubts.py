"""What a session's own silhouettes say against its calibration: a mirrored video, cameras exchanged, half the
resolution, metres for millimetres. A calibration file alone cannot show these, and without a board nothing else does.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from studio.calibration.checks import Masks, check_calibration
from studio.calibration.findings import Finding
from studio.errors import CalibrationError, StudioError
from studio.evidence.masks import cleaned
from studio.evidence.settings import EvidenceSettings
from studio.geometry.camera import Camera
from studio.sessions.made_from import changed_inputs, origin_of
from studio.sessions.session import Session

Bytes = NDArray[np.uint8]

PERSON_ALONE = EvidenceSettings(
    mask_opening=0, mask_closing=0, mask_fill_holes=0, mask_min_component=0, mask_keep_components=1
)
UNEXPLAINED = "views-disagree"
MEASURED = "background"
"""The part of a session whose measuring tells of doubts."""
SIZES = ("scale", "square-size")


def person_alone(mask: Bytes) -> Bytes:
    """The largest piece of a mask (H, W): specks would be touched first."""
    return cleaned(mask, PERSON_ALONE)


def silhouette_doubts(
    cameras: tuple[Camera, ...], masks: Mapping[int, Mapping[str, Bytes]], height_mm: float | None
) -> tuple[Finding, ...]:
    """Faults of a calibration that the silhouettes name; none where they agree, or where nothing explains them (poor
    masks disagree too, and are told of camera by camera). masks : frame → camera → (H, W).

    A wrong size only warns where a height is given: that may be the wrong one.
    """
    known = {finding.code for finding in check_calibration(cameras)}
    seen: Masks = masks
    found = []
    for finding in check_calibration(cameras, masks=seen, height_mm=height_mm):
        if finding.code in known or finding.code == UNEXPLAINED:
            continue
        by_height = finding.code in SIZES and height_mm is not None
        found.append(dataclasses.replace(finding, severity="warns") if by_height else finding)
    return tuple(found)


def standing_doubts(session: Session) -> tuple[str, ...]:
    """What the silhouettes said, when they were measured last, that makes all results wrong: sentences. None where the
    footage or the calibration is another one since.
    """
    measured = origin_of(session, MEASURED)
    if measured is None or changed_inputs(session, MEASURED, ("footage", "calibration")):
        return ()
    return measured.stops


def accepted_doubts(session: Session, despite: bool) -> tuple[str, ...]:
    """The standing doubts, for a run's notes. Raises CalibrationError where there are any, unless `despite`."""
    doubts = standing_doubts(session)
    if doubts and not despite:
        raise CalibrationError(
            f"The footage of '{session.name}' speaks against its calibration: {doubts[0]}",
            "Set it right and measure the masks again, or track all the same (--despite-findings; the forms ask).",
        )
    return doubts


def height_of(session: Session) -> float | None:
    """The person's height as the session has it; None where nobody said, or it cannot be read."""
    try:
        subject = session.subject()
    except StudioError:
        return None
    return subject.height_mm if subject is not None else None
