"""Addresses of live cameras: `cam1=http://…`, `cam2=rtsp://…`, `cam3=/dev/video0`, or a video replayed as if it were
one.

Addresses come from users and pages, so only possible cameras are allowed: MJPEG over HTTP, RTSP, a video device of this
machine, and (if the caller may read files) a file. Local networks are allowed, because cameras are there; the studio's
own ports are not. A name is resolved once for each connection, and the checked machine is the one connected to
(`machine_of`). Shown or logged addresses never hold user name and password.
"""

import dataclasses
import ipaddress
import re
import socket
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from urllib.parse import SplitResult, urlsplit

from studio.foundations.errors import FootageError

Kind = Literal["http", "rtsp", "usb", "replay"]

SCHEMES: dict[str, Kind] = {"http": "http", "https": "http", "rtsp": "rtsp", "rtsps": "rtsp"}
USUAL_PORTS = {"http": 80, "https": 443, "rtsp": 554, "rtsps": 322}
DEVICE = re.compile(r"/dev/video\d{1,3}")
NAME = re.compile(r"[\w-]{1,40}")
LONGEST = 2000
CLOUD_SECRETS = frozenset(("169.254.169.254", "fd00:ec2::254", "100.100.100.200"))
"""Where hosting companies answer their machines with keys; no camera is there."""
REMEDY = "Give CAMERA=http://…, rtsp://…, /dev/video0 or the path of a video."


@dataclass(frozen=True, slots=True)
class CameraAddress:
    """A camera's name in the calibration, what kind of stream it has, and where. url : may hold a password, so it is
    left out of this value's own words; shown : the same without it. own_ports : of this machine, where no camera is.
    """

    name: str
    kind: Kind
    shown: str
    url: str = field(repr=False)
    own_ports: frozenset[int] = frozenset()


def address_from_text(text: str, *, replays: bool = False) -> CameraAddress:
    """`cam1=http://camera.local/stream`. replays : whether a video's path will do. Raises FootageError."""
    name, separator, place = text.partition("=")
    if not separator or "://" in name:
        raise FootageError("A camera was given without its name.", REMEDY)
    return camera_address(name.strip(), place.strip(), replays=replays)


def camera_address(name: str, place: str, *, replays: bool = False) -> CameraAddress:
    """The checked address of a camera. Raises FootageError for an impossible one."""
    if not NAME.fullmatch(name):
        raise FootageError(f"'{name[:60]}' is no name of a camera.", "Use letters, digits, '-' and '_'.")
    if not place or len(place) > LONGEST or any(ord(sign) < 33 for sign in place.replace(" ", "")):
        raise FootageError(f"Camera {name} has no address that can be read.", REMEDY)
    if DEVICE.fullmatch(place):
        return CameraAddress(name, "usb", place, place)
    scheme = place.partition("://")[0].lower() if "://" in place else ""
    if scheme in SCHEMES:
        parts = _split(name, place)
        return CameraAddress(name, SCHEMES[scheme], _without_secrets(parts), place)
    if replays and not scheme and Path(place).expanduser().is_file():
        path = Path(place).expanduser().resolve()
        return CameraAddress(name, "replay", path.name, str(path))
    if replays and not scheme:
        raise FootageError(f"There is no video '{place}' for camera {name}.", REMEDY)
    raise FootageError(f"Camera {name} cannot be reached by '{scheme or place[:60]}'.", REMEDY)


def without_own(address: CameraAddress, own_ports: Collection[int]) -> CameraAddress:
    """The address, kept off the studio's own ports whenever it is connected to. Raises FootageError where it leads
    there now, to keys, or to no machine at all.
    """
    kept_off = dataclasses.replace(address, own_ports=frozenset(own_ports))
    if address.kind in ("http", "rtsp"):
        machine_of(kept_off)
    return kept_off


def machine_of(address: CameraAddress) -> tuple[str, int]:
    """The machine (its number) and port of a camera in the network, to be connected to as they are: a name may lead
    elsewhere the next time. Raises FootageError where any of its machines is one that no camera is on.
    """
    own_ports = address.own_ports
    parts = urlsplit(address.url)
    port = parts.port or USUAL_PORTS[parts.scheme.lower()]
    try:
        places = socket.getaddrinfo(parts.hostname, port, type=socket.SOCK_STREAM)
    except OSError:
        raise FootageError(
            f"Camera {address.name}: there is no machine '{parts.hostname}'.", "Check the address."
        ) from None
    for _, _, _, _, place in places:
        machine = str(place[0]).partition("%")[0]
        if machine in CLOUD_SECRETS or (port in own_ports and _is_this_machine(machine)):
            raise FootageError(
                f"Camera {address.name}: '{parts.hostname}:{port}' is no camera.",
                "Give the camera's own address.",
            )
    return str(places[0][4][0]), port


def check_names(addresses: Collection[CameraAddress]) -> None:
    """Raises FootageError where two cameras have one name or one device."""
    for what in ("name", "url"):
        seen: set[str] = set()
        for address in addresses:
            value = getattr(address, what)
            if value in seen:
                raise FootageError(
                    f"Camera {address.name} is given twice.", "Give every camera its own name and address."
                )
            seen.add(value)


def _split(name: str, place: str) -> SplitResult:
    try:
        parts = urlsplit(place)
        _ = parts.port
    except ValueError:
        raise FootageError(f"Camera {name} has no address that can be read.", REMEDY) from None
    if not parts.hostname:
        raise FootageError(f"Camera {name} has an address without a machine.", REMEDY)
    return parts


def _without_secrets(parts: SplitResult) -> str:
    """Scheme, machine, port and path: names, passwords and queries (which hold keys) are left out."""
    host = f"[{parts.hostname}]" if ":" in (parts.hostname or "") else parts.hostname
    port = f":{parts.port}" if parts.port else ""
    return f"{parts.scheme}://{host}{port}{parts.path}" + ("?…" if parts.query else "")


def _is_this_machine(machine: str) -> bool:
    """Whether an address is one of this machine's own: only those can be bound."""
    address = ipaddress.ip_address(machine)
    mapped = getattr(address, "ipv4_mapped", None)
    if address.is_loopback or address.is_unspecified or (mapped is not None and mapped.is_loopback):
        return True
    family = socket.AF_INET6 if address.version == 6 else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((machine, 0))
        except OSError:
            return False
    return True
