"""The footage of a run, whose frame numbers may differ from the files'."""

from studio.capture.footage import Footage, PingPong
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
