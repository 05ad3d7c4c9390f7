"""Every failure as words: `{code, message, hint, status}`, never a traceback and never a bare 500.

The one place where errors become HTTP. What was not foreseen is written to the log file with its traceback,
and the answer names that file.
"""

import html
import logging
import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from studio.foundations.errors import NotFoundError, StudioError, UnforeseenError
from studio.operations.opening import moved_meanwhile

log = logging.getLogger("studio.app.server")

# In the page itself, because who is not let in gets no asset either; the policy allows this very text.
PAGE_STYLE = (
    "body{margin:0;display:grid;place-items:center;min-height:100vh;font:16px/1.5 system-ui,sans-serif;"
    "background:#14171c;color:#e8eaed}main{max-width:34rem;padding:2rem}h1{font-size:1.25rem;margin:0 0 .5rem}"
    "p{margin:0;color:#a9b0ba}@media(prefers-color-scheme:light){body{background:#f6f7f9;color:#1c2026}"
    "p{color:#5b6470}}"
)
PAGE = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><title>Capture studio</title><style>'
    + PAGE_STYLE.replace("{", "{{").replace("}", "}}")
    + "</style><main><h1>{message}</h1><p>{hint}</p></main></html>"
)
HINTS = {
    404: "Check the address; the API is listed at /api/openapi.json.",
    405: "The API's methods are listed at /api/openapi.json.",
    413: "Send less at a time.",
}


class TooLargeError(StudioError, status=413, code="too-large"):
    """A body or an upload beyond its limit."""


def error_response(error: StudioError, page: bool = False) -> Response:
    """An error as JSON, or as a small page where a person typed an address."""
    content = {"code": error.code, "message": error.message, "hint": error.hint, "status": error.status}
    # What is too large must not be sent to its end for nothing: the connection is closed under it.
    headers = {"connection": "close"} if error.status == 413 else None
    if page:
        words = PAGE.format(message=html.escape(error.message), hint=html.escape(error.hint))
        return HTMLResponse(words, error.status, headers)
    return JSONResponse(content, error.status, headers)


def validation_words(errors: Sequence[dict[str, Any]]) -> str:
    """What is wrong with a request's parameters or body, as one sentence."""
    wrong: list[str] = []
    for entry in errors[:3]:
        place = ".".join(str(part) for part in entry.get("loc", ()) if part not in ("body", "query", "path"))
        wrong.append(f"'{place or 'body'}': {entry.get('msg', 'is not valid')}")
    return f"The request is not valid: {'; '.join(wrong)}."


def add_error_handlers(app: FastAPI) -> None:
    """Translate the errors that routes raise."""

    async def studio_error(request: Request, error: Exception) -> Response:
        known = error if isinstance(error, StudioError) else UnforeseenError(str(error))
        moved = None if isinstance(known, NotFoundError) else _moved_meanwhile(request)
        return error_response(moved or known)

    async def system_error(request: Request, error: Exception) -> Response:
        moved = _moved_meanwhile(request)
        if moved is None:
            raise error
        return error_response(moved)

    async def invalid(_request: Request, error: Exception) -> Response:
        details: Sequence[dict[str, Any]] = (
            error.errors() if isinstance(error, RequestValidationError) else []
        )
        wrong = StudioError(validation_words(details), "Compare it with /api/openapi.json.")
        wrong.status, wrong.code = 422, "request"
        return error_response(wrong)

    async def too_large(_request: Request, error: Exception) -> Response:
        wrong = StudioError(f"A number in the request is too large ({error}).", "Give a smaller one.")
        wrong.status, wrong.code = 422, "request"
        return error_response(wrong)

    async def http_error(request: Request, error: Exception) -> Response:
        status = error.status_code if isinstance(error, HTTPException) else 500
        if status == 400:
            wrong = StudioError(
                "The request's body cannot be read.", "Send it as /api/openapi.json says, as UTF-8."
            )
            wrong.status, wrong.code = 422, "request"
            return error_response(wrong)
        if status == 404:
            message = f"There is nothing at '{request.url.path[:200]}'."
        else:
            message = f"{request.method} of '{request.url.path[:200]}' is not possible ({status})."
        wrong = StudioError(message, HINTS.get(status, ""))
        wrong.status, wrong.code = status, "not-found" if status == 404 else "request"
        return error_response(wrong, page=not request.url.path.startswith("/api"))

    app.add_exception_handler(StudioError, studio_error)
    app.add_exception_handler(RequestValidationError, invalid)
    app.add_exception_handler(HTTPException, http_error)
    app.add_exception_handler(OverflowError, too_large)
    app.add_exception_handler(OSError, system_error)
    app.add_exception_handler(sqlite3.Error, system_error)


def _moved_meanwhile(request: Request) -> StudioError | None:
    """Why a request failed whose session was renamed or deleted meanwhile, whatever it then stumbled over."""
    return moved_meanwhile(request.app.state.studio.workspace, str(request.path_params.get("session", "")))


class ErrorsInWords:
    """ASGI middleware, outermost: what was not caught becomes a 500 in words and a traceback in the log file."""

    def __init__(self, app: ASGIApp, *, log_path: Path | None) -> None:
        self.app = app
        self.log_path = log_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on; answer for what failed."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        begun = False

        async def noting(message: Message) -> None:
            nonlocal begun
            begun = begun or message["type"] in ("http.response.start", "websocket.close")
            await send(message)

        try:
            await self.app(scope, receive, noting)
        except Exception as error:
            log.exception("%s %s failed", scope.get("method", "socket"), scope["path"])
            if begun:
                raise
            if scope["type"] == "websocket":
                await send({"type": "websocket.close", "code": 1011, "reason": type(error).__name__})
                return
            where = (
                f"The details are in '{self.log_path}'."
                if self.log_path
                else "The details are in the server's log."
            )
            wrong = UnforeseenError(f"The studio failed at this request: {_one_line(error)}.", where)
            await error_response(wrong, page=not scope["path"].startswith("/api"))(scope, receive, send)


def _one_line(error: Exception) -> str:
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}{': ' + text[0][:200].rstrip('.') if text else ''}"
