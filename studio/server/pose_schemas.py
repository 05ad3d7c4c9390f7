"""Poses set by hand, as OpenAPI shows them."""

from typing import Literal

from pydantic import Field

from studio.server.schemas import Answer, Number, ParameterView, Request, RunName


class GripView(Answer):
    """A limb's end that can be dragged. place: where it is in the pose, mm."""

    name: str
    side: str
    place: list[float]


class PoseView(Answer):
    """A pose of the session's body: radians and mm in the order of `parameters`.

    stored: whether it is the session's start pose (else the rest pose); frame: that it is of. left_mm: after a drag,
    how far the limb's end still is from where it was dragged.
    """

    body: str
    parameters: list[ParameterView]
    pose: list[float]
    grips: list[GripView]
    stored: bool = False
    frame: int = 0
    left_mm: Number = None
    has_sides: bool = Field(False, description="Whether it can be mirrored.")


class StartPoseRequest(Request):
    """The session's start pose from now on; the one it had stays beside it. frame: that it is of, in which tracking
    begins; null: as before.
    """

    pose: list[float]
    frame: int | None = Field(None, ge=0)


class PoseRequest(Request):
    """A pose, of the session's body or of a run's (which then also says with what weighting it is judged)."""

    pose: list[float]
    run: RunName | None = None


class DragRequest(PoseRequest):
    """A limb's end that is dragged to a place (x, y, z, mm); the body follows, its limits kept."""

    limb: str = Field(max_length=64)
    target: tuple[float, float, float]


class MirrorRequest(PoseRequest):
    """How it is mirrored: `in place`, facing where it faces, or `turned round`, facing the other way as well."""

    how: Literal["in place", "turned round"] = "in place"


class BetterPoseRequest(PoseRequest):
    """A short search around the pose in a frame, then local refinement."""

    frame: int = Field(0, ge=0)
    seed: int = Field(0, ge=0, le=2**63 - 1)


class EditRequest(Request):
    """What the scene lets a person edit. run: null for the session's start pose, else `frame` of it is corrected. pose:
    to begin with, or to go on to; null: the one that is shown there.
    """

    session: RunName
    run: RunName | None = None
    frame: int | None = Field(None, ge=0)
    pose: list[float] | None = None


class EditState(Answer):
    """What is being edited in the scene; all null while nothing is. moved: whether it is another pose than it was."""

    editing: bool = False
    session: str | None = None
    run: str | None = None
    frame: int | None = None
    pose: list[float] | None = None
    moved: bool = False
