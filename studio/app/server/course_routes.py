"""The guide's course: which of its runs are there, and making them in the background."""

from fastapi import APIRouter

from studio.app.server.app_state import App
from studio.app.server.schemas import Answer
from studio.foundations.errors import StudioError
from studio.operations.course import BEGINNING_RUN, RUNS, SAMPLE, begins, finished, make_course
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.operations.jobs.process_executor import cores

router = APIRouter(prefix="/api/course", tags=["course"])


class CourseState(SessionJob):
    """How the making of the course's runs stands."""


COURSE = JobKind(
    "course",
    "making of the course's runs",
    CourseState,
    changes_session=True,
    makes_session=True,
    busy="The course's runs are being made.",
    page="/guide/course",
)


class CourseRunLine(Answer):
    """A run of the course. there: whether it is tracked to its end."""

    name: str
    words: str
    there: bool


class CourseView(Answer):
    """The course's runs. job: how their making stands, null where nobody has begun it."""

    session: str
    runs: list[CourseRunLine]
    job: CourseState | None


@router.get("")
def course_runs(app: App) -> CourseView:
    """The course's runs, and whether they are there."""
    try:
        session = app.workspace.session(SAMPLE)
    except StudioError:
        session = None
    return CourseView(
        session=SAMPLE,
        runs=[
            CourseRunLine(name=BEGINNING_RUN, words="an arm of four links", there=begins(app.workspace)),
            *(
                CourseRunLine(
                    name=one.name, words=one.words, there=session is not None and finished(session, one)
                )
                for one in RUNS
            ),
        ],
        job=app.jobs.known(COURSE, SAMPLE),
    )


@router.post("", status_code=202)
def begin_course(app: App) -> CourseState:
    """Make what is missing of them. 409 while that is going on."""

    def work(job: Job) -> dict[str, object]:
        # One core stays free for the studio itself.
        processes = max(1, cores() - 1)
        make_course(app.workspace, job.report_or_stop, processes=processes, checkpoint=job.check)
        return {}

    return app.jobs.begin(COURSE, CourseState(session=SAMPLE), work)


@router.delete("", status_code=202)
def cancel_course(app: App) -> CourseState:
    """Stop it; what is tracked stays. 404 where nothing was begun."""
    app.jobs.cancel(COURSE, SAMPLE)
    return app.jobs.state(COURSE, SAMPLE)
