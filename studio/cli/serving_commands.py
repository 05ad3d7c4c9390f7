"""`studio demo` and `studio serve`."""

import re
from pathlib import Path

import click

from studio.cli.output import errors_in_words, tell
from studio.launch import PORT, Announce
from studio.launch import demo as launch_demo
from studio.launch import serve as launch_serve
from studio.sessions.workspace import workspace_root

PORT_HELP = "Port to listen on; 0 takes a free one."
JSON_HELP = "Print the address as one JSON object and nothing else on standard output."


def _announcer(as_json: bool) -> Announce:
    """Prints the line with the address, or the address alone as JSON."""

    def announce(line: str) -> None:
        found = re.search(r"http\S+", line)
        tell({"address": found.group() if found else line, "text": line}, as_json)

    return announce


@click.command()
@click.option("--workspace", type=click.Path(path_type=Path), help="Folder of sessions.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default=True, help=PORT_HELP)
@click.option("--json", "as_json", is_flag=True, help=JSON_HELP)
def demo(workspace: Path | None, port: int, as_json: bool) -> None:
    """Track the bundled walk in the browser: prints the address to open."""
    with errors_in_words():
        launch_demo(workspace or workspace_root(), port=port, announce=_announcer(as_json))


@click.command()
@click.option("--workspace", type=click.Path(path_type=Path), help="Folder of sessions.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), default=PORT, show_default=True, help=PORT_HELP)
@click.option("--allow-remote", is_flag=True, help="Needed for any host but this machine.")
@click.option("--json", "as_json", is_flag=True, help=JSON_HELP)
def serve(workspace: Path | None, host: str, port: int, allow_remote: bool, as_json: bool) -> None:
    """Open the studio on a workspace: prints the address to open."""
    with errors_in_words():
        launch_serve(
            workspace or workspace_root(),
            host=host,
            port=port,
            allow_remote=allow_remote,
            announce=_announcer(as_json),
        )
