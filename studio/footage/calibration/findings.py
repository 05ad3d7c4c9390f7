"""Faults of a calibration, each with a remedy."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Severity = Literal["blocks", "warns"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that a check found.

    code : its kind, lower case with dashes ("mirrored-video", "turned-video", "swapped-cameras", "resolution",
    "scale", "up-axis", "square-size", "transposed-rotation", ...). severity : "blocks" where results would be wrong,
    "warns" where they may be. message, remedy : a sentence each, naming cameras and values. cameras : those it is
    about.
    """

    code: str
    severity: Severity
    message: str
    remedy: str
    cameras: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.message} {self.remedy}"


def blocking(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    return tuple(finding for finding in findings if finding.severity == "blocks")
