"""Camera pictures as JPEG, upright, bare or with what was seen and projected drawn over them."""

from typing import Annotated

import msgspec
import numpy as np
from fastapi import APIRouter, Query, Response
from numpy.typing import NDArray

from studio.app.server import files
from studio.app.server.run_routes import RUN, OpenRun
from studio.app.server.session_routes import OpenSession
from studio.foundations.errors import NotFoundError, SettingsError
from studio.foundations.geometry.reach import within_reach
from studio.foundations.typed_decoding import decode_json
from studio.results.inspection.comparing import MOST
from studio.results.overlay_pictures import OtherBody, compose_view
from studio.runs.drawing.overlay_drawing import encode_jpeg
from studio.runs.setup.session_settings import session_settings
from studio.runs.tracks import RAW, pose_in_track
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

router = APIRouter(prefix="/api", tags=["pictures"])

START = "start"
VIEW = "/frames/{frame}/views/{camera}.jpg"
Height = Annotated[
    int | None, Query(ge=16, le=4320, description="Of the picture as shown; empty: as stored.")
]
Show = Annotated[
    str,
    Query(
        max_length=200,
        description="outline, filled, truth, mask, edges, samples, cost, particles; with commas.",
    ),
]

Knobs = Annotated[
    str, Query(max_length=4000, description='Knobs as a JSON object, such as {"mask_threshold": 6}.')
]

Posed = Annotated[
    str,
    Query(
        max_length=4000,
        description="Whose outlines are drawn: start, the session's start pose, or numbers with commas.",
    ),
]


@router.get("/sessions/{session}" + VIEW, response_class=Response)
def picture(
    session: OpenSession,
    frame: int,
    camera: str,
    show: Show = "",
    height: Height = None,
    settings: Knobs = "",
    pose: Posed = "",
) -> Response:
    """What a camera saw in a frame; without a run, masks and edges are made with the session's settings, and with
    `settings` instead of these where given: a preview that changes nothing.
    """
    _check_view(session, frame, camera)
    wanted = session_settings(session, changes=knob_changes(settings))
    picture = compose_view(
        session, None, frame, camera, _layers(show), _posed(session, pose), height=height, settings=wanted
    )
    return files.picture(encode_jpeg(picture))


@router.get(RUN + VIEW, response_class=Response)
def overlay(
    session: OpenSession,
    run: OpenRun,
    frame: int,
    camera: str,
    show: Show = "outline",
    height: Height = None,
    track: Annotated[str, Query(max_length=64, description="Whose pose is projected.")] = RAW,
    beside: Annotated[
        str, Query(max_length=4000, description="Another pose that is outlined too: numbers with commas.")
    ] = "",
    compared: Annotated[
        str,
        Query(
            max_length=400,
            description="Other runs of the session that are outlined too, with commas, coloured by their place.",
        ),
    ] = "",
) -> Response:
    """What a camera saw in a frame, with the run's answer and evidence over it at choice."""
    _check_view(session, frame, camera, run)
    pose = None if track == RAW else pose_in_track(run, track, frame)
    others = [OtherBody(_numbers(beside, len(run.record.parameters)), "tried")] if beside else []
    for at, name in enumerate(compared.split(",") if compared else ()):
        # One of another session, whose cameras are others, has its place and colour all the same.
        if name and (found := _body_of(session, name, frame, at + 1)):
            others.append(found)
    own = "stored" if beside else "series-0" if others else ""
    picture = compose_view(
        session, run, frame, camera, _layers(show), pose, height=height, beside=others, own=own
    )
    return files.picture(encode_jpeg(picture))


def _body_of(session: Session, name: str, frame: int, place: int) -> OtherBody | None:
    """The body of another run in a frame, in the colour of its place among those compared; None where it has none.

    Raises NotFoundError for an unknown run, SettingsError for more than are compared.
    """
    if place >= MOST:
        raise SettingsError(f"{place} runs are too many.", f"Name at most {MOST - 1} beside the run itself.")
    run = session.run(name)
    with run.results() as results:
        try:
            pose = results.result(frame).estimate.pose
        except NotFoundError:
            return None
    return OtherBody(pose, f"series-{place}", run.body())


def knob_changes(text: str) -> dict[str, object]:
    """The knobs of a JSON object. Raises SettingsError for anything else."""
    if not text:
        return {}
    try:
        return decode_json(text, dict[str, object])
    except msgspec.DecodeError:
        raise SettingsError(
            "The settings are no JSON object of knobs.", 'Write them like {"mask_threshold": 6}.'
        ) from None


def _posed(session: Session, text: str) -> NDArray[np.float64] | None:
    """The pose that is meant, None for none. Raises SettingsError for what is neither."""
    if text in ("", START):
        return session.start_pose() if text else None
    return _numbers(text, len(session.body().parameters))


def _numbers(text: str, size: int) -> NDArray[np.float64]:
    """(D,) the pose of a text of numbers with commas. Raises SettingsError."""
    try:
        pose = np.array([float(word) for word in text.split(",")])
    except ValueError:
        pose = np.zeros(0)
    if len(pose) != size or not within_reach(pose):
        raise SettingsError(
            "The pose is not one of the body.",
            "Give its parameters in order, with commas, or 'start'.",
        )
    return pose


def _layers(show: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(word.strip() for word in show.split(",") if word.strip()))


def _check_view(session: Session, frame: int, camera: str, run: StoredRun | None = None) -> None:
    """Raise NotFoundError for what the session does not have, before any footage is opened."""
    last = session.manifest.frame_count
    if run is not None and run.record.ping_pong:
        last = max(last, run.record.last)
    if not 0 <= frame < last:
        raise NotFoundError(
            f"Session '{session.name}' has no frame {frame}.", f"It has frames 0 to {last - 1}."
        )
    names = [source.name for source in session.manifest.footage.cameras]
    if camera not in names:
        raise NotFoundError(
            f"Session '{session.name}' has no camera '{camera[:64]}'.", f"It has {', '.join(names)}."
        )
