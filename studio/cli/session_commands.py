"""`studio import`, `bodies` and `runs`."""

from pathlib import Path

import click

from studio.body.catalogue import list_bodies, load_body
from studio.capture.calibration_files import WORLDS
from studio.cli.arguments import camera_numbers, footage_options
from studio.cli.output import command, note, progress
from studio.sessions.importers.importing import import_source
from studio.sessions.stored_run import damage_in_words
from studio.sessions.workspace import Workspace

INTO_HELP = "Name of the new session in the workspace, or a path."


@click.command("import")
@click.argument("source", type=click.Path(path_type=Path))
@click.option("--into", required=True, metavar="SESSION", help=INTO_HELP)
@click.option(
    "--calibration", type=click.Path(path_type=Path), help="The file to take where there are several."
)
@footage_options
@click.option(
    "--unit", type=click.Choice(("mm", "m")), help="The calibration's unit, where it is taken wrongly."
)
@click.option(
    "--up",
    type=click.Choice(tuple(WORLDS)),
    default="z",
    show_default=True,
    help="The axis of the calibration's world that points up.",
)
@command
def import_command(
    source: Path,
    into: str,
    calibration: Path | None,
    fps: float | None,
    trial: str | None,
    offsets: tuple[str, ...],
    rotations: tuple[str, ...],
    unit: str | None,
    up: str,
    despite_findings: bool,
    copy: bool,
) -> dict[str, object]:
    """Make a session from a folder (or an archive) of footage and calibration, checking one against the other.

    Folders of Pose2Sim, FreeMoCap, Caliscope, anipose, EasyMocap and PARSEC are recognised.
    """
    place = Workspace().place_for(into)
    with progress("Importing") as report:
        told = import_source(
            source,
            place,
            calibration=calibration,
            fps=fps,
            copy=copy,
            trial=trial,
            offsets=camera_numbers(offsets, "--offset"),
            rotations=camera_numbers(rotations, "--rotate"),
            unit=unit or "",
            up=up,
            despite_findings=despite_findings,
            progress=report,
        )
    for line in (*told.notes, *(f"Warning: {warning}" for warning in told.warnings)):
        note(line)
    return {
        "session": str(place),
        "layout": told.layout,
        "cameras": [f"{match.footage} → {match.camera} ({match.how})" for match in told.matching],
        "notes": list(told.notes),
        "warnings": list(told.warnings),
        "text": "\n".join(
            [
                f"Session {place.name} in {place}",
                *(f"  {match.footage} → {match.camera}" for match in told.matching),
            ]
        ),
    }


@click.command()
@command
def bodies() -> dict[str, object]:
    """List the bodies that are shipped and those of the workspace."""
    folders = tuple(folder for folder in (Workspace().root / "bodies",) if folder.is_dir())
    entries: list[dict[str, object]] = []
    for name in list_bodies(folders):
        body = load_body(name, folders)
        entries.append(
            {
                "name": body.name,
                "title": body.title,
                "parameters": len(body.parameters),
                "limbs": len(body.drawn),
                "markers": [marker.name for marker in body.markers],
            }
        )
    lines = [
        f"{entry['name']:18} {entry['parameters']:>3} parameters {entry['limbs']:>3} limbs   {entry['title']}"
        for entry in entries
    ]
    return {"bodies": entries, "text": "\n".join(lines)}


@click.command()
@click.argument("session", required=False)
@command
def runs(session: str | None) -> dict[str, object]:
    """List the runs of a SESSION, or of all sessions in the workspace."""
    workspace = Workspace()
    if session:
        opened = workspace.resolve(session)
        found = [(opened.name, run.summary()) for run in opened.runs()]
    else:
        found = [(entry.name, run) for entry in workspace.sessions() for run in entry.runs]
    entries: list[dict[str, object]] = [
        {
            "session": name,
            "run": run.name,
            "tracker": run.tracker,
            "weighting": run.weighting,
            "body": run.body,
            "seed": run.seed,
            "frames": [run.first, run.last],
            "done": run.done,
            "status": run.status,
            "damaged": list(run.damaged),
        }
        for name, run in found
    ]
    lines = [
        f"{entry['session']:18} {entry['run']:12} {entry['tracker']:14} {entry['weighting']:14} "
        f"{entry['done']:>5} of {run.last - run.first} frames  {entry['status']}"
        + (f"  {damage_in_words(run.damaged)}" if run.damaged else "")
        for entry, (_, run) in zip(entries, found, strict=True)
    ]
    return {"workspace": str(workspace.root), "runs": entries, "text": "\n".join(lines) or "No runs yet."}
