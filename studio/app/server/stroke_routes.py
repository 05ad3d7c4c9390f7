"""Brush strokes of a session, painted on the pictures of its cameras, and the mask that they give in one frame."""

from fastapi import Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Router
from studio.app.server.schemas import Request
from studio.app.server.session_routes import OpenSession
from studio.evidence.strokes import Stroke, StrokeKind
from studio.foundations.declaring import LARGEST
from studio.operations.strokes import Strokes, keep_strokes, preview_strokes, strokes_of
from studio.sessions.stroke_files import MOST_POINTS, MOST_STROKES, WIDEST

router = Router(prefix="/api/sessions/{session}/strokes", tags=["masks"])


class StrokeEntry(Request):
    """One stroke. width: of the brush, pixels; points: [x, y] pixels of the picture as the footage gives it."""

    frame: int = Field(ge=0, le=LARGEST)
    kind: StrokeKind
    width: float = Field(ge=1.0, le=WIDEST)
    points: list[tuple[float, float]] = Field(min_length=1, max_length=MOST_POINTS)


class StrokesRequest(Request):
    """All strokes of one camera, in the order in which they were painted."""

    strokes: list[StrokeEntry] = Field(max_length=MOST_STROKES)


class StrokesPreviewRequest(StrokesRequest):
    """Strokes of one camera that are tried, and the frame whose mask they are to give."""

    frame: int = Field(ge=0, le=LARGEST)


@router.get("")
def strokes(session: OpenSession) -> Strokes:
    """The strokes that were painted on the cameras' pictures."""
    return strokes_of(session)


@router.put("/{camera}")
def put_strokes(session: OpenSession, camera: str, request: StrokesRequest) -> Strokes:
    """Keep these strokes of a camera in place of those it has; the masks stay until they are made again."""
    return keep_strokes(session, camera, _strokes(camera, request))


@router.post(
    "/{camera}/preview",
    response_class=Response,
    responses={204: {"description": "No stroke says anything of the frame yet"}},
)
def preview(session: OpenSession, camera: str, request: StrokesPreviewRequest) -> Response:
    """About the mask that strokes give in a frame: a transparent PNG to lie over the picture, upright; nothing (204)
    where no stroke says anything of the frame yet. Changes nothing.
    """
    shown = preview_strokes(session, camera, request.frame, _strokes(camera, request))
    return Response(status_code=204) if shown is None else files.picture(shown, "png")


def _strokes(camera: str, request: StrokesRequest) -> list[Stroke]:
    return [
        Stroke(camera=camera, frame=one.frame, kind=one.kind, width=one.width, points=tuple(one.points))
        for one in request.strokes
    ]
