"""Addresses to which poses of live runs are sent: `osc://HOST:PORT`, `ws://HOST:PORT`."""

import os
import re
from dataclasses import dataclass
from urllib.parse import urlsplit

from studio.foundations.errors import RunError

VARIABLE = "STUDIO_SEND_POSES"
"""Addresses with commas between, for runs that are tracked by a server."""
USUAL_PORTS = {"osc": 39539, "ws": 8766}
REMEDY = "Write osc://HOST:PORT or ws://HOST:PORT; without a host it is this machine."


@dataclass(frozen=True, slots=True)
class SendAddress:
    """kind : "osc" or "ws"."""

    kind: str
    host: str
    port: int


def send_address(text: str) -> SendAddress:
    """`osc://127.0.0.1:39539`, `ws://:8766`, or `osc` alone. Raises RunError."""
    kind, _, rest = text.strip().partition(":")
    try:
        parts = urlsplit(f"//{rest.removeprefix('//')}")
        host, port = parts.hostname or "127.0.0.1", parts.port or USUAL_PORTS.get(kind, 0)
    except ValueError:
        kind, host, port = "", "", 0
    if kind not in USUAL_PORTS or re.search(r"[/?#@]", rest.removeprefix("//").rstrip("/")):
        raise RunError(f"'{text[:60]}' is no address to send poses to.", REMEDY)
    return SendAddress(kind, host, port)


def addresses_from_environment() -> tuple[SendAddress, ...]:
    """Those of `VARIABLE`. Raises RunError."""
    texts = (text for text in os.environ.get(VARIABLE, "").split(",") if text.strip())
    return tuple(send_address(text) for text in texts)
