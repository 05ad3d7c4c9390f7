"""Promises about who may talk to the server, each against a real server."""

import json

import httpx
import pytest
from web_doubles import TOKEN, Studio, cookie_header, state_of
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from studio.app.server.access import binding_rule, host_name, new_token, same_origin
from studio.foundations.errors import AccessError


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "127.8.8.8", "[::1]", "LOCALHOST"])
def test_loopback_needs_no_permission(host: str) -> None:
    rule = binding_rule(host, allow_remote=False)
    assert rule.allows("localhost:8642")
    assert not rule.allows("10.0.0.7:8642")
    assert not rule.allows("attacker.example")


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "studio.example", "", "10.0.0.1"])
def test_any_other_host_needs_permission(host: str) -> None:
    with pytest.raises(AccessError) as refused:
        binding_rule(host, allow_remote=False)
    assert "--allow-remote" in refused.value.hint
    assert binding_rule(host, allow_remote=True).allows("192.168.1.5:8642")


def test_remote_rule_still_refuses_names_that_are_not_ours() -> None:
    rule = binding_rule("0.0.0.0", allow_remote=True)
    assert not rule.allows("rebound.example:8642")
    assert binding_rule("studio.example", allow_remote=True).allows("Studio.Example:80")


@pytest.mark.parametrize(
    ("header", "name"),
    [
        ("localhost:80", "localhost"),
        ("[::1]:80", "::1"),
        ("A.B", "a.b"),
        ("", ""),
        ("[::1", ""),
        ("a:b:c", ""),
        ("user@localhost", ""),
        ("localhost/x", ""),
        ("localhost?x", ""),
        ("localhost#x", ""),
        ("localhost\\x", ""),
        ("localhost:", ""),
        ("localhost:abc", ""),
        ("localhost:99999", ""),
        ("localhost:8642 ", ""),
        (" localhost", ""),
        ("localhost:٨٠", ""),
        ("[::1%eth0]:80", ""),
        ("[127.0.0.1]", "127.0.0.1"),
        ("[localhost]", ""),
        ("l\u00f6calhost", ""),
        ("127.0.0.1:80:80", ""),
    ],
)
def test_host_header_is_taken_apart(header: str, name: str) -> None:
    assert host_name(header) == name


@pytest.mark.parametrize(
    ("origin", "same"),
    [
        ("http://127.0.0.1:80", True),
        ("http://127.0.0.1:81", False),
        ("http://localhost:80", False),
        ("http://127.0.0.1:80.evil.example", False),
        ("null", False),
        ("", False),
        ("file://127.0.0.1:80", False),
    ],
)
def test_origin_is_the_very_host_and_port(origin: str, same: bool) -> None:
    assert same_origin(origin, "127.0.0.1:80") is same


def test_tokens_are_long_and_differ() -> None:
    tokens = {new_token() for _ in range(50)}
    assert len(tokens) == 50
    assert min(map(len, tokens)) >= 43  # 256 bits in base64


def test_token_becomes_a_cookie_and_leaves_the_address(studio: Studio) -> None:
    answer = httpx.get(f"{studio.base}/?token={TOKEN}&session=take1")
    assert answer.status_code == 303
    assert answer.headers["location"] == "/?session=take1"
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert TOKEN.lower() not in cookie
    studio.get("/api/sessions")


@pytest.mark.parametrize("token", ["", "wrong", TOKEN[:-1], TOKEN + "x", "é" * 20])
def test_wrong_token_is_not_exchanged(studio: Studio, token: str) -> None:
    answer = httpx.get(studio.base, params={"token": token})
    assert answer.status_code == 403
    assert "set-cookie" not in answer.headers


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/guide",
        "/scene/",
        "/assets/tokens.css",
        "/api/sessions",
        "/api/openapi.json",
        "/api/none",
        "/none",
    ],
)
def test_nothing_is_answered_without_the_cookie(studio: Studio, path: str) -> None:
    answer = httpx.get(studio.base + path)
    assert answer.status_code == 403
    assert "take1" not in answer.text
    assert TOKEN not in answer.text


def test_every_route_of_the_api_is_behind_the_guard(studio: Studio) -> None:
    paths = studio.get("/api/openapi.json")["paths"]
    assert len(paths) > 40
    with httpx.Client(base_url=studio.base) as stranger:
        for path, methods in paths.items():
            for method in methods:
                answer = stranger.request(method, path.replace("{", "").replace("}", ""))
                assert answer.status_code == 403, (method, path)


def test_foreign_host_is_refused_even_with_the_cookie(studio: Studio) -> None:
    for host in ("attacker.example", "attacker.example:80", "127.0.0.1.attacker.example", "10.1.2.3"):
        studio.get("/api/sessions", headers={"host": host}, code=403)
        studio.get("/", params={"token": TOKEN}, headers={"host": host}, code=403)


