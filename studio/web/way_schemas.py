"""The guided way, as OpenAPI shows it."""

from typing import Literal

from pydantic import Field

from studio.web.schemas import NAME, Answer, Request


class NewSession(Request):
    """An empty session. name: its folder's; title: what people see, the name unless given; body: the studio's own
    unless given.
    """

    name: str = Field(pattern=NAME)
    title: str = Field("", max_length=200)
    body: str = Field("", max_length=200)


class WayStep(Answer):
    """A step. words: what is there; why: why it is stale or blocked; optional: tracking goes without it."""

    step: str
    state: Literal["done", "ready", "blocked", "stale", "running"]
    words: str
    why: str = ""
    optional: bool = False


class WayAnswer(Answer):
    """All steps in order. next: the first that wants something, empty if none does."""

    steps: list[WayStep]
    next: str
