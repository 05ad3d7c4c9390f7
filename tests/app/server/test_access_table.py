"""The guide's table of access: each promise, the request that tries to break it, and the answer that it gets here."""

from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from web_doubles import TOKEN, VIEWERS_TOKEN, Studio, cookie_header, let_in
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from studio.app.server.access import binding_rule
from studio.foundations.errors import AccessError

GUIDE = Path(__file__).parents[3] / "web_assets" / "guide" / "guide.md"
Request = Callable[[Studio], str]
ROWS: list[tuple[str, str, str, Request]] = []


def row(promise: str, request: str, answer: str) -> Callable[[Request], Request]:
    """A line of the table; the function makes the request and returns the answer."""

    def add(make: Request) -> Request:
        ROWS.append((promise, request, answer, make))
        return make

    return add


def said(answer: httpx.Response) -> str:
    code = answer.json().get("code", "") if "json" in answer.headers.get("content-type", "") else ""
    return f"{answer.status_code} {code}".strip()


def socket(studio: Studio, path: str, origin: str, cookie: str) -> str:
    address = studio.base.replace("http", "ws") + path
    try:
        with connect(address, origin=origin, additional_headers={"cookie": cookie}):  # pyright: ignore[reportArgumentType]
            return "open"
    except InvalidStatus as refused:
        return str(refused.response.status_code)


@row("A person without a printed address gets nothing", "`GET /api/sessions` without a cookie", "403 access")
def _(studio: Studio) -> str:
    return said(httpx.get(f"{studio.base}/api/sessions"))


@row("A guessed token is no token", "`GET /?token=…` with one letter changed", "403, no cookie")
def _(studio: Studio) -> str:
    answer = httpx.get(studio.base, params={"token": f"{TOKEN[:-1]}!"})
    return f"{answer.status_code}, {'a' if 'set-cookie' in answer.headers else 'no'} cookie"


@row("The token does not stay in the address", "`GET /?token=…`", "303 to /, HttpOnly, SameSite=Strict")
def _(studio: Studio) -> str:
    answer = httpx.get(studio.base, params={"token": TOKEN})
    marks = [
        mark
        for mark in ("HttpOnly", "SameSite=Strict")
        if mark.lower() in answer.headers["set-cookie"].lower()
    ]
    return f"{answer.status_code} to {answer.headers['location']}, {', '.join(marks)}"


@row(
    "A name that was bent to this machine (DNS rebinding) is not answered",
    "`Host: attacker.example`, cookie and all",
    "403 access",
)
def _(studio: Studio) -> str:
    return said(studio.client.get("/api/sessions", headers={"host": "attacker.example"}))


@row(
    "Another site's page changes nothing",
    "`POST …/duplicate` with the cookie, `Origin: http://attacker.example`",
    "403 access",
)
def _(studio: Studio) -> str:
    return said(
        studio.client.post(
            "/api/sessions/take1/duplicate", json={}, headers={"origin": "http://attacker.example"}
        )
    )


@row("Another site's page reads nothing", "`OPTIONS /api/sessions` from there (CORS)", "403 access")
def _(studio: Studio) -> str:
    answer = studio.client.options("/api/sessions", headers={"origin": "http://attacker.example"})
    assert not [name for name in answer.headers if name.startswith("access-control")]
    return said(answer)


@row("Another site's page does not listen in", "WebSocket `/api/events` from there, with the cookie", "403")
def _(studio: Studio) -> str:
    return socket(studio, "/api/events", "http://attacker.example", cookie_header(studio.client))


@row("The 3-D scene is behind the same door", "WebSocket `/scene` without a cookie", "403")
def _(studio: Studio) -> str:
    return socket(studio, "/scene", studio.base, "")


@row("A viewer's address changes nothing", "`POST …/duplicate` with a viewer's cookie", "403 read-only")
def _(studio: Studio) -> str:
    with let_in(studio.base, VIEWERS_TOKEN) as viewer:
        return said(viewer.post("/api/sessions/take1/duplicate", json={}))


@row(
    "A viewer cannot move another viewer's scene",
    "`POST /api/scene/show` in the name of another window",
    "204, in a window of its own",
)
def _(studio: Studio) -> str:
    with let_in(studio.base, VIEWERS_TOKEN) as viewer:
        answer = viewer.post("/api/scene/show", json={"frame": 1}, headers={"x-studio-window": "another"})
    own = "another" not in studio.scenes.by_window and not studio.scenes.plain.calls
    return f"{answer.status_code}, in {'a window of its own' if own else 'the other'}"


