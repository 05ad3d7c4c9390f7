"""The footage of a run, whose frame numbers may differ from the files'."""

from studio.footage.capture.footage import Footage, PingPong
from studio.foundations.errors import RunError
from studio.foundations.geometry.camera import Camera
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


def footage_of(session: Session, run: StoredRun | None) -> Footage:
    """The footage by a run's frame numbers, the session's own without a run; close it when done.

    Raises FootageError if a file is gone.
    """
    footage = session.footage()
    if run is None or not run.record.ping_pong:
        return footage
    footage.close()
    return PingPong(footage.source, footage.folder)


def filmed_cameras(
    session: Session, cameras: tuple[Camera, ...], footage: Footage | None = None
) -> tuple[Camera, ...]:
    """Those of a run's cameras that there is footage of, the session's by default. Raises RunError if there is none
    left.
    """
    filmed = {source.name for source in (footage.source if footage else session.manifest.footage).cameras}
    kept = tuple(camera for camera in cameras if camera.name in filmed)
    if not kept:
        raise RunError(
            f"Session '{session.name}' has no footage any more of the cameras that the run was tracked with.",
            "Add that footage again, or track a new run.",
        )
    return kept
