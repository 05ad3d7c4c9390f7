"""Cameras that send MJPEG over HTTP, on loopback: a thread a connection, each picture when its time has come.

Until they are let go they send their first picture again and again; one that is silenced keeps its connection open and
says nothing more, one that is cut closes it, one that is locked asks for name and password.
"""

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np

BOUNDARY = "frame"


class Streams:
    """What is sent, by name. fps : pictures a second."""

    def __init__(self, pictures: Mapping[str, Sequence[bytes]], fps: float) -> None:
        self.pictures, self.fps = pictures, fps
        self.going, self.over = threading.Event(), threading.Event()
        self.silent: set[str] = set()
        self.cut: set[str] = set()
        self.locked: set[str] = set()
        self.port = 0
        self.passwords: list[str | None] = []

    def address(self, name: str) -> str:
        return f"http://127.0.0.1:{self.port}/{name}"

    def parts(self, name: str) -> Iterator[bytes]:
        """Pictures as they are due; ends when cut."""
        number = 0
        while not self.over.wait(1.0 / self.fps) and name not in self.cut:
            if name in self.silent:
                continue
            yield self.pictures[name][min(number, len(self.pictures[name]) - 1)]
            number += self.going.is_set()


def jpeg(picture: np.ndarray) -> bytes:
    """(H, W, 3) BGR as JPEG."""
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


@contextmanager
def served(pictures: Mapping[str, Sequence[bytes]], fps: float = 30.0) -> Iterator[Streams]:
    """A server of these streams until the block ends."""
    streams = Streams(pictures, fps)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            name = self.path.strip("/").partition("?")[0]
            streams.passwords.append(self.headers.get("Authorization"))
            if name not in streams.pictures or name in streams.cut:
                self.send_error(404)
                return
            if name in streams.locked and self.headers.get("Authorization") is None:
                self.send_response(401)
                self.send_header("WWW-Authenticate", 'Basic realm="camera"')
                self.end_headers()
                return
            self.send_response(200)
            self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}")
            self.end_headers()
            try:
                for content in streams.parts(name):
                    head = (
                        f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(content)}\r\n\r\n"
                    )
                    self.wfile.write(head.encode() + content + b"\r\n")
            except OSError:
                return

        def log_message(self, format: str, *args: object) -> None:
            return

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    streams.port = server.server_address[1]
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield streams
    finally:
        streams.over.set()
        server.shutdown()
        server.server_close()
        thread.join()
