"""What backgrounds are made of, and how their set-up stands, as OpenAPI shows it."""

from typing import Literal

from pydantic import Field

from studio.calibration.findings import Finding
from studio.jobs.job_runner import SessionJob
from studio.runs.background_setup import BackgroundSource
from studio.server.schemas import Answer, Number, Request, RunName, Value
from studio.server.setting_schemas import KnobView


class ViewQualityLine(Answer):
    """One camera. covered: share of the mask under the hull's silhouette; inside: share of that in the mask; agreement:
    the smaller; denied: share of the other masks that this camera alone keeps out of the hull; note: what to look for.
    """

    camera: str
    agreement: Number
    covered: Number
    inside: Number
    denied: Number
    usable: bool
    note: str


class MaskQualityAnswer(Answer):
    """All cameras' masks in some frames. worst: the camera to look at first, "" where all are usable. doubts: what the
    silhouettes say against the calibration. subjects: in view, 0: not counted.
    """

    frames: list[int]
    cameras: list[ViewQualityLine]
    usable: bool
    hull_litres: list[Number]
    worst: str = ""
    doubts: list[Finding] = Field(default_factory=list[Finding])
    subjects: int = 0


class BackgroundCamera(Answer):
    """One camera. given: what the studio was given of its empty room; excluded: whether regions of it do not count."""

    name: str
    given: Literal["", "plate", "clip"]
    file: str
    masks: bool
    excluded: bool
    width: int
    height: int


class SourceTriedLine(Answer):
    """A source in the tried frames. agreements, borders (how much the pictures change along the masks' borders), scores
    (their product): by camera, 0 to 1; worst: the least score; litres: of the hull; note: why it cannot be.
    """

    source: str
    agreements: dict[str, Number]
    borders: dict[str, Number]
    scores: dict[str, Number]
    worst: Number
    litres: Number
    note: str


class SourceChoiceAnswer(Answer):
    """How "best" decided. by_camera: the source that each camera's masks come from; mixed: of these masks together."""

    tried: list[SourceTriedLine]
    by_camera: dict[str, str]
    mixed: SourceTriedLine


class BackgroundJob(SessionJob):
    """How a set-up stands."""

    source: BackgroundSource
    notes: list[str] = Field(default_factory=list)
    knobs: dict[str, Value] = Field(default_factory=dict)
    quality: MaskQualityAnswer | None = None
    choice: SourceChoiceAnswer | None = None


class BackgroundAnswer(Answer):
    """A session's background. source: what it is made of, "masks" where masks came with the footage. possible: what it
    can be made of now. settings: all knobs of masks with their values in use; own: those the session has said.
    measured: how far the views agreed when that was last measured, in words.
    """

    session: str
    source: BackgroundSource
    possible: list[BackgroundSource]
    frame_count: int
    cameras: list[BackgroundCamera]
    knobs: list[KnobView]
    settings: dict[str, Value]
    own: dict[str, Value]
    measured: str = ""
    job: BackgroundJob | None


class PlatesRequest(Request):
    """Uploaded pictures or clips of the empty room. files: camera to a name in the upload; empty: matched by name."""

    upload: RunName
    files: dict[str, str] = Field(default_factory=dict, max_length=64)


class SubjectLine(Answer):
    """A subject in view. at: x and y on the floor, metres; height: metres to its top; points: where its middle is seen,
    by camera, as shares of the picture's width and height.
    """

    at: tuple[float, float]
    litres: Number
    height: Number
    points: dict[str, tuple[float, float]]


class SubjectsAnswer(Answer):
    """Who is in view in a frame, the largest first."""

    frame: int
    subjects: list[SubjectLine]
