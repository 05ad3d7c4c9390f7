"""`studio synthesize`."""

import click

from studio.cli.output import command, progress
from studio.sessions.workspace import Workspace
from studio.synthesis.recipes import synthesize

INTO_HELP = "Name of the new session in the workspace, or a path."


@click.command("synthesize")
@click.argument("recipe")
@click.option("--into", required=True, metavar="SESSION", help=INTO_HELP)
@command
def synthesize_command(recipe: str, into: str) -> dict[str, object]:
    """Render footage with exact truth from a RECIPE (a TOML file, or the name of one that is shipped)."""
    place = Workspace().place_for(into)
    with progress("Rendering") as report:
        synthesize(recipe, place, progress=report)
    return {"session": str(place), "text": f"Session {place.name} in {place}"}
