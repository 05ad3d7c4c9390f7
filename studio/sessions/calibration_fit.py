"""Cameras from a file or from boards, named and sized as a session's footage is."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from studio.capture.calibration_files import AssumedCrop, Calibration
from studio.capture.footage_fit import NO_BARS, Margins, black_margins, fit_camera
from studio.capture.footage_source import CameraSource
from studio.capture.naming import CameraMatch, listed, match_names
from studio.errors import CalibrationError, FootageError
from studio.geometry.camera import Camera
from studio.sessions.session import Session


@dataclass(frozen=True, slots=True, eq=False)
class FittedCameras:
    """cameras : in the footage's order, or all where there is no footage yet. crops : what was assumed to make sizes
    agree. matching : footage to the calibration's own names. warnings : sentences.
    """

    cameras: tuple[Camera, ...]
    crops: dict[str, AssumedCrop]
    matching: tuple[CameraMatch, ...]
    warnings: tuple[str, ...]


def fit_to_session(
    session: Session, cameras: Sequence[Camera], *, sizes_known: bool = True, read: Calibration | None = None
) -> FittedCameras:
    """Match cameras with a session's footage and fit them to its size.

    sizes_known : False where the cameras' sizes stand in for unknown ones. read : the file they are of, for crops that
    it stored. Raises CalibrationError where names or sizes cannot be matched.
    """
    sources = session.manifest.footage.cameras
    if not sources:
        return FittedCameras(tuple(cameras), dict(read.crops) if read else {}, (), ())
    matches = match_names(
        [source.name for source in sources],
        [camera.name for camera in cameras],
        "cameras of the footage",
        CalibrationError,
    )
    known = {camera.name: camera for camera in cameras}
    fitted: list[Camera] = []
    crops: dict[str, AssumedCrop] = {}
    warnings: list[str] = []
    for source, match in zip(sources, matches, strict=True):
        camera = dataclasses.replace(known[match.camera], name=source.name)
        size, crop = (source.width, source.height), None
        if not sizes_known:
            camera = dataclasses.replace(camera, width=size[0], height=size[1])
        elif size != (camera.width, camera.height):
            camera, crop = fit_camera(camera, *size, _bars(session, source))
        if crop is not None:
            warnings.append(
                f"The footage of camera {source.name} is {size[0]}x{size[1]}. {crop.words(source.name)}"
            )
        kept = crop or (read.crops.get(match.camera) if read else None)
        if kept is not None:
            crops[source.name] = kept
        fitted.append(camera)
    left = [camera.name for camera in cameras if camera.name not in {match.camera for match in matches}]
    if left:
        warnings.append(f"Calibrated camera {listed(left)} has no footage and is left out.")
    return FittedCameras(tuple(fitted), crops, matches, tuple(warnings))


def _bars(session: Session, source: CameraSource) -> Margins:
    """The black margins of a camera's footage; none where it cannot be read."""
    try:
        footage = session.footage()
    except FootageError:
        return NO_BARS
    try:
        return black_margins(lambda frame: footage.picture(source.name, frame), footage.frame_count)
    except FootageError:
        return NO_BARS
    finally:
        footage.close()
