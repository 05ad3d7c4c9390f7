"""The report of a calibration beside its file: JSON, and a coverage picture a camera."""

import math
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import cv2
import msgspec
import numpy as np
import tomli_w

from studio.footage.calibration.coverage import coverage_picture
from studio.footage.calibration.findings import blocking
from studio.footage.calibration.intrinsics import Lens
from studio.footage.calibration.lens_verdict import verdict
from studio.footage.calibration.verbs import Calibrated
from studio.footage.capture.calibration_files import write_calibration


def report_of(calibrated: Calibrated) -> dict[str, object]:
    """Everything a person wants to know of a calibration, as plain values (lengths mm, angles degrees)."""
    rig = calibrated.rig
    cameras = {camera.name: camera for camera in rig.cameras} if rig is not None else {}
    return {
        "board": calibrated.board.text,
        "floor": calibrated.floor,
        "usable": not blocking(calibrated.findings),
        "findings": [asdict(finding) | {"cameras": list(finding.cameras)} for finding in calibrated.findings],
        "cameras": [
            {
                **_lens(lens),
                **(
                    {}
                    if rig is None
                    else {"rig_rms_px": _number(rig.rms[name]), "rig_views": rig.views[name]}
                ),
                **({"position_mm": _numbers(cameras[name].centre)} if name in cameras else {}),
            }
            for name, lens in calibrated.lenses.items()
        ],
        "pairs": [
            {"cameras": [pair.first, pair.second], "shared": pair.shared, "agreeing": pair.agreeing}
            for pair in (rig.pairs if rig is not None else ())
        ],
        "dropped_views": rig.dropped if rig is not None else 0,
    }


def calibration_source(calibrated: Calibrated) -> str:
    """The origin of a calibration as text: the board, and its residual in pixels."""
    rig = calibrated.rig
    off = (
        math.sqrt(sum(value**2 for value in rig.rms.values()) / len(rig.rms)) if rig is not None else math.nan
    )
    board = calibrated.board
    kind = "ChArUco board" if board.kind == "charuco" else "chessboard"
    source = f"{kind} {board.columns}x{board.rows}"
    return f"{source}, {off:.2f} px" if math.isfinite(off) else source


def board_error(source: str) -> float | None:
    """The residual in pixels that an origin (`calibration_source`) names; None where it names no board or none."""
    matched = re.match(r"\w+(?: board)? \d+x\d+, (\d+\.\d+) px", source)
    return float(matched[1]) if matched else None


def write_calibrated(calibrated: Calibrated, path: Path, *, anyway: bool = False) -> tuple[Path, ...]:
    """Write the calibration (TOML, mm) with its report and coverage pictures beside it; returns the files written.

    If a finding blocks, the calibration itself is written only with `anyway`; report and pictures always. Without
    placed cameras, the lenses alone are written as "<stem>.lenses.toml".
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    if calibrated.rig is not None and (anyway or not blocking(calibrated.findings)):
        write_calibration(calibrated.rig.cameras, path)
        written.append(path)
    if calibrated.rig is None:
        lenses = path.with_name(f"{path.stem}.lenses.toml")
        lenses.write_text(tomli_w.dumps(_lens_tables(calibrated.lenses)), encoding="utf-8")
        written.append(lenses)
    report = path.with_name(f"{path.stem}.report.json")
    report.write_bytes(msgspec.json.format(msgspec.json.encode(report_of(calibrated)), indent=2))
    written.append(report)
    for name, lens in calibrated.lenses.items():
        dropped = {residual.frame for residual in lens.residuals if residual.dropped}
        detections = calibrated.detections.get(name, ())
        picture = coverage_picture(
            lens.coverage,
            [detection for detection in detections if detection.frame not in dropped],
            [detection for detection in detections if detection.frame in dropped],
        )
        place = path.with_name(f"{path.stem}.coverage-{name}.png")
        place.write_bytes(bytes(cv2.imencode(".png", picture)[1]))
        written.append(place)
    return tuple(written)


def _lens(lens: Lens) -> dict[str, object]:
    return {
        "name": lens.camera,
        "size": list(lens.size),
        "focal_px": _numbers(np.diag(lens.matrix)[:2]),
        "focal_deviation_px": _number(lens.focal_deviation),
        "centre_px": _numbers(lens.matrix[:2, 2]),
        "centre_deviation_px": _number(lens.centre_deviation),
        "distortion": _numbers(lens.distortion, 6),
        "rms_px": _number(lens.rms),
        "coverage": _number(lens.coverage.share),
        "hardly_covered": list(lens.coverage.empty_parts),
        "model": lens.model,
        "verdict": verdict(lens),
        "pictures": [
            {
                "picture": residual.picture,
                "rms_px": _number(residual.rms),
                "tilt_degrees": _number(residual.tilt),
                "dropped": residual.dropped,
            }
            for residual in lens.residuals
        ],
    }


def _lens_tables(lenses: Mapping[str, Lens]) -> dict[str, object]:
    return {
        name: {
            "name": name,
            "size": [float(side) for side in lens.size],
            "matrix": lens.matrix.tolist(),
            "distortions": lens.distortion.tolist(),
            "fisheye": False,
        }
        for name, lens in lenses.items()
    }


def _number(value: float, digits: int = 3) -> float | None:
    return round(float(value), digits) if math.isfinite(value) else None


def _numbers(values: np.ndarray, digits: int = 3) -> list[float | None]:
    return [_number(float(value), digits) for value in values]
