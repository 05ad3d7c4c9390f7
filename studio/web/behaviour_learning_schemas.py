"""Learning a behaviour model, as OpenAPI shows it."""

from pydantic import Field

from studio.training.sources import FPS
from studio.web.schemas import Answer, Request, RunName, Value
from studio.web.setting_schemas import KnobView
from studio.worker.jobs import SessionJob

Source = str


class LearningRequest(Request):
    """What a model is learnt from: runs as SESSION/RUN, bundled recipes by name, and the motion files of an upload
    (.amc with its .asf, .bvh, .npz, .c3d, .trc, or one .zip of them). tests: sources that the entropy is measured on;
    without any the last fifth of each source is. settings: knobs that are not to be as they are.
    """

    name: RunName
    body: RunName
    sources: list[Source] = Field(default_factory=list, max_length=500)
    tests: list[Source] = Field(default_factory=list, max_length=500)
    upload: RunName | None = None
    fps: float = Field(FPS, ge=5.0, le=240.0)
    seed: int = Field(0, ge=0, le=2**63 - 1)
    settings: dict[str, Value] = Field(default_factory=dict)


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
