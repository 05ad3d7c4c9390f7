"""MJPEG over HTTP (`multipart/x-mixed-replace`): the JPEG files of a camera as they come.

The machine that was checked is the one that is connected to, a camera that answers with another address is not
followed, and no part is larger than a picture can be, whatever its header says.
"""

import re
from collections.abc import Callable, Generator, Iterator
from http import HTTPStatus
from urllib.parse import unquote, urlsplit

import httpx

from studio.footage.capture.camera_addresses import CameraAddress, machine_of
from studio.foundations.errors import FootageError

LARGEST_PICTURE = 32 << 20
LARGEST_HEADER = 8 << 10
BOUNDARY = re.compile(r'boundary="?([^";,]{1,200})', re.IGNORECASE)
LENGTH = re.compile(rb"^content-length:[ \t]*(\d{1,20})[ \t\r]*$", re.IGNORECASE | re.MULTILINE)
REMEDY = "Check that it is switched on, its address, and its name and password."


def mjpeg_parts(
    address: CameraAddress, wait: Callable[[float], bool], patience: tuple[float, float]
) -> Iterator[bytes]:
    """The parts of a stream, until it ends or `wait` returns True. patience : seconds to connect, to read.

    Raises FootageError, also in the middle; its words never hold the password.
    """
    machine, port = machine_of(address)
    parts = urlsplit(address.url)
    number = f"[{machine.replace('%', '%25')}]" if ":" in machine else machine
    query = f"?{parts.query}" if parts.query else ""
    url = f"{parts.scheme.lower()}://{number}:{port}{parts.path or '/'}{query}"
    headers = {"host": parts.netloc.rpartition("@")[2], "accept-encoding": "identity"}
    password = _Password(parts.username, parts.password) if parts.username is not None else None
    extensions = {"sni_hostname": parts.hostname}
    opening, reading = patience
    timeout = httpx.Timeout(reading, connect=opening)
    try:
        # Cameras sign their certificates themselves.
        with (
            httpx.Client(verify=False, trust_env=False, follow_redirects=False, timeout=timeout) as client,
            client.stream("GET", url, headers=headers, auth=password, extensions=extensions) as response,
        ):
            if response.is_redirect:
                raise _error_of(address, "it leads to another address, which is not followed")
            if response.status_code != HTTPStatus.OK:
                raise _error_of(
                    address, f"it answers {response.status_code} {response.reason_phrase}".strip()
                )
            named = BOUNDARY.search(response.headers.get("content-type", ""))
            boundary = named[1].strip().lstrip("-").encode("latin-1", "replace") if named else b""
            try:
                yield from _parts(response.iter_raw(), wait, boundary)
            except ValueError as problem:
                raise _error_of(address, str(problem)) from None
    except httpx.TimeoutException as problem:
        seconds = opening if isinstance(problem, httpx.ConnectTimeout) else reading
        raise _error_of(address, f"no data for {seconds:g} s") from None
    except (httpx.HTTPError, httpx.InvalidURL) as problem:
        # A library's own words may hold the address with its password.
        raise _error_of(address, type(problem).__name__) from None


class _Password(httpx.Auth):
    """Name and password, sent when the camera requires them: as digest if it supports that, else plain."""

    def __init__(self, name: str, password: str | None) -> None:
        self._given = unquote(name), unquote(password or "")

    def auth_flow(self, request: httpx.Request) -> Generator[httpx.Request, httpx.Response, None]:
        digest = httpx.DigestAuth(*self._given).auth_flow(request)
        response = yield next(digest)
        try:
            digested = digest.send(response)
        except StopIteration:
            if response.status_code == HTTPStatus.UNAUTHORIZED:
                yield next(httpx.BasicAuth(*self._given).auth_flow(request))
            return
        yield digested


def _parts(chunks: Iterator[bytes], wait: Callable[[float], bool], boundary: bytes) -> Iterator[bytes]:
    """The bodies of a multipart stream. Raises ValueError where it is none."""
    buffer, mark = bytearray(), b"--" + boundary
    length: int | None = None
    in_body, searched = False, 0
    for chunk in chunks:
        if wait(0.0):
            return
        buffer += chunk
        while True:
            if not in_body:
                end = _end_of_header(buffer, mark)
                if end is None:
                    break
                header = LENGTH.search(buffer, 0, end)
                length = int(header[1]) if header else None
                if length is not None and length > LARGEST_PICTURE:
                    raise ValueError(f"it announces a picture of {length / 1e6:.0f} MB")
                del buffer[:end]
                in_body = True
            end = length if length is not None else buffer.find(b"\r\n" + mark, searched)
            if end < 0 or end > len(buffer):
                searched = max(0, len(buffer) - len(mark) - 2)
                if len(buffer) > LARGEST_PICTURE:
                    raise ValueError("a picture of it has no end")
                break
            if end:
                yield bytes(buffer[:end])
            del buffer[:end]
            in_body, searched = False, 0


def _end_of_header(buffer: bytearray, mark: bytes) -> int | None:
    """Where the header of the next part ends, None while it has not all come. Raises ValueError."""
    start = buffer.find(mark)
    if start >= 0:
        for ending in (b"\r\n\r\n", b"\n\n"):
            end = buffer.find(ending, start)
            if end >= 0:
                return end + len(ending)
    if len(buffer) > LARGEST_HEADER:
        raise ValueError("it sends no pictures (MJPEG)")
    return None


def _error_of(address: CameraAddress, why: str) -> FootageError:
    return FootageError(f"Camera {address.name} ({address.shown}) gives no pictures ({why}).", REMEDY)
