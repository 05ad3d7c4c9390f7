"""Builds workspace, worker, scene and web, opens them in order, and closes them all at the end."""

import logging
import logging.handlers
import os
import re
import socket
import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType, MappingProxyType
from typing import NamedTuple
from urllib.parse import urlencode

import click
import uvicorn

from studio.app.server.access import HostRule, Tokens, binding_rule, new_token
from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import read_text
from studio.operations.gallery import prepare_demo
from studio.operations.jobs.commands import Open, about
from studio.operations.jobs.control import StudioControl
from studio.operations.jobs.send_addresses import VARIABLE, addresses_from_environment
from studio.sessions.atomic_files import write_text
from studio.sessions.process_lock import ProcessLock
from studio.sessions.stored_run import StoredRun
from studio.sessions.work_under_way import STATE_NAME
from studio.sessions.workspace import Workspace

Announce = Callable[[str], None]

PORT = 8642
LOG_NAME = "server.log"
LOG_BYTES, LOG_FILES = 2_000_000, 3
SECONDS_TO_CLOSE, SECONDS_TO_END = 1, 5.0
SERVER_LOCK, SERVER_ADDRESS = "server.lock", "server.address"
UNKNOWN_ADDRESS = "an address that is not known yet"
TOKEN_IN_ADDRESS = re.compile(r"(token=)[A-Za-z0-9_%-]+")


DEMO_RUN = "ten-layers"
DEMO_SHOWS = MappingProxyType(
    {
        "session": "walk",
        "run": DEMO_RUN,
        "frame": "10",
        "panel": "views",
        "view": "variance",
        "plays": "layers",
    }
)


class Opening(NamedTuple):
    """What a studio opens with. run : opened in the tracking process. query : the page's state in the address."""

    run: StoredRun
    query: Mapping[str, str]


class PortTakenError(StudioError):
    """Something else listens where the studio should."""

    status, code = 409, "port"


class WorkspaceServedError(StudioError):
    """Another server works on the workspace."""

    status, code = 409, "served"


@dataclass(frozen=True, slots=True)
class Listening:
    """Where the studio listens.

    port : 0 takes a free one.
    allow_remote : hosts beyond this machine's loopback are allowed.
    name : the host name of a proxy with TLS before the studio, which is served at https://NAME/ then.
    """

    host: str = "127.0.0.1"
    port: int = PORT
    allow_remote: bool = False
    name: str = ""


def serve(
    workspace_root: Path,
    listening: Listening | None = None,
    *,
    first: Callable[[], Opening] | None = None,
    send_poses: Sequence[str] = (),
    announce: Announce = click.echo,
) -> None:
    """Serve the studio on a workspace until Ctrl-C.

    first : what the printed address shows; its run is opened and made ready at once.
    send_poses : addresses (`operations.jobs.send_addresses`) to which live runs send their poses.
    announce : called once with the addresses (`printed`).

    Raises StudioError for an address that is none, a host that needs `allow_remote`, a port that is taken, or a
    workspace that cannot be written.
    """
    listening = listening or Listening()
    host, name = listening.host, listening.name
    hosts = binding_rule(host, listening.allow_remote, name)
    if send_poses:
        os.environ[VARIABLE] = ",".join(send_poses)
        addresses_from_environment()
    workspace = Workspace(workspace_root)
    log_path = _log_to_file(workspace.root / STATE_NAME)
    tokens = Tokens(new_token(), new_token())
    with _alone_on(workspace.root) as show_address, _listening(host, listening.port) as listener:
        show_address(f"http://{_host_of(host)}:{listener.getsockname()[1]}")
        control = StudioControl(workspace)
        try:
            # The other process loads what it needs, and compiles the run's kernels, while this one loads the server.
            control.start()
            opening = None if first is None else first()
            if opening is not None:
                control.send(Open(**about(opening.run.folder), warm=True))
            app = _app(workspace, control, tokens, hosts, log_path)
            at = f"https://{name}" if name else f"http://{_host_of(host)}:{listener.getsockname()[1]}"
            place: Mapping[str, str] = {} if opening is None else opening.query
            shown = (address(at, key, place) for key in tokens)
            announce(printed(*shown, plainly=listening.allow_remote and not name))
            _serve_until_stopped(app, listener)
        finally:
            control.close()


def demo(workspace_root: Path, port: int = 0, *, announce: Announce = click.echo) -> None:
    """The bundled walk in the browser: a frame that is searched already, its layers playing; until Ctrl-C."""

    def first() -> Opening:
        return Opening(prepare_demo(workspace_root).run(DEMO_RUN), DEMO_SHOWS)

    serve(workspace_root, Listening(port=port), first=first, announce=announce)


def printed(full: str, viewers: str, plainly: bool) -> str:
    """What is said once the studio is served. plainly : other machines reach it without TLS."""
    lines = [f"Open {full}", f"For viewers, who change nothing: {viewers}"]
    if plainly:
        lines.append(
            "Between machines all of this, tokens too, travels unencrypted: use it in a network that you trust, or put "
            "a proxy with TLS before it (--name; see the guide), or a tunnel (ssh -L)."
        )
    return "\n".join(lines)


