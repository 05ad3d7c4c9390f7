"""A viewer's address lets look at everything and change nothing."""

import asyncio
import json
from collections.abc import Iterator
from itertools import pairwise
from typing import NoReturn

import httpx
import pytest
from starlette.types import Receive, Scope, Send
from web_doubles import TOKEN, VIEWERS_TOKEN, Studio, cookie_header, let_in
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from studio.app.server.access import VIEWERS_POSTS, VIEWING, AccessGuard, binding_rule
from studio.app.server.viewers_budget import MOST_SOCKETS, PICTURES_AT_ONCE, REST, ViewersBudget
from studio.foundations.errors import AccessError
from studio.sessions.stored_run import StoredRun


@pytest.fixture
def viewer(studio: Studio) -> Iterator[httpx.Client]:
    with let_in(studio.base, VIEWERS_TOKEN) as client:
        yield client


def test_the_two_cookies_have_names_of_their_own_and_the_owner_s_counts(
    studio: Studio, viewer: httpx.Client
) -> None:
    assert cookie_header(viewer).partition("=")[0] != cookie_header(studio.client).partition("=")[0]
    assert cookie_header(viewer).partition("=")[2] != cookie_header(studio.client).partition("=")[2]
    assert VIEWERS_TOKEN not in cookie_header(viewer)
    assert viewer.post("/api/sessions/take1/duplicate", json={}).status_code == 403
    viewer.get("/", params={"token": TOKEN})
    assert viewer.post("/api/sessions/take1/duplicate", json={}).status_code == 201
    # The owner looks at what was printed for viewers: no window of this browser becomes read-only by it.
    viewer.get("/", params={"token": VIEWERS_TOKEN})
    assert viewer.post("/api/sessions/take1/duplicate", json={}).status_code == 201


def test_the_owner_s_folders_uploads_and_trash_are_not_shown(studio: Studio, viewer: httpx.Client) -> None:
    for path in (
        "/api/folders",
        f"/api/folders?path={studio.workspace.root}",
        "/api/uploads/x",
        "/api/trash",
    ):
        answer = viewer.get(path)
        assert (answer.status_code, answer.json()["code"]) == (403, "read-only"), path
    studio.get("/api/folders")


def test_viewers_compute_one_after_another_and_rest_while_a_run_is_tracked() -> None:
    async def asked(tracking: bool) -> tuple[int, list[float]]:
        at_once, most, ends = 0, 0, list[float]()

        async def app(scope: Scope, receive: Receive, send: Send) -> None:
            nonlocal at_once, most
            at_once += 1
            most = max(most, at_once)
            await asyncio.sleep(0.05)
            at_once -= 1
            ends.append(asyncio.get_running_loop().time())

        budget = ViewersBudget(app, tracking=lambda: tracking)
        scope = {"type": "http", "path": "/api/sessions/take1/masks/quality"}
        VIEWING.set(True)
        await asyncio.gather(*(budget(scope, never, never) for _ in range(3)))
        return most, ends

    most, ends = asyncio.run(asked(tracking=False))
    assert (most, len(ends)) == (1, 3)
    most, ends = asyncio.run(asked(tracking=True))
    assert most == 1
    # A rest of six times as long: no time is expected here but the order of sizes.
    assert all(after - before > 0.05 * REST for before, after in pairwise(ends))


def test_viewers_share_a_number_of_pictures_and_of_sockets() -> None:
    async def asked(kind: str, path: str, count: int) -> tuple[int, int]:
        """How many go on at once, and how many are turned away."""
        within, answered, go = 0, 0, asyncio.Event()

        async def app(_scope: Scope, _receive: Receive, _send: Send) -> None:
            nonlocal within
            within += 1
            await go.wait()

        async def send(_: object) -> None:
            nonlocal answered
            answered += 1

        budget = ViewersBudget(app, tracking=lambda: True)
        VIEWING.set(True)
        scope = {"type": kind, "path": path}
        waiting = [asyncio.ensure_future(budget(scope, never, send)) for _ in range(count)]
        await asyncio.sleep(0.05)
        at_once = within
        go.set()
        await asyncio.gather(*waiting)
        return at_once, answered

    picture = "/api/sessions/take1/frames/0/views/cam1.jpg"
    assert asyncio.run(asked("http", picture, PICTURES_AT_ONCE + 2)) == (PICTURES_AT_ONCE, 0)
    assert asyncio.run(asked("websocket", "/api/events", MOST_SOCKETS + 2)) == (MOST_SOCKETS, 2)


async def never(*_: object) -> NoReturn:
    """Neither receives nor sends."""
    raise AssertionError


