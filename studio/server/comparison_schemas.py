"""Comparisons of trackers, as OpenAPI shows them."""

from typing import Any, Literal

from pydantic import Field

from studio.jobs.job_runner import SessionJob
from studio.server.schemas import Answer, Request, RunName, Value


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
        """The name that it is requested by."""
        return f"{self.session}/{self.name}"


class ComparisonLine(Answer):
    """A comparison in a list. done, total: trials. best: the tracker with the smallest mean error, once it is done."""

    session: str
    name: str
    created: str
    status: Literal["queued", "running", "cancelling", "done", "interrupted", "cancelled", "failed"]
    trackers: list[str]
    tracker: str = Field("", description="Of a sweep.")
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
    vary: dict[str, list[Value]] = Field(
        default_factory=dict[str, list[Value]],
        description="Of a sweep the values of each knob, else empty; trackers are then its points.",
    )


class ComparisonList(Answer):
    """Comparisons, newest first within their session."""

    comparisons: list[ComparisonLine]


class TrialLine(Answer):
    """A measured trial: a tracker with a seed. worst_frame: where its error, worst_mm, is largest. run: the stored run
    that was made of it, "" while there is none.
    """

    tracker: str
    seed: int
    mean_mm: float
    worst_mm: float
    worst_frame: int
    lost_frames: int
    run: str


class TrialRequest(Request):
    """A trial by its tracker's name in the comparison and its seed."""

    tracker: str = Field(max_length=110)
    seed: int = Field(ge=0, lt=2**63)


class TrialRun(Answer):
    """The run of a trial. is_new: made by this request and not tracked yet."""

    session: str
    run: str
    is_new: bool


class ComparisonDetail(Answer):
    """A comparison. settings: by tracker its weighting and knobs; result: null until it is done, else the numbers
    as `studio compare --json` prints them, every frame's error and the findings; of a sweep as `studio sweep --json`.
    trials: of a finished comparison.
    """

    comparison: ComparisonLine
    body: str
    behaviour: str = ""
    fit_shape: bool = Field(False, description="Of a sweep: whether each run fits the body's shape.")
    fps: float
    settings: dict[str, dict[str, Value]]
    result: dict[str, Any] | None
    trials: list[TrialLine]


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


class SweepExpected(Answer):
    """What a sweep will take. seconds: null where no stored run tells; judged_by: the run that does."""

    runs: int
    frames: int
    evaluations: int
    seconds: float | None
    judged_by: str
