"""Brush strokes of a session, painted on the pictures of its cameras, and the mask that they give in one frame."""

import cv2
import numpy as np
from fastapi import APIRouter, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.schemas import Answer, Request
from studio.app.server.session_routes import OpenSession
from studio.evidence.strokes import Stroke, StrokeKind
from studio.footage.capture.footage_source import CameraSource
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import NotFoundError
from studio.runs.drawing.overlay_drawing import upright
from studio.runs.setup.stroke_masks import by_frame, first_frame, preview_mask
from studio.sessions.session import Session
from studio.sessions.stroke_files import (
    MOST_POINTS,
    MOST_STROKES,
    WIDEST,
    made_of_strokes,
    read_strokes,
    replace_strokes,
)

router = APIRouter(prefix="/api/sessions/{session}/strokes", tags=["masks"])

SHOWN_HEIGHT = 1080
SHOWN = (120, 220, 90, 115)
"""Colour of a mask over its picture: blue, green, red, opacity."""


class StrokeEntry(Request):
    """One stroke. width: of the brush, pixels; points: [x, y] pixels of the picture as the footage gives it (not turned
    upright).
    """

    frame: int = Field(ge=0, le=LARGEST)
    kind: StrokeKind
    width: float = Field(ge=1.0, le=WIDEST)
    points: list[tuple[float, float]] = Field(min_length=1, max_length=MOST_POINTS)


class CameraStrokes(Answer):
    """One camera. ready: whether it has a stroke inside; made: whether its masks in use are those of these strokes."""

    camera: str
    strokes: list[StrokeEntry]
    ready: bool
    made: bool


class StrokesAnswer(Answer):
    """The strokes of all cameras."""

    cameras: list[CameraStrokes]


class StrokesRequest(Request):
    """All strokes of one camera, in the order in which they were painted."""

    strokes: list[StrokeEntry] = Field(max_length=MOST_STROKES)


class StrokesPreviewRequest(StrokesRequest):
    """Strokes of one camera that are tried, and the frame whose mask they are to give."""

    frame: int = Field(ge=0, le=LARGEST)


@router.get("")
def strokes(session: OpenSession) -> StrokesAnswer:
    """What was painted on the cameras' pictures."""
    painted, earlier = read_strokes(session), made_of_strokes(session)
    before = () if earlier is None else earlier.made.strokes
    cameras: list[CameraStrokes] = []
    for source in session.manifest.footage.cameras:
        own = [one for one in painted if one.camera == source.name]
        ready = first_frame(by_frame(own, source.name)) is not None
        made = ready and own == [one for one in before if one.camera == source.name]
        entries = [
            StrokeEntry(frame=one.frame, kind=one.kind, width=one.width, points=list(one.points))
            for one in own
        ]
        cameras.append(CameraStrokes(camera=source.name, strokes=entries, ready=ready, made=made))
    return StrokesAnswer(cameras=cameras)


@router.put("/{camera}")
def put_strokes(session: OpenSession, camera: str, request: StrokesRequest) -> StrokesAnswer:
    """Keep these strokes of a camera in place of those it has; the masks stay until they are made again."""
    _source(session, camera)
    replace_strokes(session, camera, _strokes(camera, request))
    return strokes(session)


@router.post(
    "/{camera}/preview",
    response_class=Response,
    responses={204: {"description": "No stroke says anything of the frame yet"}},
)
def preview(session: OpenSession, camera: str, request: StrokesPreviewRequest) -> Response:
    """About the mask that strokes give in a frame: a transparent PNG to lie over the picture, upright; nothing (204)
    where no stroke says anything of the frame yet. Changes nothing.
    """
    source = _source(session, camera)
    mask = preview_mask(session, camera, request.frame, _strokes(camera, request))
    if mask is None:
        return Response(status_code=204)
    if mask.shape[0] > SHOWN_HEIGHT:
        size = round(source.width * SHOWN_HEIGHT / source.height), SHOWN_HEIGHT
        mask = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_AREA), np.uint8)
    turns = (
        {one.name: one.quarter_turns for one in session.cameras()}.get(camera, 0)
        if session.is_calibrated
        else 0
    )
    shown = np.where(upright(mask, turns)[..., None] > 127, np.array(SHOWN, np.uint8), np.uint8(0))
    return files.picture(cv2.imencode(".png", shown)[1].tobytes(), "png")


def _strokes(camera: str, request: StrokesRequest) -> list[Stroke]:
    return [
        Stroke(camera=camera, frame=one.frame, kind=one.kind, width=one.width, points=tuple(one.points))
        for one in request.strokes
    ]


def _source(session: Session, camera: str) -> CameraSource:
    for source in session.manifest.footage.cameras:
        if source.name == camera:
            return source
    raise NotFoundError(
        f"Session '{session.name}' has no camera '{camera[:64]}'.", "Choose one of the session's cameras."
    )
