"""Pictures of a session's footage, also before there is a calibration."""

import dataclasses
from contextlib import closing

import cv2
import numpy as np

from studio.footage.capture.footage import open_footage
from studio.foundations.arrays import Bytes
from studio.foundations.errors import NotFoundError
from studio.sessions.session import Session


def bare_picture(session: Session, camera: str, frame: int, height: int | None = None) -> Bytes:
    """A camera's picture (h, w, 3) BGR with its offset and rotation applied, scaled down to at most `height`.

    Raises NotFoundError for an unknown camera or frame, FootageError.
    """
    source = session.manifest.footage
    entries = [entry for entry in source.cameras if entry.name == camera]
    if not entries or not 0 <= frame < source.frame_count:
        names = ", ".join(entry.name for entry in source.cameras) or "no camera"
        raise NotFoundError(
            f"Session '{session.name}' has no frame {frame} of camera '{camera[:64]}'.",
            f"It has {source.frame_count} frames of {names}.",
        )
    one = dataclasses.replace(source, cameras=(entries[0],))
    with closing(open_footage(one, session.path)) as footage:
        picture = footage.picture(camera, frame)
    if height is None or height >= picture.shape[0]:
        return picture
    width = max(1, round(picture.shape[1] * height / picture.shape[0]))
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
