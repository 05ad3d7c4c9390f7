"""RTSP cameras through a relay on loopback: FFmpeg resolves names itself and follows redirects; this does neither.

The relay connects to the machine that was checked, speaks TLS to it where the address says rtsps, and closes where the
camera answers with a redirect.
"""

import contextlib
import re
import select
import socket
import ssl
import threading
from collections.abc import Generator
from urllib.parse import urlsplit

from studio.footage.capture.camera_addresses import CameraAddress, machine_of
from studio.foundations.errors import FootageError

REDIRECT = re.compile(rb"RTSP/\d\.\d[ \t]+3\d\d")
OVERLAP = 24
"""Bytes of the last piece in which a redirect's first line may have begun."""
PIECE = 1 << 16
LOOK_SECONDS = 0.5


@contextlib.contextmanager
def relayed(address: CameraAddress, patience: float) -> Generator[str]:
    """The address (with its name and password) at which FFmpeg reaches the camera while the block lasts.

    patience : seconds to connect. Raises FootageError, OSError.
    """
    machine, port = machine_of(address)
    parts = urlsplit(address.url)
    camera = socket.create_connection((machine, port), patience)
    over = threading.Event()
    redirected = threading.Event()
    with contextlib.ExitStack() as stack:
        stack.callback(camera.close)
        if parts.scheme.lower() == "rtsps":
            context = ssl.create_default_context()
            # Cameras sign their certificates themselves.
            context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
            camera = stack.enter_context(context.wrap_socket(camera, server_hostname=parts.hostname))
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=1))
        listener.settimeout(patience)
        thread = threading.Thread(
            target=_relay, args=(listener, camera, over, redirected), name="rtsp relay", daemon=True
        )
        thread.start()
        who = f"{parts.netloc.rpartition('@')[0]}@" if "@" in parts.netloc else ""
        query = f"?{parts.query}" if parts.query else ""
        try:
            yield f"rtsp://{who}127.0.0.1:{listener.getsockname()[1]}{parts.path}{query}"
        except Exception:
            if not redirected.is_set():
                raise
            raise FootageError(
                f"Camera {address.name} ({address.shown}) leads to another address, which is not followed.",
                "Give the camera's own address.",
            ) from None
        finally:
            over.set()
            thread.join(2.0 * LOOK_SECONDS)


def _relay(
    listener: socket.socket, camera: socket.socket, over: threading.Event, redirected: threading.Event
) -> None:
    """Bytes between FFmpeg and the camera until either closes, or a redirect comes."""
    with contextlib.suppress(OSError, ValueError):
        player, _ = listener.accept()
        listener.close()
        with player:
            before = b""
            while not over.is_set():
                pending = isinstance(camera, ssl.SSLSocket) and camera.pending() > 0
                ready = [camera] if pending else select.select([player, camera], [], [], LOOK_SECONDS)[0]
                for source in ready:
                    piece = source.recv(PIECE)
                    if not piece:
                        return
                    if source is camera:
                        if REDIRECT.search(before + piece):
                            redirected.set()
                            return
                        before = piece[-OVERLAP:]
                    (camera if source is player else player).sendall(piece)
