"""Cameras: `calibrate`, `board`, `align`, `level`."""

import click

from studio.cli.deriving import Call, command_of
from studio.footage.calibration.lens_verdict import verdict
from studio.footage.calibration.report import report_of
from studio.foundations.errors import CalibrationError
from studio.operations.cameras import (
    Alignment,
    Calibration,
    Levelled,
    align,
    board,
    calibrate,
    level,
    unalign,
)


@command_of(calibrate)
def calibrate_command(call: Call) -> dict[str, object]:
    distances = {_pair(names): mm for names, mm in call.given.get("distances_mm", {}).items()}
    found: Calibration = call(distances_mm=distances)
    lines: list[str] = []
    for lens in found.solved.lenses.values():
        lines.append(verdict(lens))
        lines += [f"  left out {each.picture}: {each.dropped}" for each in lens.residuals if each.dropped]
    rig = found.solved.rig
    if rig is not None:
        for camera in rig.cameras:
            x, y, z = camera.centre
            lines.append(
                f"Camera {camera.name}: at ({x:.0f}, {y:.0f}, {z:.0f}) mm, residual {rig.rms[camera.name]:.2f} px"
                f" over {rig.views[camera.name]} boards."
            )
        lines.append(f"Floor: {found.solved.floor or 'not set'}.")
    return {
        **report_of(found.solved),
        "written": [str(path) for path in found.files],
        "text": "\n".join([*lines, *(f"Wrote {path}" for path in found.files)]),
    }


def _pair(text: str) -> tuple[str, str]:
    """("cam1", "cam2") from "cam1,cam2". Raises CalibrationError."""
    names = [name.strip() for name in text.split(",")]
    if len(names) != 2:
        raise CalibrationError(f"The distance '{text}' cannot be understood.", "Write cam1,cam2=4200 (mm).")
    return names[0], names[1]


@command_of(board)
def board_command(call: Call) -> dict[str, object]:
    made, place = call(), call.given["to"]
    return {
        "board": made.text,
        "page": call.given["page"],
        "written": str(place),
        "text": f"{place}: {made.text}\nCalibrate with: studio calibrate FOLDER --board {made.text}",
    }


UNDO = click.option(
    "--undo", is_flag=True, help="Use the calibration again that the cameras were turned from."
)


@command_of(align, UNDO)
def align_command(call: Call, undo: bool) -> dict[str, object]:
    name = call.given["session"].name
    if undo:
        call.do(unalign)
        text = "The session uses the calibration again that its cameras were turned from."
        return {"session": name, "changed": True, "text": text}
    found: Alignment = call()
    if found.changed:
        said = "The session uses the turned cameras from now on; the calibration before is kept (--undo)."
    elif not found.needed:
        said = "The cameras agree: nothing was changed."
    elif not found.better:
        said = "Turning cameras does not explain it: nothing was changed. Look at masks and calibration."
    else:
        said = ""
    cameras = [
        {"camera": one, "before_px": before, "after_px": found.after[one], "turn_degrees": found.turns[one]}
        for one, before in found.before.items()
    ]
    return {
        "session": name,
        "changed": found.changed,
        "frames": list(found.found.found.frames),
        "cameras": cameras,
        "text": "\n".join([*found.found.in_words(), *([said] if said else [])]),
    }


@command_of(level)
def level_command(call: Call) -> dict[str, object]:
    found: Levelled = call()
    done = "The world was turned" if found.changed else "The world would be turned"
    said = (
        f"{done} by {found.tilted:.1f} degrees, its old origin lies {found.lowered:.0f} mm above the floor: by"
        f" {found.how}."
    )
    kept = " The calibration before is kept." if found.changed else ""
    return {
        "session": found.session.name,
        "changed": found.changed,
        "tilted_degrees": found.tilted,
        "lowered_mm": found.lowered,
        "text": said + kept,
    }
