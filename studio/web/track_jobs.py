"""Work on a session's poses and tracks in the background, told as `track` events."""

from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.web.background_jobs import Work
from studio.web.doors import Doors
from studio.web.job_kinds import TRACK
from studio.web.track_schemas import TrackJobState, Verb


def begin_job(doors: Doors, verb: Verb, session: Session, run: StoredRun | None, work: Work) -> TrackJobState:
    """Begin `work` in a thread; its answer goes into the state. run : that it is about, if it is about one."""
    state = TrackJobState(verb=verb, session=session.name, run=run.name if run else "")
    return doors.jobs.begin(TRACK, state, work)
