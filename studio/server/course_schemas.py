"""The guide's course, as OpenAPI shows it."""

from studio.jobs.job_runner import SessionJob
from studio.server.schemas import Answer


class CourseState(SessionJob):
    """How the making of the course's runs stands."""


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
