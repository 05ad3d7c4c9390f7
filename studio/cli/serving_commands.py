"""`studio demo` and `studio serve`."""

import re
from pathlib import Path

import click

from studio.cli.launch import PORT, Announce, Listening, demo, serve
from studio.cli.output import errors_in_words, print_result
from studio.sessions.workspace import Workspace

PORT_HELP = "Port to listen on; 0 takes a free one."
PREPARING = "The walk is made ready; the first start compiles the kernels once (about half a minute) ..."
JSON_HELP = "Print the addresses as one JSON object and nothing else on standard output."


def _announcer(as_json: bool) -> Announce:
    """Prints the lines with the addresses, or the addresses alone as JSON."""

    def announce(lines: str) -> None:
        addresses: list[str] = re.findall(r"https?://\S+", lines)
        print_result(
            {**dict(zip(("address", "viewers_address"), addresses, strict=False)), "text": lines}, as_json
        )

    return announce


@click.command("demo")
@click.option("--workspace", type=click.Path(path_type=Path), help="Folder of sessions.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default=True, help=PORT_HELP)
@click.option("--json", "as_json", is_flag=True, help=JSON_HELP)
def demo_command(workspace: Path | None, port: int, as_json: bool) -> None:
    """Watch the search on the bundled walk in the browser: prints the address to open."""
    click.echo(PREPARING, err=True)
    with errors_in_words():
        demo(workspace or Workspace().root, port=port, announce=_announcer(as_json))


@click.command("serve")
@click.option("--workspace", type=click.Path(path_type=Path), help="Folder of sessions.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), default=PORT, show_default=True, help=PORT_HELP)
@click.option("--allow-remote", is_flag=True, help="Needed for any host but this machine.")
@click.option("--name", default="", help="Host name of a proxy with TLS before the studio.")
@click.option(
    "--send",
    metavar="ADDRESS",
    multiple=True,
    help="Where poses of live runs are sent: osc://HOST:PORT (VMC), ws://HOST:PORT (JSON); again for more.",
)
@click.option("--json", "as_json", is_flag=True, help=JSON_HELP)
def serve_command(
    workspace: Path | None,
    host: str,
    port: int,
    allow_remote: bool,
    name: str,
    send: tuple[str, ...],
    as_json: bool,
) -> None:
    """Open the studio on a workspace: prints the address to open, and one for those who may only look."""
    with errors_in_words():
        serve(
            workspace or Workspace().root,
            Listening(host, port, allow_remote, name),
            send_poses=send,
            announce=_announcer(as_json),
        )
