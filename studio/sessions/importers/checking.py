"""What a reprojection error cannot see of a calibration, asked before a session is made of it."""

from studio.calibration.checks import blocking, check_calibration
from studio.errors import CalibrationError
from studio.geometry.camera import Camera


def check_rig(cameras: tuple[Camera, ...], despite_findings: bool) -> tuple[str, ...]:
    """Doubts about the cameras, sentences. despite_findings : what would make results wrong is a doubt as well.

    Raises CalibrationError with the first finding that would make results wrong.
    """
    findings = check_calibration(cameras)
    wrong = blocking(findings)
    if wrong and not despite_findings:
        raise CalibrationError(
            wrong[0].message, f"{wrong[0].remedy} To import it as it is: --despite-findings."
        )
    return tuple(str(finding) for finding in findings)
