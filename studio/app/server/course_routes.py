"""The guide's course: which of its runs exist, and making them in the background."""

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.operations.course import COURSE, SAMPLE, CourseState, CourseView, course_view, make_course
from studio.operations.jobs.comparison_run import processes_beside
from studio.operations.jobs.job_runner import Job

router = Router(prefix="/api/course", tags=["course"])


@router.get("")
def course_runs(app: App) -> CourseView:
    """The course's runs, and whether they exist."""
    return course_view(app.workspace, app.jobs.known(COURSE, SAMPLE))


@router.post("", status_code=202)
def begin_course(app: App) -> CourseState:
    """Make what is missing of them. 409 while that is going on."""

    def work(job: Job) -> dict[str, object]:
        make_course(app.workspace, job.report_or_stop, processes=processes_beside(), checkpoint=job.check)
        return {}

    return app.jobs.begin(COURSE, CourseState(session=SAMPLE), work)


@router.delete("", status_code=202)
def cancel_course(app: App) -> CourseState:
    """Stop it; what is tracked stays. 404 where nothing was begun."""
    app.jobs.cancel(COURSE, SAMPLE)
    return app.jobs.state(COURSE, SAMPLE)
