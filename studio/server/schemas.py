"""What the API takes and gives, as OpenAPI shows it. Lengths in mm, angles in radians, NaN as null."""

import math
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from studio.capture.naming import CameraMatch
from studio.jobs.search_pace import MOST_SECONDS, SpeedChoice
from studio.typed_decoding import is_list

Value = bool | int | float | str
NAME = r"^[A-Za-z0-9_-]{1,64}$"


def finite(value: object) -> object:
    """NaN and infinities as None; numpy's numbers as Python's."""
    number: object = cast("np.generic[Any]", value).item() if isinstance(value, np.generic) else value
    return None if isinstance(number, float) and not math.isfinite(number) else number


def _finite_list(values: object) -> object:
    plain = values.tolist() if isinstance(values, np.ndarray) else values
    plain = list(cast("tuple[object, ...]", plain)) if isinstance(plain, tuple) else plain
    return [finite(value) for value in plain] if is_list(plain) else plain


Number = Annotated[float | None, BeforeValidator(finite)]
Numbers = Annotated[list[float | None], BeforeValidator(_finite_list)]
RunName = Annotated[str, Field(pattern=NAME)]


class Answer(BaseModel):
    """An answer made from the studio's own values by their attributes."""

    model_config = ConfigDict(from_attributes=True)

    @classmethod
    def of(cls, value: object, **own: object) -> Self:
        """Made of a value's attributes by the names of the entries. own : entries that differ, or that it lacks."""
        names = [name for name in cls.model_fields if name not in own and hasattr(value, name)]
        return cls.model_validate({**{name: getattr(value, name) for name in names}, **own})


class Request(BaseModel):
    """What a client sends; unknown entries are refused."""

    model_config = ConfigDict(extra="forbid")


class ErrorAnswer(BaseModel):
    """Every answer that is no success."""

    code: str
    message: str = Field(description="What is wrong, in one sentence.")
    hint: str = Field(description="What to do, in one sentence.")
    status: int


class RunLine(Answer):
    """A run in a list. status: new, tracking, interrupted, cancelled, finished or damaged."""

    session: str
    name: str
    created: str
    tracker: str
    weighting: str
    body: str
    seed: int
    first: int
    last: int
    done: int
    tracked_to: int
    status: str
    damaged: list[int] = Field(
        [], description="Frames that are damaged on the disk; resuming tracks them again."
    )
    describe: str = Field("", description="Tracker, layers and particles in a few words.")
    mean_mm: Number = Field(None, description="Mean marker error where the session has a truth.")


class SessionLine(Answer):
    """A session in a list; runs newest first. thumbnail: address of a JPEG. problem: why it cannot be
    opened.
    """

    name: str
    title: str
    created: str
    body: str
    tracker: str
    weighting: str
    cameras: int
    camera_names: list[str]
    frame_count: int
    fps: float
    has_truth: bool
    thumbnail: str
    notes: list[str]
    warnings: list[str]
    runs: list[RunLine]
    comparisons: int = 0
    next_step: str = Field("", description="footage or calibration, where that is lacking; else empty.")
    problem: str = ""


class SessionList(Answer):
    """All sessions of the workspace, by name."""

    sessions: list[SessionLine]


class CameraView(Answer):
    """A calibrated camera and its footage."""

    name: str
    width: int
    height: int
    quarter_turns: int = Field(description="Clockwise quarter turns that show the picture upright.")
    matrix: list[list[float]]
    distortion: Numbers
    rotation: list[list[float]]
    translation: Numbers
    centre: Numbers
    picture_width: int
    picture_height: int
    frame_count: int
    has_masks: bool
    has_background: bool


class ParameterView(Answer):
    """One entry of the pose vector. unit: mm or rad; limits null where there are none."""

    name: str
    label: str
    unit: str
    lower: Number
    upper: Number
    max_step: Number
    neutral: float
    limb: str


class BodyView(Answer):
    """A body as tables: parameters in the order of the pose vector. by_height: whether its lengths follow from a
    person's height, unlike those of animals and machines.
    """

    name: str
    title: str
    by_height: bool
    parameters: list[ParameterView]
    limbs: list[str]
    markers: list[str]
    dimensions: dict[str, float]


class SubjectView(Answer):
    """The person's measures, mm."""

    body: str
    height_mm: Number
    lengths_mm: dict[str, float]


class SessionDetail(Answer):
    """Everything about a session but its pictures."""

    name: str
    title: str
    created: str
    fps: float
    frame_count: int
    body: BodyView
    cameras: list[CameraView]
    subject: SubjectView | None
    has_truth: bool
    next_step: str = ""
    has_start_pose: bool
    start_pose_frame: int = 0
    tracker: str
    weighting: str
    calibration_source: str
    imported_from: str
    matching: list[CameraMatch]
    assumptions: list[str]
    notes: list[str]
    warnings: list[str]
    doubts: list[str] = Field(
        default_factory=list, description="What the footage says against the calibration."
    )
    runs: list[RunLine]


class SessionChange(Request):
    """New words for a session; both may change at once."""

    name: RunName | None = None
    title: str | None = Field(None, max_length=200)


class NewName(Request):
    """A name; null lets the studio find a free one."""

    name: RunName | None = None


class TrashEntry(Answer):
    """Something in the trash. name: what it was called; what is "other" cannot be restored."""

    id: str
    name: str
    kind: Literal["session", "run", "comparison", "model", "other"]
    restorable: bool = True


class TrashList(Answer):
    """What lies in the trash, oldest first."""

    entries: list[TrashEntry]


class Restored(Answer):
    """Where something came back to. name: the session, "" for a model; run, comparison, model: "" where it is none."""

    name: str
    run: str = ""
    comparison: str = ""
    model: str = ""


class TrashChoice(Request):
    """An entry of the trash by its id."""

    entry: RunName


class Frame(Request):
    """A frame by its number."""

    frame: int = Field(ge=0)


class ReannealRequest(Request):
    """Which frame (-1: the selected one), and whether the answer replaces the stored one."""

    frame: int = Field(-1, ge=-1)
    keep: bool = False


class Posted(Answer):
    """A command handed to the tracking process; an `acknowledged` event with its identifier follows."""

    identifier: str
    command: str


class RunList(Answer):
    """The runs of a session, newest first."""

    runs: list[RunLine]


class RunDetail(Answer):
    """A run and its request. settings: at its start; parameters: of its pose vector, as sigma and start_pose."""

    run: RunLine
    settings: dict[str, Value]
    parameters: list[ParameterView]
    sigma: Numbers
    start_pose: Numbers | None
    start_source: str
    software: str
    fps: float
    notes: list[str]
    behaviour: str = ""
    live: bool = False


class LogEntry(Answer):
    """One line of a run's log. time: seconds since the epoch."""

    level: str
    time: float
    text: str


class LogLines(Answer):
    """What the tracking process said, oldest first."""

    lines: list[LogEntry]


class PaceRequest(Request):
    """How long each tracked layer takes at least; 0: as fast as it can."""

    seconds_a_layer: float = Field(ge=0.0, le=MOST_SECONDS, allow_inf_nan=False)


class PaceView(Answer):
    """The pace that the search has, and what is offered: fast to slow, the present one among them."""

    seconds_a_layer: float
    choices: list[SpeedChoice]
