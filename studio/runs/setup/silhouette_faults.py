"""Checks a calibration by the session's silhouettes: a mirrored video, exchanged cameras, half the resolution,
metres for millimetres. A calibration file alone cannot show these, and without a board nothing else does.
"""

import dataclasses
from collections.abc import Mapping

from studio.evidence.masks import cleaned
from studio.evidence.settings import EvidenceSettings
from studio.footage.calibration.checks import Masks, check_calibration
from studio.footage.calibration.findings import Finding
from studio.foundations.arrays import Bytes
from studio.foundations.errors import CalibrationError, StudioError
from studio.foundations.geometry.camera import Camera
from studio.sessions.provenance import changed_inputs, origin_of
from studio.sessions.session import Session

PERSON_ALONE = EvidenceSettings(
    mask_opening=0, mask_closing=0, mask_fill_holes=0, mask_min_component=0, mask_keep_components=1
)
UNEXPLAINED = "views-disagree"
MEASURED = "background"
"""The part of a session whose measurement is stored with the findings."""
SIZES = ("scale", "square-size")


def person_alone(mask: Bytes) -> Bytes:
    """The largest piece of a mask (H, W), so that no tangent touches a speck."""
    return cleaned(mask, PERSON_ALONE)


def silhouette_faults(
    cameras: tuple[Camera, ...],
    masks: Mapping[int, Mapping[str, Bytes]],
    height_mm: float | None,
    scale: float = 1.0,
) -> tuple[Finding, ...]:
    """Faults of a calibration that explain the silhouettes; none where they agree, or where nothing explains them (poor
    masks disagree too, and are reported by camera). masks : frame → camera → (H, W).

    A wrong size only warns if a height is given: the height may be wrong. scale : of the body beside a person
    (`scale_of`).
    """
    known = {finding.code for finding in check_calibration(cameras)}
    seen: Masks = masks
    findings: list[Finding] = []
    for finding in check_calibration(cameras, masks=seen, height_mm=height_mm, scale=scale):
        if finding.code in known or finding.code == UNEXPLAINED:
            continue
        by_height = finding.code in SIZES and height_mm is not None
        findings.append(dataclasses.replace(finding, severity="warns") if by_height else finding)
    return tuple(findings)


def known_faults(session: Session) -> tuple[str, ...]:
    """The blocking findings of the last measurement, as sentences; none if footage or calibration has changed since."""
    measured = origin_of(session, MEASURED)
    if measured is None or changed_inputs(session, MEASURED, ("footage", "calibration")):
        return ()
    return measured.stops


def accepted_faults(session: Session, allow_inconsistent: bool) -> tuple[str, ...]:
    """The standing doubts, for a run's notes. Raises CalibrationError for any, unless `allow_inconsistent`."""
    faults = known_faults(session)
    if faults and not allow_inconsistent:
        raise CalibrationError(
            f"The footage of '{session.name}' contradicts its calibration: {faults[0]}",
            "Correct it and measure the masks again, or track anyway (--allow-inconsistent; a checkbox in the forms).",
        )
    return faults


def height_of(session: Session) -> float | None:
    """The person's height from the session; None if it is not given or cannot be read."""
    try:
        subject = session.subject()
    except StudioError:
        return None
    return subject.height_mm if subject is not None else None
