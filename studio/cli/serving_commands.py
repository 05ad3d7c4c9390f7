"""`studio demo` and `studio serve`."""

from pathlib import Path

import click

from studio.cli.output import command
from studio.launch import demo as launch_demo
from studio.launch import serve as launch_serve
from studio.sessions.workspace import workspace_root

PORT_HELP = "Port to listen on; 0 takes a free one."


@click.command()
@click.option("--workspace", type=click.Path(path_type=Path), help="Folder of sessions.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default=True, help=PORT_HELP)
@command
def demo(workspace: Path | None, port: int) -> dict[str, object]:
    """Track the bundled walk in the browser: prints the address to open."""
    launch_demo(workspace or workspace_root(), port=port)
    return {"text": "Closed."}


@click.command()
@click.option("--workspace", type=click.Path(path_type=Path), help="Folder of sessions.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), default=8642, show_default=True, help=PORT_HELP)
@click.option("--allow-remote", is_flag=True, help="Needed for any host but this machine.")
@command
def serve(workspace: Path | None, host: str, port: int, allow_remote: bool) -> dict[str, object]:
    """Open the studio on a workspace: prints the address to open."""
    launch_serve(workspace or workspace_root(), host=host, port=port, allow_remote=allow_remote)
    return {"text": "Closed."}
