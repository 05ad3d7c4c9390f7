"""`studio align`."""

import click

from studio.cli.arguments import frame_numbers
from studio.cli.output import command, note, progress
from studio.runs.aligning import align_cameras
from studio.runs.turned_cameras import remember_alignment, turn_back, turn_cameras
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@click.command(name="align")
@click.argument("session")
@click.option("--frames", default="", metavar="A,B,…", help="To look at; default: sixteen, evenly spread.")
@click.option("--dry-run", is_flag=True, help="Only tell; change nothing.")
@click.option("--undo", is_flag=True, help="Use the calibration again that the cameras were turned from.")
@command
def align_command(session: str, frames: str, dry_run: bool, undo: bool) -> dict[str, object]:
    """Turn SESSION's cameras a little so that the silhouettes of all views agree.

    For calibrations that are nearly right: a camera that was touched after it. Needs masks (studio background) of a
    person who is whole in the pictures. The calibration before is kept; nothing is changed where the cameras agree.
    """
    opened = Workspace().resolve(session)
    if undo:
        return _undone(opened)
    with progress(f"{opened.name}: cameras") as report:
        aligned = align_cameras(opened, frame_numbers(frames), progress=report)
    lines = list(aligned.in_words())
    kept = aligned.needed and aligned.better and not dry_run
    remember_alignment(opened, aligned)
    if kept:
        change = turn_cameras(opened, aligned)
        for line in change.notes:
            note(line)
        lines.append(
            "The session uses the turned cameras from now on; the calibration before is kept (--undo)."
        )
    elif not aligned.needed:
        lines.append("The cameras agree: nothing was changed.")
    elif not aligned.better:
        lines.append(
            "Turning cameras does not explain it: nothing was changed. Look at masks and calibration."
        )
    return {
        "session": opened.name,
        "changed": kept,
        "frames": list(aligned.found.frames),
        "cameras": [
            {
                "camera": name,
                "before_px": float(before),
                "after_px": float(after),
                "turn_degrees": float(turn),
            }
            for name, before, after, turn in zip(
                aligned.names, aligned.found.before, aligned.found.after, aligned.found.turns, strict=True
            )
        ],
        "text": "\n".join(lines),
    }


def _undone(session: Session) -> dict[str, object]:
    change = turn_back(session)
    for line in change.notes:
        note(line)
    text = "The session uses the calibration again that its cameras were turned from."
    return {"session": session.name, "changed": True, "text": text}
