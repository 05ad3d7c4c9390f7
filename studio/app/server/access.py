"""Who may talk to the server: one person, from this machine, through the address that was printed.

A random token stands in the printed address once; the first request exchanges it for a cookie that scripts
cannot read and other sites' pages do not send. Every request must name an expected Host (which defeats DNS
rebinding); everything but a plain GET, and every WebSocket, must come from our own origin. There is no
CORS. The cookie holds a digest of the token, so neither is ever found where the other leaks, and its name
is derived from the token, so that two studios on one machine (cookies know no ports) do not log each other
out.

A second token makes a viewer: who came with it may send GETs, hear the events, and choose what the scene of a window of
its own shows. Everything else is refused here, before any route; of what its 3-D client sends, only where it looks from
passes the relay. `VIEWING` says inside a request whether it is a viewer's. A browser that has both cookies is the
owner's; how much viewers may take of the machine is in `viewers_budget`.

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
from contextvars import ContextVar
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import NamedTuple
from urllib.parse import parse_qsl, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from studio.app.server.error_responses import error_response
from studio.foundations.errors import AccessError

SAFE_METHODS = frozenset(("GET", "HEAD"))
HOST = re.compile(
    r"(?:(?P<name>[A-Za-z0-9._-]{1,253})|\[(?P<address>[0-9A-Fa-f:.]{2,45})\])(?::(?P<port>\d{1,5}))?",
    re.ASCII,
)
LAST_PORT = 65535
HEALTH_PATH = "/health"
"""The answer to requests with the right name."""
LOOPBACK_NAMES = frozenset(("localhost", "127.0.0.1", "::1"))
VIEWING: ContextVar[bool] = ContextVar("viewing", default=False)
"""Whether the request that is being answered is a viewer's."""
VIEWERS_POSTS = frozenset(f"/api/scene/{what}" for what in ("show", "view", "play-layers", "camera", "point"))
"""They change what the caller's own scene shows, and nothing else."""
MAKING_PAGES = frozenset(("/way", "/recording"))
"""Pages on which there is nothing to look at."""
OWNERS_READING = ("/api/folders", "/api/uploads", "/api/trash")
"""Addresses that are about the owner's machine, beside the sessions."""
VIEWERS_WINDOW = "view-"
"""Begins the names of viewers' windows, whatever they call themselves: they cannot move the scenes of others."""
WINDOW_HEADER = b"x-studio-window"


class ReadOnlyError(AccessError, code="read-only"):
    """A viewer wanted to change something."""


def new_token() -> str:
    """256 random bits as text that may stand in an address."""
    return secrets.token_urlsafe(32)


class Tokens(NamedTuple):
    """What lets a browser in.

    owner : all of it.
    viewers : one that may only look; "" lets none in.
    """

    owner: str
    viewers: str = ""


@dataclass(frozen=True, slots=True)
class HostRule:
    """Which Host headers are answered. names : lower-case host names. addresses : whether any IP address is
    too. encrypted : those of the names that a proxy with TLS answers to; cookies for them travel over TLS only.

    A rebinding attack needs a *name* of the attacker's, so literal addresses are harmless where remote use
    is allowed.
    """

    names: frozenset[str]
    addresses: bool = False
    encrypted: frozenset[str] = frozenset()

    def allows(self, header: str) -> bool:
        """Whether a Host header (name or address, with or without a port) is one of ours."""
        name = host_name(header)
        return name in self.names or (self.addresses and _address(name) is not None)


def binding_rule(host: str, allow_remote: bool, proxy: str = "") -> HostRule:
    """The Host headers to answer when listening on `host`. proxy : the name of a proxy with TLS before it, if any.

    Raises AccessError for anything but this machine's own loopback, unless `allow_remote`; and for no host name.
    """
    rule = _binding_rule(host, allow_remote)
    if not proxy:
        return rule
    if host_name(proxy) != proxy.lower() or _address(proxy) is not None:
        raise AccessError(f"'{proxy}' is no host name.", "Give the proxy's, without scheme and port.")
    name = frozenset((proxy.lower(),))
    return HostRule(rule.names | name, rule.addresses, name)


def _binding_rule(host: str, allow_remote: bool) -> HostRule:
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
    return HostRule(
        LOOPBACK_NAMES | own | ({name} if address is None and name else set[str]()), addresses=True
    )


