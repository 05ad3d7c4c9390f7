"""The command line's front door."""

import importlib.metadata

import click

from studio.cli.serving_commands import demo, serve
from studio.cli.session_commands import bodies, import_command, runs, synthesize_command
from studio.cli.tracking_commands import bench, evaluate_command, track


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(importlib.metadata.version("capture-studio"), prog_name="studio")
def main() -> None:
    """Recover the motion of an articulated body from calibrated cameras, and watch the search do it.

    Start with `studio demo`. A SESSION is named by its path or by its name in the workspace
    (STUDIO_WORKSPACE, or your user data folder).
    """


for entry in (demo, serve, import_command, track, evaluate_command, synthesize_command, bodies, runs, bench):
    main.add_command(entry)
