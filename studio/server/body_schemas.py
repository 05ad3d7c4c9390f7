"""Bodies and their parts, as OpenAPI shows them."""

from typing import Literal

from pydantic import Field

from studio.server.schemas import Answer, Number
from studio.server.subject_schemas import LimbDrawing


class BodyEntry(Answer):
    """A body that can be tracked. own: whose it is: the workspace's, a session's, "" for one that is shipped.
    problem: why its file cannot be read, "" if it can.
    """

    name: str
    title: str
    parameters: int
    limbs: int
    own: Literal["", "workspace", "session"]
    problem: str = ""


class BodyList(Answer):
    """All bodies by name. chosen: the session's, "" without one."""

    bodies: list[BodyEntry]
    chosen: str = ""


class SizeView(Answer):
    """A size of a limb: mm, or for a scale without unit. dimension: its name in the body's file, "" where the limb has
    a number of its own.
    """

    value: float
    dimension: str


class LimbSizes(Answer):
    """A limb that can be changed."""

    name: str
    joint: str
    side: str
    length: SizeView
    radius_start: SizeView
    radius_end: SizeView
    scale_x: SizeView
    scale_y: SizeView


class DimensionView(Answer):
    """A dimension that is no limb's size: where joints and markers lie. unit: "mm", or "" for a ratio."""

    name: str
    value: float
    unit: Literal["mm", ""]


class LimitView(Answer):
    """A parameter: degrees or mm. lower, upper: null where there is none. neutral: null where it follows from sizes."""

    name: str
    label: str
    kind: Literal["angle", "length"]
    limb: str
    lower: Number
    upper: Number
    neutral: Number
    max_step: float


class MarkerView(Answer):
    """A named point, mm in its joint's frame."""

    name: str
    joint: str
    at: list[float]


class BodyDetail(Answer):
    """A body with all that can be changed. text: its file. sided: whether it has a left and a right. drawings: its
    limbs as it stands. saved: what it was saved as, "" where it was not.
    """

    name: str
    title: str
    source: str
    text: str
    sided: bool
    limbs: list[LimbSizes]
    dimensions: list[DimensionView]
    limits: list[LimitView]
    markers: list[MarkerView]
    joints: list[str]
    drawings: list[LimbDrawing]
    notes: list[str] = Field(default_factory=list)
    saved: str = ""


class DiscardedBody(Answer):
    """Where a body lies that was thrown away, in the workspace's trash."""

    trash: str
