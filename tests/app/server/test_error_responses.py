"""Every failure is words: code, cause, remedy; never a traceback, never a bare 500."""

import base64
import hashlib
import logging
import sqlite3
from collections.abc import Iterator

import pytest
from web_doubles import Studio

from studio.app.server import subject_routes
from studio.app.server.content_policy import PAGE_POLICY
from studio.app.server.error_responses import error_response, validation_words
from studio.foundations.errors import FootageError, StudioError, UnforeseenError
from studio.operations import overview
from studio.sessions.stored_run import StoredRun

ENTRIES = {"code", "message", "hint", "status"}


@pytest.fixture
def records(caplog: pytest.LogCaptureFixture) -> Iterator[pytest.LogCaptureFixture]:
    """What is logged at any level."""
    with caplog.at_level(logging.DEBUG):
        yield caplog


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/api/nothing", 404),
        ("GET", "/api/sessions/none", 404),
        ("PUT", "/api/sessions", 405),
        ("POST", "/api/imports", 422),
        ("GET", "/api/sessions/take1/runs/none/frames", 404),
        ("GET", "/api/sessions/a.b", 422),
        ("DELETE", "/api/presets/none", 404),
        ("GET", f"/api/sessions/take1/frames/{2**64}/views/cam1.jpg", 404),
        ("GET", f"/api/sessions/take1/runs/first/frames/{2**64}", 422),
    ],
)
def test_refusals_of_the_api(studio: Studio, tracked: StoredRun, method: str, path: str, status: int) -> None:
    answer = studio.client.request(method, path)
    assert answer.status_code == status
    response = answer.json()
    assert set(response) == ENTRIES
    assert response["status"] == status
    assert response["message"].endswith(".")


def test_a_body_that_is_no_json_is_named(studio: Studio) -> None:
    answer = studio.post("/api/imports", content=b"{", headers={"content-type": "application/json"}, code=422)
    assert set(answer) == ENTRIES


@pytest.mark.parametrize("content", [b"\xef\xeb", b"\xff" * 9, b"[" * 200_000], ids=["cut", "bytes", "deep"])
def test_a_body_that_is_no_text_is_answered_as_the_api_declares(studio: Studio, content: bytes) -> None:
    answer = studio.post(
        "/api/imports", content=content, headers={"content-type": "application/json"}, code=422
    )
    assert answer["hint"]


def test_a_wrong_entry_is_named_with_its_place(studio: Studio) -> None:
    response = studio.post("/api/imports", {"name": "a", "source": "/x", "fps": "fast"}, code=422)
    assert "'fps'" in response["message"]
    assert (
        validation_words([{"loc": ("body", "a", 0), "msg": "no"}]) == "The request is not valid: 'a.0': no."
    )


def test_a_page_that_is_not_there_is_a_page(studio: Studio) -> None:
    answer = studio.client.get("/nothing<script>")
    assert answer.status_code == 404
    assert answer.headers["content-type"].startswith("text/html")
    assert "<script>" not in answer.text


def test_an_unforeseen_fault_is_reported_in_words_and_logged_whole(
    studio: Studio, monkeypatch: pytest.MonkeyPatch, records: pytest.LogCaptureFixture
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("a secret of the code, line 7")

    monkeypatch.setattr(overview, "session_line", broken)
    answer = studio.client.get("/api/sessions")
    assert answer.status_code == 500
    response = answer.json()
    assert set(response) == ENTRIES
    assert "ZeroDivisionError" in response["message"]
    assert str(studio.log_path) in response["hint"]
    assert "Traceback" not in answer.text
    assert "Traceback" in records.text
    studio.get("/api/worker")


@pytest.mark.parametrize(
    "error",
    [
        FileNotFoundError(2, "No such file or directory", "subject.toml"),
        sqlite3.OperationalError("unable to open database file"),
        FootageError("Footage 'videos/cam1.mp4' is not there.", "Put the file back."),
    ],
    ids=lambda error: type(error).__name__,
)
def test_whatever_a_request_stumbles_over_a_session_that_was_renamed_meanwhile_is_the_cause(
    studio: Studio, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def moved(*_: object, **__: object) -> None:
        (studio.workspace.root / "take1").rename(studio.workspace.root / "new")
        raise error

    monkeypatch.setattr(subject_routes, "write_subject", moved)
    answer = studio.put("/api/sessions/take1/subject", {"height_mm": 1800}, code=404)
    assert answer["message"] == "Session 'take1' was renamed or deleted meanwhile."


def test_errors_of_the_studio_keep_their_words() -> None:
    answer = error_response(StudioError("This is wrong.", "Do that."))
    assert answer.status_code == 400
    assert answer.body == b'{"code":"error","message":"This is wrong.","hint":"Do that.","status":400}'
    assert UnforeseenError("x").status == 500


def test_the_error_page_s_style_is_the_one_that_the_policy_allows() -> None:
    """The page of a refusal brings its own style; the browser runs it because its hash is in the policy."""
    page = error_response(StudioError("Cause & <cause>.", "Remedy."), page=True).body.decode()
    style = page.partition("<style>")[2].partition("</style>")[0]
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert f"'sha256-{digest}'" in PAGE_POLICY
    assert "Cause &amp; &lt;cause&gt;." in page
