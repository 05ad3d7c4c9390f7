"""Finding a start pose, as OpenAPI shows it."""

from pydantic import Field

from studio.web.schemas import Number, Numbers, Request, RunName
from studio.worker.jobs import NumberedJob


class InitialisationRequest(Request):
    """Where a start pose is sought. replace: make it the session's start pose (the old one stays beside it); a session
    without one gets it anyway.
    """

    frame: int = Field(0, ge=0)
    body: RunName | None = Field(None, description="Kinematic tree; null: the session's.")
    behaviour: RunName | None = Field(None, description="A model whose prototypes are tried.")
    weighting: RunName | None = Field(None, description="What tells poses apart.")
    seed: int = Field(0, ge=0, le=2**63 - 1)
    replace: bool = False


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
