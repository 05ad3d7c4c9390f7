"""A view that nobody waits for any more stops between two of its steps."""

import asyncio
import time

import anyio.to_thread
import pytest
from starlette.types import Message, Receive, Scope, Send

from studio.app.server.left_requests import LeftRequests
from studio.results.inspection.wanted import LeftError, stop_if_left

PATIENCE_SECONDS = 20.0
VIEW = "/api/sessions/walk/runs/run-1/frames/3/views/blame"


def compute(steps: list[int], most: int) -> None:
    """Some steps of a view, as a route's thread takes them."""
    while len(steps) < most:
        stop_if_left()
        steps.append(len(steps))
        time.sleep(0.002)


async def ask(path: str, most: int, leaves_after: float | None) -> tuple[list[int], bool]:
    """The steps that were taken, and whether they were stopped. leaves_after : seconds."""
    steps, was_stopped = list[int](), False

    async def route(_scope: Scope, receive: Receive, _send: Send) -> None:
        nonlocal was_stopped
        assert (await receive())["type"] == "http.request"
        try:
            await anyio.to_thread.run_sync(compute, steps, most)
        except LeftError:
            was_stopped = True

    messages: asyncio.Queue[Message] = asyncio.Queue()
    messages.put_nowait({"type": "http.request", "body": b"", "more_body": False})
    if leaves_after is not None:
        asyncio.get_running_loop().call_later(leaves_after, messages.put_nowait, {"type": "http.disconnect"})

    async def send(_message: Message) -> None:
        pass

    scope = {"type": "http", "method": "GET", "path": path}
    await asyncio.wait_for(LeftRequests(route)(scope, messages.get, send), PATIENCE_SECONDS)
    return steps, was_stopped


def test_a_view_stops_when_whoever_asked_has_gone() -> None:
    steps, was_stopped = asyncio.run(ask(VIEW, 1_000_000, 0.1))
    assert was_stopped
    assert steps


@pytest.mark.parametrize("path", [VIEW, "/api/sessions/walk/runs/run-1/views/coverage"])
def test_a_view_that_is_waited_for_is_computed_to_its_end(path: str) -> None:
    steps, was_stopped = asyncio.run(ask(path, 20, None))
    assert len(steps) == 20
    assert not was_stopped


def test_what_else_is_asked_for_goes_on_without_whoever_asked() -> None:
    steps, was_stopped = asyncio.run(ask("/api/sessions", 60, 0.01))
    assert len(steps) == 60
    assert not was_stopped
