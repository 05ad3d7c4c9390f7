"""Comparisons of trackers, as OpenAPI shows them."""

from typing import Any, Literal

from pydantic import Field

from studio.web.schemas import Answer, Request, RunName, Value
from studio.worker.jobs import SessionJob

MOST_TRACKERS = 12


class EntrantRequest(Request):
    """A tracker that takes part. name: a tracker, tracker:label, or a line-up; settings: its own knobs."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,64}(:[A-Za-z0-9_-]{1,40})?$")
    weighting: RunName | None = Field(None, description="Null: that of all.")
    settings: dict[str, Value] = Field(default_factory=dict)


class ComparisonRequest(Request):
    """What is compared; what is left out is the session's own or the studio's default."""

    session: RunName
    name: RunName | None = None
    trackers: list[EntrantRequest] = Field(min_length=1, max_length=MOST_TRACKERS)
    evaluations: int = Field(1000, ge=1, le=1_000_000, description="Poses weighed a frame, by each.")
    seeds: int = Field(5, ge=1, le=1000, description="How many seeds each, from 0 on.")
    weighting: RunName | None = Field(None, description="Of all; null: the session's own.")
    body: RunName | None = None
    behaviour: RunName | None = Field(None, description="Behaviour model of those that need one.")
    first: int = Field(0, ge=0)
    last: int | None = Field(None, ge=1, description="Frame after the last one; null: all.")
    layers: int = Field(10, ge=1, le=60, description="Of trackers whose layers can be chosen.")
    settings: dict[str, Value] = Field(
        default_factory=dict, description="Knobs of all trackers that have them."
    )


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
