"""Learning a behaviour model, as OpenAPI shows it."""

from pydantic import Field

from studio.jobs.job_runner import SessionJob
from studio.server.schemas import Answer
from studio.server.setting_schemas import KnobView

Source = str


class LearningProgress(SessionJob):
    """How the learning stands. learnt: frames, clusters, states, entropies and the frames that fitted badly, when it is
    done.
    """

    name: str
    body: str
    learnt: dict[str, object] = Field(default_factory=dict)


class LearningChoices(Answer):
    """What a form needs: the knobs group after group, the bodies, the endings of motion files, bundled recipes of a
    person, and what is being learnt or was last, null before the first.
    """

    knobs: list[KnobView]
    bodies: list[str]
    default_body: str
    fps: float
    endings: list[str]
    recipes: list[str]
    progress: LearningProgress | None
