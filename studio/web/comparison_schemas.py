"""Comparisons of trackers, as OpenAPI shows them."""

from typing import Any, Literal

from pydantic import Field

from studio.web.schemas import Answer, Request, RunName, Value
from studio.worker.jobs import SessionJob


class EntrantRequest(Request):
    """A tracker that takes part. name: a tracker, tracker:label, or a line-up; settings: its own knobs."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,64}(:[A-Za-z0-9_-]{1,40})?$")
    weighting: RunName | None = Field(None, description="Null: that of all.")
    settings: dict[str, Value] = Field(default_factory=dict)


class ComparisonState(SessionJob):
    """How a comparison stands that is being worked at. step: the trial that was done last; done, total: trials."""

    name: str

    @property
    def key(self) -> str:
        """What it is asked for by."""
        return f"{self.session}/{self.name}"


class ComparisonLine(Answer):
    """A comparison in a list. done, total: trials. best: the tracker with the smallest mean error, once it is done."""

    session: str
    name: str
    created: str
    status: Literal["queued", "running", "cancelling", "done", "interrupted", "cancelled", "failed"]
    trackers: list[str]
    evaluations: int
    seeds: int
    first: int
    last: int
    done: int
    total: int
    step: str = ""
    seconds_left: float | None = None
    problem: str = ""
    best: str = ""
    best_mm: float | None = None


class ComparisonList(Answer):
    """Comparisons, newest first within their session."""

    comparisons: list[ComparisonLine]


class ComparisonDetail(Answer):
    """A comparison. settings: by tracker its weighting and knobs; result: null until it is done, else the numbers
    as `studio compare --json` prints them, every frame's error and the findings.
    """

    comparison: ComparisonLine
    body: str
    behaviour: str = ""
    fps: float
    settings: dict[str, dict[str, Value]]
    result: dict[str, Any] | None


class EntrantChoice(Answer):
    """A name that can take part. changes: the knobs that it brings along. sized_by: those that follow from the
    evaluations.
    """

    name: str
    tracker: str
    help: str
    sized_by: list[str]
    changes: dict[str, Value] = Field(default_factory=dict)


class LineupChoice(Answer):
    """A name that stands for several."""

    name: str
    trackers: list[str]


class ComparisonChoices(Answer):
    """Who can take part."""

    entrants: list[EntrantChoice]
    lineups: list[LineupChoice]
    weightings: list[str]
