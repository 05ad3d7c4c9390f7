"""Brush strokes on the pictures of a session's cameras, and the mask that they give in one frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from studio.evidence.strokes import Stroke
from studio.runs.drawing.overlay_drawing import upright
from studio.runs.setup.stroke_masks import by_frame, first_frame, preview_mask
from studio.sessions.session import Session
from studio.sessions.stroke_files import made_of_strokes, read_strokes, replace_strokes

SHOWN_HEIGHT = 1080
SHOWN = (120, 220, 90, 115)
"""Colour of a mask over its picture: blue, green, red, opacity."""


@dataclass(frozen=True, slots=True)
class CameraStrokes:
    """One camera.

    ready : whether it has a stroke inside the subject.
    made : whether its masks in use are made from these strokes.
    """

    camera: str
    strokes: tuple[Stroke, ...]
    ready: bool
    made: bool


@dataclass(frozen=True, slots=True)
class Strokes:
    """The strokes of all cameras."""

    cameras: tuple[CameraStrokes, ...]


def strokes_of(session: Session) -> Strokes:
    """The strokes that were painted on the cameras' pictures. Raises SessionError."""
    painted, earlier = read_strokes(session), made_of_strokes(session)
    before = () if earlier is None else earlier.made.strokes
    cameras: list[CameraStrokes] = []
    for source in session.manifest.footage.cameras:
        own = tuple(one for one in painted if one.camera == source.name)
        ready = first_frame(by_frame(own, source.name)) is not None
        made = ready and own == tuple(one for one in before if one.camera == source.name)
        cameras.append(CameraStrokes(source.name, own, ready, made))
    return Strokes(tuple(cameras))


def keep_strokes(session: Session, camera: str, strokes: Sequence[Stroke]) -> Strokes:
    """Keep these strokes of a camera in place of the old ones; the masks stay until they are made again.

    Raises NotFoundError, FootageError for strokes that do not fit the session.
    """
    replace_strokes(session, session.camera_source(camera).name, strokes)
    return strokes_of(session)


def preview_strokes(session: Session, camera: str, frame: int, strokes: Sequence[Stroke]) -> bytes | None:
    """Roughly the mask that strokes give in a frame: a transparent PNG to lie over the camera's upright picture; None
    where no stroke reaches the frame yet. Changes nothing.

    Raises NotFoundError, FootageError.
    """
    source = session.camera_source(camera)
    mask = preview_mask(session, camera, frame, strokes)
    if mask is None:
        return None
    if mask.shape[0] > SHOWN_HEIGHT:
        size = round(source.width * SHOWN_HEIGHT / source.height), SHOWN_HEIGHT
        mask = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_AREA), np.uint8)
    calibrated = session.cameras() if session.is_calibrated else ()
    turns = next((one.quarter_turns for one in calibrated if one.name == camera), 0)
    shown = np.where(upright(mask, turns)[..., None] > 127, np.array(SHOWN, np.uint8), np.uint8(0))
    return cv2.imencode(".png", shown)[1].tobytes()
