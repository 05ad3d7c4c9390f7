"""What is checked of a camera's address is what is connected to: no redirect, no name that changes, no endless part."""

import contextlib
import resource
import socket
import threading
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from mjpeg_streams import jpeg, served

from studio.footage.capture.camera_addresses import camera_address, without_own
from studio.footage.capture.camera_streams import open_stream
from studio.foundations.errors import FootageError

NEVER = lambda seconds: False  # noqa: E731


class Listening:
    """A server on loopback that gives one answer to every connection, and records the requests."""

    def __init__(self, answer: bytes, more: bytes = b"", pieces: int = 0) -> None:
        self.answer, self.more, self.pieces = answer, more, pieces
        self.requests: list[bytes] = []
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self.server.getsockname()[1]

    def run(self) -> None:
        while True:
            try:
                client, _ = self.server.accept()
            except OSError:
                return
            with client, contextlib.suppress(OSError):
                client.settimeout(5.0)
                self.requests.append(client.recv(65536))
                sequence = self.requests[-1].partition(b"CSeq: ")[2].partition(b"\r\n")[0]
                client.sendall(self.answer.replace(b"SEQUENCE", sequence))
                for _ in range(self.pieces):
                    client.sendall(self.more)


@contextlib.contextmanager
def listening(answer: bytes, more: bytes = b"", pieces: int = 0) -> Iterator[Listening]:
    server = Listening(answer, more, pieces)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.server.shutdown(socket.SHUT_RDWR)
        server.server.close()
        thread.join(5.0)


def picture() -> np.ndarray:
    coarse = np.random.default_rng(2).integers(0, 255, (3, 4, 3), dtype=np.uint8)
    return cv2.resize(coarse, (64, 48), interpolation=cv2.INTER_CUBIC)


@pytest.mark.parametrize("code", ["301 Moved", "302 Found", "307 Temporary", "308 Permanent"])
def test_a_camera_that_leads_elsewhere_is_not_followed(code: str) -> None:
    with listening(b"") as secret:
        to = f"HTTP/1.1 {code}\r\nLocation: http://127.0.0.1:{secret.port}/\r\nContent-Length: 0\r\n\r\n"
        with listening(to.encode()) as camera:
            address = without_own(camera_address("cam1", f"http://127.0.0.1:{camera.port}/"), (secret.port,))
            with pytest.raises(FootageError, match="leads to another address"):
                next(open_stream(address, NEVER))
        assert camera.requests
        assert secret.requests == []


def test_an_rtsp_camera_that_leads_elsewhere_is_not_followed() -> None:
    with listening(b"") as secret:
        to = f"RTSP/1.0 302 Moved\r\nCSeq: SEQUENCE\r\nLocation: rtsp://127.0.0.1:{secret.port}/x\r\n\r\n"
        with listening(to.encode()) as camera:
            address = camera_address("cam1", f"rtsp://ich:geheim@127.0.0.1:{camera.port}/live")
            with pytest.raises(FootageError, match="leads to another address") as caught:
                next(open_stream(address, NEVER))
            assert "geheim" not in str(caught.value)
        assert b"/live" in camera.requests[0]
        assert secret.requests == []


def test_a_name_that_leads_elsewhere_later_is_refused_then(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is resolved once for each connection, and what was checked is what is connected to."""
    answers = ["93.184.216.34", "127.0.0.1"]
    resolved: list[str] = []

    def resolve(host: str, port: int, *_: object, **__: object) -> list[object]:
        resolved.append(host)
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (answers[min(len(resolved), 2) - 1], port))]

    with listening(b"") as secret:
        with monkeypatch.context() as patched:
            patched.setattr("studio.footage.capture.camera_addresses.socket.getaddrinfo", resolve)
            address = without_own(
                camera_address("cam1", f"http://rebind.example:{secret.port}/"), (secret.port,)
            )
            with pytest.raises(FootageError, match="is no camera"):
                next(open_stream(address, NEVER))
        assert resolved == ["rebind.example"] * 2
        assert secret.requests == []


def test_the_machine_that_was_checked_gets_the_cameras_own_name(monkeypatch: pytest.MonkeyPatch) -> None:
    content = jpeg(picture())
    head = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=--b\r\n\r\n"
    part = b"--b\r\nContent-Type: image/jpeg\r\n\r\n" + content + b"\r\n"
    with listening(head, part, 50) as camera:

        def resolve(host: str, port: int, *_: object, **__: object) -> list[object]:
            assert host in ("camera.local", "127.0.0.1")
            return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", port))]

        monkeypatch.setattr("studio.footage.capture.camera_addresses.socket.getaddrinfo", resolve)
        address = camera_address("cam1", f"http://camera.local:{camera.port}/video?x=1")
        shot = next(open_stream(address, NEVER))
        assert shot.jpeg == content
        assert np.abs(shot.pixels.astype(int) - cv2.imdecode(np.frombuffer(content, np.uint8), 1)).mean() < 8
        request = camera.requests[0].lower()
        assert request.startswith(b"get /video?x=1 ")
        assert f"host: camera.local:{camera.port}".encode() in request


@pytest.mark.parametrize(
    ("answer", "more", "why"),
    [
        (b"--b\r\nContent-Length: 99000000000\r\n\r\n", b"x" * 65536, "announces a picture of 99000 MB"),
        (b"--b\r\nContent-Length: 99999999999999999999999999\r\n\r\n", b"x" * 65536, "has no end"),
        (b"--b\r\nContent-Type: image/jpeg\r\n\r\n", b"x" * 65536, "has no end"),
        (b"--b\r\nX: ", b"y" * 65536, "sends no pictures"),
        (b"", b"z" * 65536, "sends no pictures"),
    ],
)
def test_parts_without_measure_are_refused(answer: bytes, more: bytes, why: str) -> None:
    head = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n"
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with listening(head + answer, more, 4000) as camera:
        address = camera_address("cam1", f"http://127.0.0.1:{camera.port}/")
        with pytest.raises(FootageError, match=why):
            next(open_stream(address, NEVER))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000


def test_a_password_is_sent_on_request() -> None:
    with served({"a": [jpeg(picture())]}) as streams:
        streams.locked.add("a")
        url = streams.address("a").replace("http://", "http://ich:ge%20heim@")
        assert next(open_stream(camera_address("cam1", url), NEVER)).jpeg
        assert streams.passwords == [None, "Basic aWNoOmdlIGhlaW0="]
        with pytest.raises(FootageError, match="401"):
            next(open_stream(camera_address("cam1", streams.address("a")), NEVER))