def address(at: str, token: str, shown: Mapping[str, str] = MappingProxyType({})) -> str:
    """The address to open; it holds the token. at : scheme, host and port. shown : the page's state, by its names."""
    return f"{at}/?{urlencode({'token': token, **shown})}"


def _host_of(host: str) -> str:
    """The host for a URL: this machine's name if it listens on all addresses."""
    name = socket.gethostname() if host in ("0.0.0.0", "::", "") else host
    return f"[{name}]" if ":" in name else name


def served_at(root: Path) -> str:
    """Where a workspace is being served, without the token; "" where no living process serves it."""
    folder = root / STATE_NAME
    if not ProcessLock.is_held(folder / SERVER_LOCK):
        return ""
    try:
        return read_text(folder / SERVER_ADDRESS) or UNKNOWN_ADDRESS
    except OSError:
        return UNKNOWN_ADDRESS


@contextmanager
def _alone_on(root: Path) -> Generator[Callable[[str], None]]:
    """Hold the lock of a served workspace; yields the function that stores the address. Raises WorkspaceServedError."""
    folder = root / STATE_NAME
    lock = ProcessLock.take(folder / SERVER_LOCK)
    if lock is None:
        raise WorkspaceServedError(
            f"The workspace '{root}' is served already, at {served_at(root) or UNKNOWN_ADDRESS}.",
            "Open the address that the other one printed, stop it, or choose another workspace with --workspace.",
        )
    try:
        yield lambda text: write_text(folder / SERVER_ADDRESS, text)
    finally:
        with suppress(OSError):
            (folder / SERVER_ADDRESS).unlink(missing_ok=True)
        lock.free()


def _app(
    workspace: Workspace, control: StudioControl, tokens: Tokens, hosts: HostRule, log_path: Path
) -> object:
    """The server, which takes a second and more to load."""
    from studio.app.scene.window_scenes import WindowScenes  # noqa: PLC0415
    from studio.app.server.app import build_app  # noqa: PLC0415
    from studio.app.server.safe_paths import default_footage_roots  # noqa: PLC0415

    return build_app(
        workspace,
        control,
        WindowScenes(workspace, control),
        tokens,
        hosts=hosts,
        footage_roots=default_footage_roots(workspace.root),
        log_path=log_path,
    )


def _listening(host: str, port: int) -> socket.socket:
    """A socket that listens, so that the port is known (and ours) before anything else starts."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host.strip("[]"), port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise PortTakenError(
            f"The studio cannot listen on '{host}' port {port} ({error.strerror or error}).",
            "Choose another port with --port, or 0 for a free one.",
        ) from None
    return listener


def _serve_until_stopped(app: object, listener: socket.socket) -> None:
    """Serve until a signal; open sockets get a moment to say goodbye."""
    config = uvicorn.Config(
        app,  # pyright: ignore[reportArgumentType] - any ASGI application
        log_config=None,
        access_log=False,
        server_header=False,
        ws="auto",
        ws_max_size=64 << 20,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=SECONDS_TO_CLOSE,
    )
    try:
        _EndingServer(config).run(sockets=[listener])
    except KeyboardInterrupt:
        return


class _EndingServer(uvicorn.Server):
    """Ends the process so many seconds after the signal to end, whatever a thread is waiting for: of what is stored
    nothing is lost by it, and the tracking process ends with this one.
    """

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if not self.should_exit:
            timer = threading.Timer(SECONDS_TO_END, _end_now, (sig,))
            timer.daemon = True
            timer.start()
        super().handle_exit(sig, frame)


def _end_now(number: int) -> None:
    logging.getLogger("studio.cli.launch").warning("a thread did not end; the server ended without it")
    logging.shutdown()
    os._exit(128 + number)


def _log_to_file(folder: Path) -> Path:
    """Warnings and errors of all rooms go to a file that never holds a token; returns where it is."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handler = logging.handlers.RotatingFileHandler(
            folder / LOG_NAME, maxBytes=LOG_BYTES, backupCount=LOG_FILES, encoding="utf-8", delay=True
        )
    except OSError as error:
        raise StudioError(
            f"The workspace '{folder.parent}' cannot be written ({error.strerror}).",
            "Choose another with --workspace.",
        ) from None
    handler.setLevel(logging.WARNING)
    handler.setFormatter(RedactedFormatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    root = logging.getLogger()
    for old in [entry for entry in root.handlers if isinstance(entry.formatter, RedactedFormatter)]:
        root.removeHandler(old)
        old.close()
    root.addHandler(handler)
    return folder / LOG_NAME


class RedactedFormatter(logging.Formatter):
    """Takes tokens out of whatever is logged, tracebacks included."""

    def format(self, record: logging.LogRecord) -> str:
        """The line without tokens."""
        return TOKEN_IN_ADDRESS.sub(r"\1…", super().format(record))