@pytest.mark.parametrize("origin", [None, "http://attacker.example", "null", "http://127.0.0.1:1"])
def test_changes_from_another_origin_are_refused(studio: Studio, origin: str | None) -> None:
    headers = {"cookie": cookie_header(studio.client)} | ({"origin": origin} if origin else {})
    for method, path in (
        ("POST", "/api/sessions/take1/duplicate"),
        ("PATCH", "/api/sessions/take1"),
        ("DELETE", "/api/sessions/take1"),
        ("PUT", "/api/presets/mine"),
        ("OPTIONS", "/api/sessions"),
    ):
        answer = httpx.request(method, studio.base + path, headers=headers, json={})
        assert answer.status_code == 403, (method, path)
        assert answer.json()["code"] == "access"
        assert "access-control-allow-origin" not in answer.headers
    assert [entry.name for entry in studio.workspace.sessions()] == ["take1"]


def test_a_script_may_send_the_token_itself(studio: Studio) -> None:
    headers = {"authorization": f"Bearer {TOKEN}"}
    answer = httpx.post(f"{studio.base}/api/sessions/take1/duplicate", headers=headers, json={})
    assert answer.status_code == 201
    wrong = {"authorization": f"Bearer {TOKEN}x"}
    assert httpx.get(f"{studio.base}/api/sessions", headers=wrong).status_code == 403
    foreign = headers | {"origin": "http://attacker.example"}
    assert httpx.post(f"{studio.base}/api/sessions/take1/duplicate", headers=foreign).status_code == 403


@pytest.mark.parametrize("path", ["/api/events", "/scene"])
def test_sockets_need_cookie_host_and_origin(studio: Studio, path: str) -> None:
    address = studio.base.replace("http", "ws") + path
    cookie = {"cookie": cookie_header(studio.client)}
    for origin, headers in (
        (studio.base, {}),
        (None, cookie),
        ("http://attacker.example", cookie),
        (studio.base, {"cookie": "studio=1"}),
    ):
        with pytest.raises(InvalidStatus) as refused:
            connect(address, origin=origin, additional_headers=headers)
        assert refused.value.response.status_code == 403


def test_socket_with_everything_is_let_in(studio: Studio) -> None:
    address = studio.base.replace("http", "ws") + "/api/events"
    headers = {"cookie": cookie_header(studio.client)}
    with connect(address, origin=studio.base, additional_headers=headers) as socket:
        assert json.loads(socket.recv(timeout=60))["type"] == "state"


@pytest.mark.slow
def test_get_changes_nothing(studio: Studio) -> None:
    """Every address that a GET could reach leaves the workspace's sessions and the process as they were."""
    spec = studio.get("/api/openapi.json")["paths"]
    before = sorted(path.name for path in studio.workspace.root.iterdir())
    fill = {"session": "take1", "run": "none", "frame": "0", "layer": "0", "camera": "cam1"}
    for path, methods in spec.items():
        if "get" not in methods:
            answer = studio.client.get(path.format_map(_Filled(fill)))
            assert answer.status_code in (404, 405), path
        else:
            studio.client.get(path.format_map(_Filled(fill)))
    assert studio.control.commands == []
    assert studio.control.changes == []
    after = sorted(path.name for path in studio.workspace.root.iterdir() if path.name[:1] != ".")
    assert after == [name for name in before if name[:1] != "."]


class _Filled(dict[str, str]):
    def __missing__(self, key: str) -> str:
        return "none"


def test_policies_are_on_every_answer(studio: Studio) -> None:
    for path in ("/", "/guide", "/api/sessions", "/none", "/api/none"):
        headers = studio.client.get(path).headers
        assert "script-src 'self';" in headers["content-security-policy"]
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
    scene = studio.client.get("/scene/").headers["content-security-policy"]
    assert "connect-src 'self' data: blob:" in scene
    assert "default-src 'none'" in scene
    assert "ws:" not in scene
    refused = httpx.get(studio.base + "/api/sessions").headers
    assert "default-src 'none'" in refused["content-security-policy"]


def test_pages_need_nothing_inline(studio: Studio) -> None:
    """The page's own policy forbids inline scripts and styles, so there must be none."""
    for path in ("/", "/guide"):
        text = studio.client.get(path).text
        assert "<script>" not in text
        assert "style=" not in text
        assert "onclick" not in text
        assert 'src="http' not in text
        assert 'href="http' not in text


def test_health_is_reported_to_whoever_asks_by_the_right_name(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = httpx.get(f"{studio.base}/health")
    assert (answer.status_code, answer.json()) == (200, {"status": "ok"})
    assert httpx.get(f"{studio.base}/health", headers={"host": "attacker.example"}).status_code == 403
    assert httpx.post(f"{studio.base}/health").status_code == 403
    assert httpx.get(f"{studio.base}/health/").status_code == 403
    studio.control.state = state_of(state="lost")
    answer = httpx.get(f"{studio.base}/health")
    assert (answer.status_code, answer.json()) == (503, {"status": "tracking process lost"})
    studio.control.state = state_of()
    monkeypatch.setattr("studio.app.server.health_routes.LEAST_FREE_BYTES", 1 << 62)
    assert httpx.get(f"{studio.base}/health").json() == {"status": "disk full"}
