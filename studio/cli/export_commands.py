"""`studio export`."""

from collections.abc import Callable
from pathlib import Path

import click

from studio.cli.output import command, note, progress
from studio.export.exporting import export_run
from studio.export.formats import FORMATS, format_of_file
from studio.export.options import ExportOptions
from studio.knobs import Knob, allowed, knobs_of
from studio.scene.recording import record_scene
from studio.sessions.workspace import Workspace


def _export_options(function: Callable[..., object]) -> Callable[..., object]:
    """An option for each declaration of `ExportOptions`."""
    for entry in reversed(knobs_of(ExportOptions)):
        name = f"--{entry.name}"
        text = entry.help if entry.choices else f"{entry.help} ({allowed(entry)})"
        if entry.kind is bool:
            function = click.option(name, is_flag=True, default=None, help=entry.help)(function)
        else:
            function = click.option(name, type=_kind(entry), default=None, help=text)(function)
    return function


def _kind(entry: Knob) -> click.ParamType | type:
    return click.Choice(entry.choices) if entry.choices else entry.kind


@click.command(
    "export", epilog="Formats: " + "  ".join(f".{form.name} {form.title};" for form in FORMATS.values())
)
@click.argument("session")
@click.argument("run")
@click.option(
    "--to",
    "place",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE",
    help=f"The file; its ending is the format: {', '.join(FORMATS)}.",
)
@_export_options
@command
def export_command(session: str, run: str, place: Path, **asked: object) -> dict[str, object]:
    """Write the motion of a RUN of SESSION to a file that other programs open.

    The file is read back and compared before it takes its place; Ctrl-C leaves nothing behind.
    """
    form = format_of_file(place)
    opened = Workspace().resolve(session)
    stored = opened.run(run)
    with progress(f"{opened.name} / {stored.name}: {form.title}") as report:
        done = export_run(
            opened,
            stored,
            form,
            {name: value for name, value in asked.items() if value is not None},
            place,
            progress=report,
            record_scene=record_scene,
        )
    for line in done.notes:
        note(line)
    names = ", ".join(str(path) for path in done.files)
    of_track = f"track '{done.track}', " if done.track else ""
    return {
        "session": opened.name,
        "run": stored.name,
        "format": done.format,
        "track": done.track,
        "files": [str(path) for path in done.files],
        "bytes": done.size,
        "frames": done.frames,
        "fps": done.fps,
        "checked": done.checked,
        "notes": list(done.notes),
        "text": f"{names} ({done.size / 1e6:.2f} MB): {of_track}{done.checked}.",
    }
