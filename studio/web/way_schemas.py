"""The guided way, as OpenAPI shows it."""

from typing import Literal

from studio.web.schemas import Answer


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
