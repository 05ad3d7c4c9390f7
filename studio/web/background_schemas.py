"""What backgrounds are made of, and how their set-up stands, as OpenAPI shows it."""

from typing import Literal

from pydantic import Field

from studio.web.calibration_schemas import FindingView
from studio.web.schemas import Answer, Number, Request, RunName, Value
from studio.web.setting_schemas import KnobView
from studio.worker.jobs import SessionJob

Source = Literal["plate", "clip", "median", "combined"]


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
    silhouettes say against the calibration.
    """

    frames: list[int]
    cameras: list[ViewQualityLine]
    usable: bool
    hull_litres: list[Number]
    worst: str = ""
    doubts: list[FindingView] = Field(default_factory=list)


class BackgroundCamera(Answer):
    """One camera. given: what the studio was given of its empty room; excluded: whether regions of it do not count."""

    name: str
    given: Literal["", "plate", "clip"]
    file: str
    masks: bool
    excluded: bool
    width: int
    height: int


class BackgroundJob(SessionJob):
    """How a set-up stands."""

    source: Source
    notes: list[str] = Field(default_factory=list)
    knobs: dict[str, Value] = Field(default_factory=dict)
    quality: MaskQualityAnswer | None = None


class BackgroundAnswer(Answer):
    """A session's background. source: what it is made of, "masks" where masks came with the footage. possible: what it
    can be made of now. settings: all knobs of masks with their values in use; own: those the session has said.
    measured: how far the views agreed when that was last measured, in words.
    """

    session: str
    source: Literal["plate", "clip", "median", "combined", "masks"]
    possible: list[Source]
    frame_count: int
    cameras: list[BackgroundCamera]
    knobs: list[KnobView]
    settings: dict[str, Value]
    own: dict[str, Value]
    measured: str = ""
    job: BackgroundJob | None


class PlatesWish(Request):
    """Uploaded pictures or clips of the empty room. files: camera to a name in the upload; empty: matched by name."""

    upload: RunName
    files: dict[str, str] = Field(default_factory=dict, max_length=64)
