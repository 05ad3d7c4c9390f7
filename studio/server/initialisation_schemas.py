"""Finding a start pose, as OpenAPI shows it."""

from pydantic import Field

from studio.jobs.job_runner import NumberedJob
from studio.server.schemas import Number, Numbers


class InitialisationState(NumberedJob):
    """How the search stands.

    pose: radians and mm, in the order of `parameters`. confidence: 0 to 1, that the body stands so and faces so.
    margin: log weight by which the best pose that faces the other way is beaten, null without one. overlap: of the
    silhouettes. file: that it was written to, in the session's folder.
    """

    frame: int
    body: str = ""
    parameters: list[str] = Field(default_factory=list)
    pose: Numbers | None = None
    confidence: Number = None
    margin: Number = None
    overlap: Number = None
    source: str = ""
    note: str = ""
    file: str = ""
