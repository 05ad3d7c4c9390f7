"""Camera pictures as JPEG, upright, bare or with what was seen and projected drawn over them."""

from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np
from fastapi import APIRouter, Depends, Query, Response

from studio.app.server import files
from studio.app.server.run_routes import RUN, RunInPath
from studio.app.server.session_routes import OpenSession
from studio.foundations.arrays import Array
from studio.foundations.errors import SettingsError
from studio.foundations.typed_decoding import decode_json
from studio.operations.pictures import View, run_picture, session_picture
from studio.runs.tracks import RAW

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
    posed = session.start_pose() if pose == START else _numbers(pose)
    view = View(frame, camera, _layers(show), height)
    return files.picture(session_picture(session, view, knob_changes(settings), posed))


@dataclass(frozen=True, slots=True)
class Drawn:
    """What is drawn of a run, and of others beside it."""

    track: Annotated[str, Query(max_length=64, description="Whose pose is projected.")] = RAW
    beside: Annotated[
        str, Query(max_length=4000, description="Another pose that is outlined too: numbers with commas.")
    ] = ""
    compared: Annotated[
        str,
        Query(
            max_length=400,
            description="Other runs of the session that are outlined too, with commas, coloured by their place.",
        ),
    ] = ""


@router.get(RUN + VIEW, response_class=Response)
def overlay(
    session: OpenSession,
    run: RunInPath,
    frame: int,
    camera: str,
    drawn: Annotated[Drawn, Depends(Drawn)],
    show: Show = "outline",
    height: Height = None,
) -> Response:
    """What a camera saw in a frame, with the run's answer and evidence over it at choice."""
    beside = _numbers(drawn.beside)
    compared = drawn.compared.split(",") if drawn.compared else ()
    view = View(frame, camera, _layers(show), height)
    return files.picture(run_picture(session, run, view, track=drawn.track, beside=beside, compared=compared))


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


def _numbers(text: str) -> Array | None:
    """(D,) the pose of a text of numbers with commas, None without one. Raises SettingsError."""
    if not text:
        return None
    try:
        return np.array([float(word) for word in text.split(",")])
    except ValueError:
        raise SettingsError(
            "The pose is not one of the body.", "Give its parameters in order, with commas, or 'start'."
        ) from None


def _layers(show: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(word.strip() for word in show.split(",") if word.strip()))