def host_name(header: str) -> str:
    """The name or address in a Host header, lower case, without port and brackets; "" if it is malformed."""
    match = HOST.fullmatch(header)
    if match is None or int(match["port"] or 0) > LAST_PORT:
        return ""
    return (match["name"] or match["address"]).lower()


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
    """ASGI middleware that refuses as the module's text says. viewers_token : "" lets no viewers in."""

    def __init__(self, app: ASGIApp, *, token: str, hosts: HostRule, viewers_token: str = "") -> None:
        self.app = app
        self.hosts = hosts
        self._keys = [_Key.of(token, viewing=False)]
        if viewers_token:
            self._keys.append(_Key.of(viewers_token, viewing=True))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, refuse, exchange the token, or pass on."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        redirect = self._exchanged(scope)
        if redirect is not None:
            await redirect(scope, receive, send)
            return
        viewing, refusal = self._check_request(scope)
        if refusal is None:
            before = VIEWING.set(viewing)
            try:
                await self.app(_in_viewers_window(scope) if viewing else scope, receive, send)
            finally:
                VIEWING.reset(before)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": refusal.message})
        else:
            await error_response(refusal, page=not scope["path"].startswith("/api"))(scope, receive, send)

    def _exchanged(self, scope: Scope) -> RedirectResponse | None:
        """The answer to a printed address: the cookie, and a redirect to the address without the token."""
        if scope["type"] != "http" or scope["method"] != "GET" or scope["path"] != "/":
            return None
        query = parse_qsl(scope["query_string"].decode("latin-1"))
        offered = [value for key, value in query if key == "token"]
        if not offered or not self.hosts.allows(Headers(scope=scope).get("host", "")):
            return None
        key = next((key for key in self._keys if key.is_token(offered[0])), None)
        if key is None:
            return None
        rest = urlencode([(name, value) for name, value in query if name != "token"])
        answer = RedirectResponse(f"/?{rest}" if rest else "/", status_code=303)
        secure = host_name(Headers(scope=scope).get("host", "")) in self.hosts.encrypted
        answer.set_cookie(
            key.cookie_name, key.cookie, path="/", httponly=True, samesite="strict", secure=secure
        )
        answer.headers["cache-control"] = "no-store"
        return answer

    def _check_request(self, scope: Scope) -> tuple[bool, AccessError | None]:
        """Whether a request is a viewer's, and why it is not answered, if it is not."""
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if not self.hosts.allows(host) or len(headers.getlist("host")) != 1:
            return False, AccessError(
                "The request names a host that is not this studio.", "Open the printed address."
            )
        if scope["type"] == "http" and scope["method"] in SAFE_METHODS and scope["path"] == HEALTH_PATH:
            return False, None
        kind, _, sent = headers.get("authorization", "").partition(" ")
        by_header = next(
            (key for key in self._keys if kind.lower() == "bearer" and key.is_token(sent.strip())), None
        )
        key = by_header or self._by_cookie(headers)
        if key is None:
            return False, AccessError(
                "This browser has not been let in.", "Open the address with the token that 'studio' printed."
            )
        origin = headers.get("origin")
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS
        # A script that sends the token itself is no browser led astray by another site, and has no origin
        # to name.
        if (origin is not None or by_header is None) and changes and not same_origin(origin or "", host):
            return key.viewing, AccessError(
                "The request comes from another site.",
                "Use the studio's own page, or send the token as Bearer.",
            )
        if key.viewing and not _only_looks(scope):
            return True, ReadOnlyError(
                "This address is for looking: it changes nothing.",
                "Ask whoever started the studio for the other address that it printed.",
            )
        return key.viewing, None

    def _by_cookie(self, headers: Headers) -> "_Key | None":
        jar: SimpleCookie = SimpleCookie()
        try:
            jar.load(headers.get("cookie", ""))
        except CookieError:
            return None
        for key in self._keys:
            cookie = jar.get(key.cookie_name)
            if cookie is not None and key.is_cookie(cookie.value):
                return key
        return None


@dataclass(frozen=True, slots=True)
class _Key:
    """A token and the cookie that it is exchanged for, under a name of its own. viewing : whether it only lets look."""

    token: bytes
    cookie_name: str
    cookie: str
    viewing: bool

    @classmethod
    def of(cls, token: str, *, viewing: bool) -> "_Key":
        return cls(
            token.encode(),
            f"studio_{hashlib.sha256(b'name' + token.encode()).hexdigest()[:12]}",
            hmac.new(token.encode(), b"studio cookie", hashlib.sha256).hexdigest(),
            viewing,
        )

    def is_token(self, text: str) -> bool:
        return hmac.compare_digest(text.encode(), self.token)

    def is_cookie(self, text: str) -> bool:
        return hmac.compare_digest(text.encode(), self.cookie.encode())


def _only_looks(scope: Scope) -> bool:
    """Whether a request changes nothing but what its own window's scene shows."""
    path: str = scope["path"]
    if scope["type"] == "websocket":
        return path in ("/api/events", "/scene") or path.startswith("/scene/")
    if scope["method"] in SAFE_METHODS:
        return path.rstrip("/") not in MAKING_PAGES and not path.startswith(OWNERS_READING)
    return scope["method"] == "POST" and path in VIEWERS_POSTS


def _in_viewers_window(scope: Scope) -> Scope:
    """The request with its window's name among the viewers' ones, wherever it stands."""
    name = VIEWERS_WINDOW.encode()
    headers = [(key, name + value if key == WINDOW_HEADER else value) for key, value in scope["headers"]]
    if not any(key == WINDOW_HEADER for key, _ in headers):
        headers.append((WINDOW_HEADER, name))
    changed: dict[str, object] = {"headers": headers}
    if scope["type"] == "websocket" and scope["path"] == "/api/events":
        query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        windows = [value for key, value in query if key == "window"]
        changed["query_string"] = urlencode({"window": VIEWERS_WINDOW + (windows or [""])[-1]}).encode()
    elif scope["type"] == "websocket":
        changed["path"] = f"/scene/{VIEWERS_WINDOW}{scope['path'].removeprefix('/scene').strip('/')}"
        changed["raw_path"] = str(changed["path"]).encode()
    return {**scope, **changed}
