"""How work in the background stands, as OpenAPI shows it: what all kinds of it have in common."""

import secrets
from typing import Literal

from pydantic import Field

from studio.web.schemas import Answer, Number


class Progress(Answer):
    """How far it is. done, total: of the step. seconds_left: of the step, null before an estimate. message and hint say
    why it failed.
    """

    state: Literal["running", "done", "failed", "cancelled"] = "running"
    step: str = ""
    done: int = 0
    total: int = 0
    seconds_left: Number = None
    message: str = ""
    hint: str = ""


class SessionJob(Progress):
    """A job that a session has one of at a time. code: of what it failed with."""

    session: str
    code: str = ""

    @property
    def key(self) -> str:
        """What it is asked for by."""
        return self.session


class NumberedJob(SessionJob):
    """A job of which there may be several, told apart by their identifiers."""

    identifier: str = Field(default_factory=lambda: secrets.token_hex(8))

    @property
    def key(self) -> str:
        """What it is asked for by."""
        return self.identifier
