"""Who may talk to the server: one person, from this machine, through the address that was printed.

A random token stands in the printed address once; the first request exchanges it for a cookie that scripts
cannot read and other sites' pages do not send. Every request must name an expected Host (which defeats DNS
rebinding); everything but a plain GET, and every WebSocket, must come from our own origin. There is no
CORS. The cookie holds a digest of the token, so neither is ever found where the other leaks, and its name
is derived from the token, so that two studios on one machine (cookies know no ports) do not log each other
out.

What remains: since cookies know no ports, a browser also sends this one to other servers on the same host name that a
person opens in it, and whoever runs such a server could use it until this studio ends. Plain HTTP on loopback has no
`__Host-` cookie that would prevent it.
"""

import hashlib
import hmac
import ipaddress
import re
import secrets
import socket
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from studio.errors import AccessError
from studio.web.error_responses import error_response

SAFE_METHODS = frozenset(("GET", "HEAD"))
HOST = re.compile(
    r"(?:(?P<name>[A-Za-z0-9._-]{1,253})|\[(?P<address>[0-9A-Fa-f:.]{2,45})\])(?::(?P<port>\d{1,5}))?",
    re.ASCII,
)
LAST_PORT = 65535
HEALTH_PATH = "/health"
"""Answered to whoever asks by the right name."""
LOOPBACK_NAMES = frozenset(("localhost", "127.0.0.1", "::1"))


def new_token() -> str:
    """256 random bits as text that may stand in an address."""
    return secrets.token_urlsafe(32)


@dataclass(frozen=True, slots=True)
class HostRule:
    """Which Host headers are answered. names : lower-case host names. addresses : whether any IP address is
    too.

    A rebinding attack needs a *name* of the attacker's, so literal addresses are harmless where remote use
    is allowed.
    """

    names: frozenset[str]
    addresses: bool = False

    def allows(self, header: str) -> bool:
        """Whether a Host header (name or address, with or without a port) is one of ours."""
        name = host_name(header)
        return name in self.names or (self.addresses and _address(name) is not None)


def binding_rule(host: str, allow_remote: bool) -> HostRule:
    """The Host headers to answer when listening on `host`.

    Raises AccessError for anything but this machine's own loopback, unless `allow_remote`.
    """
    name = host.strip().lower().strip("[]")
    address = _address(name)
    if name == "localhost" or (address is not None and address.is_loopback):
        return HostRule(LOOPBACK_NAMES | {name})
    if not allow_remote:
        raise AccessError(
            f"Listening on '{host}' would let other machines in.",
            "Use 127.0.0.1, or add --allow-remote if that is what you want.",
        )
    own = {socket.gethostname().lower(), socket.getfqdn().lower()}
    return HostRule(LOOPBACK_NAMES | own | ({name} if address is None and name else set()), addresses=True)


def host_name(header: str) -> str:
    """The name or address in a Host header, lower case, without port and brackets; "" if it is malformed."""
    found = HOST.fullmatch(header)
    if found is None or int(found["port"] or 0) > LAST_PORT:
        return ""
    return (found["name"] or found["address"]).lower()


def same_origin(origin: str, host: str) -> bool:
    """Whether an Origin header names the very host and port that the request was sent to."""
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and bool(host) and parts.netloc.lower() == host.lower()


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(name)
    except ValueError:
        return None


class AccessGuard:
    """ASGI middleware: refuses what the module's text refuses, before anything else runs."""

    def __init__(self, app: ASGIApp, *, token: str, hosts: HostRule) -> None:
        self.app = app
        self.hosts = hosts
        self.cookie_name = f"studio_{hashlib.sha256(b'name' + token.encode()).hexdigest()[:12]}"
        self._token = token.encode()
        self._cookie = hmac.new(self._token, b"studio cookie", hashlib.sha256).hexdigest()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, refuse, exchange the token, or pass on."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        redirect = self._exchanged(scope)
        if redirect is not None:
            await redirect(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is None:
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": refusal.message})
        else:
            await error_response(refusal, page=not scope["path"].startswith("/api"))(scope, receive, send)

    def _exchanged(self, scope: Scope) -> RedirectResponse | None:
        """The answer to the printed address: the cookie, and a redirect to the address without the token."""
        if scope["type"] != "http" or scope["method"] != "GET" or scope["path"] != "/":
            return None
        query = parse_qsl(scope["query_string"].decode("latin-1"))
        offered = [value for key, value in query if key == "token"]
        if not offered or not self.hosts.allows(Headers(scope=scope).get("host", "")):
            return None
        if not hmac.compare_digest(offered[0].encode(), self._token):
            return None
        rest = urlencode([(key, value) for key, value in query if key != "token"])
        answer = RedirectResponse(f"/?{rest}" if rest else "/", status_code=303)
        answer.set_cookie(self.cookie_name, self._cookie, path="/", httponly=True, samesite="strict")
        answer.headers["cache-control"] = "no-store"
        return answer

    def _refusal(self, scope: Scope) -> AccessError | None:
        """Why a request is not answered, if it is not."""
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if not self.hosts.allows(host) or len(headers.getlist("host")) != 1:
            return AccessError(
                "The request names a host that is not this studio.", "Open the printed address."
            )
        if scope["type"] == "http" and scope["method"] in SAFE_METHODS and scope["path"] == HEALTH_PATH:
            return None
        bearer = headers.get("authorization", "").partition(" ")
        by_header = bearer[0].lower() == "bearer" and hmac.compare_digest(
            bearer[2].strip().encode(), self._token
        )
        if not by_header and not self._has_cookie(headers):
            return AccessError(
                "This browser has not been let in.", "Open the address with the token that 'studio' printed."
            )
        origin = headers.get("origin")
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS
        # A script that sends the token itself is no browser led astray by another site, and has no origin
        # to name.
        if (origin is not None or not by_header) and changes and not same_origin(origin or "", host):
            return AccessError(
                "The request comes from another site.",
                "Use the studio's own page, or send the token as Bearer.",
            )
        return None

    def _has_cookie(self, headers: Headers) -> bool:
        jar: SimpleCookie = SimpleCookie()
        try:
            jar.load(headers.get("cookie", ""))
        except CookieError:
            return False
        found = jar.get(self.cookie_name)
        return found is not None and hmac.compare_digest(found.value.encode(), self._cookie.encode())