@row(
    "A viewer sees sessions, runs and pictures",
    "`GET` of the list, a session, its runs, a picture with a viewer's cookie",
    "200 200 200 200",
)
def _(studio: Studio) -> str:
    at = "/api/sessions/take1"
    with let_in(studio.base, VIEWERS_TOKEN) as viewer:
        places = ("/api/sessions", at, f"{at}/runs", f"{at}/frames/0/views/cam1.jpg")
        return " ".join(str(viewer.get(place).status_code) for place in places)


@row(
    "A viewer does not see uploads and trash",
    "`GET /api/trash` and `GET /api/uploads/x` with a viewer's cookie",
    "403 read-only, 403 read-only",
)
def _(studio: Studio) -> str:
    with let_in(studio.base, VIEWERS_TOKEN) as viewer:
        return ", ".join(said(viewer.get(place)) for place in ("/api/trash", "/api/uploads/x"))


@row(
    "A viewer does not see the owner's folders", "`GET /api/folders` with a viewer's cookie", "403 read-only"
)
def _(studio: Studio) -> str:
    with let_in(studio.base, VIEWERS_TOKEN) as viewer:
        return said(viewer.get("/api/folders"))


@row(
    "The owner stays the owner after opening the viewers' address",
    "`POST …/duplicate` with both cookies",
    "201",
)
def _(studio: Studio) -> str:
    with let_in(studio.base, TOKEN) as both:
        both.get("/", params={"token": VIEWERS_TOKEN})
        return said(both.post("/api/sessions/take1/duplicate", json={}))


@row(
    "A link in a session does not lead out of it",
    "`GET …/thumbnail.jpg` linked to `/etc/passwd`",
    "409 session",
)
def _(studio: Studio) -> str:
    place = studio.workspace.root / "take1" / "thumbnail.jpg"
    place.unlink(missing_ok=True)
    place.symlink_to("/etc/passwd")
    try:
        return said(studio.client.get("/api/sessions/take1/thumbnail.jpg"))
    finally:
        place.unlink()


@row("No file outside is read", "`GET /assets/..%2f..%2fpyproject.toml`", "404")
def _(studio: Studio) -> str:
    return said(studio.client.get("/assets/..%2f..%2fpyproject.toml"))


@row("No name leads out of the workspace", "`GET /api/sessions/..%2f..%2fetc`", "404 not-found")
def _(studio: Studio) -> str:
    return said(studio.client.get("/api/sessions/..%2f..%2fetc"))


@row("A body has a size", "`POST …/duplicate` with 2 MB of JSON", "413 too-large")
def _(studio: Studio) -> str:
    return said(
        studio.client.post(
            "/api/sessions/take1/duplicate",
            content=b" " * 2_000_000,
            headers={"content-type": "application/json"},
        )
    )


@row(
    "A monitor learns whether the server works, and no name",
    "`GET /health` without a cookie",
    '200 {"status":"ok"}',
)
def _(studio: Studio) -> str:
    answer = httpx.get(f"{studio.base}/health")
    return f"{answer.status_code} {answer.text}"


@row("No other machine is let in by mistake", "`studio serve --host 0.0.0.0`", "refused: add --allow-remote")
def _(studio: Studio) -> str:
    try:
        binding_rule("0.0.0.0", allow_remote=False)
    except AccessError as error:
        return "refused: add --allow-remote" if "add --allow-remote" in error.hint else error.hint
    return "let in"


@pytest.mark.parametrize("entry", ROWS, ids=[entry[0] for entry in ROWS])
def test_the_answer_is_the_guide_s(studio: Studio, entry: tuple[str, str, str, Request]) -> None:
    promise, request, answer, make = entry
    assert make(studio) == answer
    assert f"| {promise} | {request} | {answer} |" in GUIDE.read_text(encoding="utf-8").splitlines()


def test_the_guide_promises_nothing_else() -> None:
    lines = GUIDE.read_text(encoding="utf-8").splitlines()
    start = lines.index("| Promise | The request that tries to break it | The answer |")
    table = [line for line in lines[start + 2 : start + 2 + len(ROWS) + 1] if line.startswith("|")]
    assert len(table) == len(ROWS)
