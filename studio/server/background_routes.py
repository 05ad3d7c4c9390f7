"""Masks of a session: how good they are, what does not count, and how they are made."""

import asyncio
from typing import Annotated

import msgspec
from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from studio.errors import NotFoundError
from studio.runs.mask_quality import MaskQuality, mask_quality, measure_masks
from studio.runs.overlay_pictures import forget_composers
from studio.runs.session_settings import session_settings
from studio.server.background_schemas import MaskQualityAnswer, ViewQualityLine
from studio.server.picture_routes import Knobs, knob_changes
from studio.server.schemas import Answer, Value
from studio.server.session_routes import OpenSession
from studio.sessions.background_files import exclusion_path, read_evidence, set_exclusion, write_evidence

router = APIRouter(prefix="/api/sessions/{session}", tags=["masks"])

Frames = Annotated[list[int] | None, Query(max_length=24, description="Empty: five, evenly spread.")]


class ExclusionAnswer(Answer):
    """What does not count of a camera."""

    camera: str
    pixels: int


class EvidenceAnswer(Answer):
    """Knobs of the masks that the session's new runs begin with, by flat name."""

    knobs: dict[str, Value] = Field(default_factory=dict)


@router.get("/masks/quality")
async def quality(session: OpenSession, frames: Frames = None, settings: Knobs = "") -> MaskQualityAnswer:
    """How far the views agree in the visual hull; `settings` as a preview of other knobs. Takes seconds a frame."""
    wanted = session_settings(session, changes=knob_changes(settings)).evidence
    return quality_answer(await asyncio.to_thread(mask_quality, session, wanted, tuple(frames or ())))


@router.post("/masks/quality")
async def measure(session: OpenSession) -> MaskQualityAnswer:
    """Measure the masks as the session makes them, and keep it for the guided set-up."""
    return quality_answer(await asyncio.to_thread(measure_masks, session))


@router.get("/exclusions/{camera}", response_class=Response)
def exclusion(session: OpenSession, camera: str) -> Response:
    """The painted picture of what does not count: white on black, as stored."""
    path = exclusion_path(session, camera)
    if path is None:
        raise NotFoundError(f"Nothing of camera '{camera[:64]}' is excluded.", "Paint something.")
    return Response(path.read_bytes(), media_type="image/png", headers={"cache-control": "no-store"})


@router.put("/exclusions/{camera}")
async def put_exclusion(session: OpenSession, camera: str, request: Request) -> ExclusionAnswer:
    """Exclude what is painted in a PNG of the footage's size; an empty body or picture excludes nothing."""
    content = await request.body()
    pixels = await asyncio.to_thread(set_exclusion, session, camera, content)
    forget_composers()
    return ExclusionAnswer(camera=camera, pixels=pixels)


@router.get("/evidence")
def evidence(session: OpenSession) -> EvidenceAnswer:
    """The session's own knobs of masks."""
    return EvidenceAnswer(knobs=read_evidence(session).knobs)


@router.put("/evidence")
def put_evidence(session: OpenSession, request: dict[str, Value]) -> EvidenceAnswer:
    """Let new runs of the session begin with these knobs; runs that are there keep theirs."""
    session_settings(session, changes=request)
    stored = read_evidence(session)
    write_evidence(session, msgspec.structs.replace(stored, knobs=dict(request)))
    return EvidenceAnswer(knobs=dict(request))


def quality_answer(found: MaskQuality) -> MaskQualityAnswer:
    """A quality as the API shows it."""
    lines = [ViewQualityLine.of(view, note=view.in_words()) for view in found.views]
    return MaskQualityAnswer.of(found, cameras=lines)
