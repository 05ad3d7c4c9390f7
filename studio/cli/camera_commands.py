"""Cameras: `calibrate`, `board`, `align`, `level`."""

from dataclasses import asdict

import click

from studio.cli.deriving import Call, command_of
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
    made: Calibration = call(distances_mm=distances)
    lines = [*made.in_words(), *(f"Wrote {path}" for path in made.files)]
    return {**made.report, "written": [str(path) for path in made.files], "text": "\n".join(lines)}


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
    aligned: Alignment = call()
    if aligned.changed:
        words = "The session uses the turned cameras from now on; the calibration before is kept (--undo)."
    elif not aligned.needed:
        words = "The cameras agree: nothing was changed."
    elif not aligned.better:
        words = "Turning cameras does not explain it: nothing was changed. Look at masks and calibration."
    else:
        words = ""
    return {
        "session": name,
        "changed": aligned.changed,
        "frames": list(aligned.frames),
        "cameras": [asdict(one) for one in aligned.cameras],
        "text": "\n".join([*aligned.alignment.in_words(), *([words] if words else [])]),
    }


@command_of(level)
def level_command(call: Call) -> dict[str, object]:
    levelled: Levelled = call()
    done = "The world was turned" if levelled.changed else "The world would be turned"
    words = (
        f"{done} by {levelled.tilted:.1f} degrees, its old origin lies {levelled.lowered:.0f} mm above the floor: by"
        f" {levelled.how}."
    )
    kept = " The calibration before is kept." if levelled.changed else ""
    return {
        "session": levelled.session.name,
        "changed": levelled.changed,
        "tilted_degrees": levelled.tilted,
        "lowered_mm": levelled.lowered,
        "text": words + kept,
    }
