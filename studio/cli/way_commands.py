"""`studio new`, `add-footage` and `way`: the guided way from a terminal."""

from pathlib import Path

import click

from studio.cli.arguments import camera_numbers, footage_options
from studio.cli.output import command, note, progress
from studio.export.kept_exports import exported_files
from studio.runs.way import way_of
from studio.runs.way_results import newest_run
from studio.sessions.importers.importing import ImportOptions, add_footage
from studio.sessions.workspace import Workspace, begin_session

MARKS = {"done": "✓", "ready": "·", "blocked": " ", "stale": "!", "running": "…"}


@click.command("new")
@click.argument("session")
@click.option("--title", default="", help="What people see; the name unless given.")
@click.option("--body", default="", help="The body that is tracked; the studio's own unless given.")
@command
def new_command(session: str, title: str, body: str) -> dict[str, object]:
    """Make an empty SESSION, to which footage and a calibration are added."""
    made = begin_session(Workspace().place_for(session), title, body)
    return {"session": str(made.path), "next": "footage"}


@click.command("add-footage")
@click.argument("session")
@click.argument("source", type=click.Path(path_type=Path))
@footage_options
@click.option("--calibration", help="The source's calibration to take where there are several.")
@click.option("--replace", "replaced", is_flag=True, help="Forget all cameras that SOURCE does not name.")
@command
def add_footage_command(
    session: str,
    source: Path,
    fps: float | None,
    calibration: str | None,
    trial: str | None,
    offsets: tuple[str, ...],
    rotations: tuple[str, ...],
    replaced: bool,
    despite_findings: bool,
    copy: bool,
) -> dict[str, object]:
    """Add the footage of a folder to a SESSION that is there, before or after it is calibrated."""
    wish = ImportOptions(
        calibration=calibration,
        fps=fps,
        copy=copy,
        trial=trial,
        offsets=camera_numbers(offsets, "--offset"),
        rotations=camera_numbers(rotations, "--rotate"),
        despite_findings=despite_findings,
        replaced=replaced,
    )
    with progress("Adding") as report:
        added = add_footage(Workspace().resolve(session), source, wish, progress=report)
    for line in (*added.notes, *(f"Warning: {warning}" for warning in added.warnings)):
        note(line)
    source_now = added.session.manifest.footage
    return {
        "session": str(added.session.path),
        "cameras": [camera.name for camera in source_now.cameras],
        "frames": source_now.frame_count,
        "fps": source_now.fps,
        "calibrated": added.session.is_calibrated,
        "warnings": list(added.warnings),
    }


@click.command("way")
@click.argument("session")
@command
def way_command(session: str) -> dict[str, object]:
    """Tell how far a SESSION is on the way from footage to an exported motion, and what is next."""
    opened = Workspace().resolve(session)
    run = newest_run(opened)
    way = way_of(opened, exports=exported_files(run) if run else ())
    lines = [
        f"{MARKS[step.state]} {step.step:12} {step.words}{f'  ({step.why})' if step.why else ''}"
        for step in way.steps
    ]
    steps = [
        {
            "step": step.step,
            "state": step.state,
            "words": step.words,
            "why": step.why,
            "optional": step.optional,
        }
        for step in way.steps
    ]
    said = f"Next: {way.next}." if way.next else "Nothing is left to be done."
    return {"steps": steps, "next": way.next, "text": "\n".join((*lines, said))}