def test_every_route_that_changes_is_refused_before_it_is_reached(
    studio: Studio, viewer: httpx.Client
) -> None:
    paths = viewer.get("/api/openapi.json").json()["paths"]
    tried = 0
    for path, methods in paths.items():
        for method in methods:
            if method in ("get", "head") or path in VIEWERS_POSTS:
                continue
            for headers in ({}, {"authorization": f"Bearer {VIEWERS_TOKEN}"}):
                answer = viewer.request(
                    method, path.replace("{", "").replace("}", ""), json={}, headers=headers
                )
                assert (answer.status_code, answer.json()["code"]) == (403, "read-only"), (method, path)
            tried += 1
    assert tried > 60
    assert studio.control.commands == studio.control.changes == []
    for method in ("TRACE", "CONNECT", "BREW"):
        assert viewer.request(method, "/api/sessions").status_code in (400, 403), method


def test_sessions_runs_results_and_events_can_be_seen(
    studio: Studio, viewer: httpx.Client, tracked: StoredRun
) -> None:
    run = f"/api/sessions/take1/runs/{tracked.name}"
    for path in (
        "/",
        "/guide",
        "/comparisons",
        "/behaviours",
        "/reports",
        "/arena",
        "/rig",
        f"{run}/rig",
        "/scene/w/",
        "/api/sessions",
        run,
        f"{run}/frames/0",
    ):
        assert viewer.get(path).status_code == 200, path
    assert (
        httpx.get(f"{studio.base}{run}", headers={"authorization": f"Bearer {VIEWERS_TOKEN}"}).status_code
        == 200
    )
    address = f"{studio.base.replace('http', 'ws')}/api/events?window=mine"
    headers = {"cookie": cookie_header(viewer)}
    with connect(address, origin=studio.base, additional_headers=headers) as socket:  # pyright: ignore[reportArgumentType]
        assert json.loads(socket.recv(timeout=60))["type"] == "state"
        assert studio.app.state.studio.events.windows() == {"view-mine"}
    with pytest.raises(InvalidStatus):
        connect(
            f"{studio.base.replace('http', 'ws')}/api/other", origin=studio.base, additional_headers=headers
        )  # pyright: ignore[reportArgumentType]


def test_a_viewer_moves_the_scene_of_its_own_window_and_no_other(
    studio: Studio, viewer: httpx.Client
) -> None:
    for window in ("", "mine", "view-mine"):
        headers = {"x-studio-window": window} if window else {}
        assert viewer.post("/api/scene/show", json={"frame": 1}, headers=headers).status_code == 204
    assert studio.scenes.plain.calls == []
    assert set(studio.scenes.by_window) == {"view-", "view-mine", "view-view-mine"}
    assert all(stage.calls == [("frame", 1)] for stage in studio.scenes.by_window.values())


def test_the_pages_say_that_they_are_read_only_and_do_not_offer_the_rest(
    studio: Studio, viewer: httpx.Client
) -> None:
    # The guide's pages are kept by the server: whose they are must not be.
    for path in ("/", "/guide", "/guide/verbs", "/reports", "/guide", "/guide/verbs"):
        assert 'data-access="view"' in viewer.get(path).text, path
        assert 'data-access="all"' in studio.client.get(path).text, path
    assert 'href="/way"' not in viewer.get("/").text
    assert 'href="/way"' in studio.client.get("/").text
    for path in ("/way", "/way/", "/recording"):
        assert viewer.get(path, follow_redirects=True).status_code in (403, 404), path
    studio.get("/way")


def test_a_proxy_s_name_is_answered_and_its_cookie_stays_under_tls(studio: Studio) -> None:
    rule = binding_rule("127.0.0.1", False, "Studio.example")
    assert rule.allows("studio.example")
    assert rule.allows("127.0.0.1:80")
    assert not rule.allows("other.example")
    assert rule.encrypted == {"studio.example"}
    for wrong in ("https://studio.example", "studio.example:443", "10.0.0.1", "a b"):
        with pytest.raises(AccessError, match="is no host name"):
            binding_rule("127.0.0.1", False, wrong)

    async def exchanged(host: str) -> str:
        guard = AccessGuard(studio.app, token=TOKEN, hosts=rule)
        transport = httpx.ASGITransport(guard)
        async with httpx.AsyncClient(transport=transport, base_url=f"http://{host}") as client:
            return (await client.get("/", params={"token": TOKEN})).headers["set-cookie"].lower()

    assert "secure" in asyncio.run(exchanged("studio.example"))
    assert "secure" not in asyncio.run(exchanged("127.0.0.1"))
