"""Behaviour models, as OpenAPI shows them. Poses come as limbs: (limb, two ends, 3) mm, the root at rest."""

from pydantic import Field

from studio.server.schemas import Answer, Request, RunName

Limbs = list[list[list[float]]]


class ModelName(Request):
    """Another name for a model."""

    name: RunName


class BehaviourLine(Answer):
    """A model in a list. problem: why it cannot be read, "" if it can."""

    name: str
    body: str = ""
    fps: float = 0.0
    frames: int = 0
    clusters: int = 0
    states: int = 0
    memory: int = 0
    epsilon: float = 0.0
    entropy_train: float | None = Field(None, description="Nats a frame.")
    entropy_test: float | None = Field(
        None, description="Nats a frame; null where nothing was kept for a test."
    )
    sources: list[str] = Field(default_factory=list)
    problem: str = ""


class BehaviourList(Answer):
    """The workspace's models by name."""

    models: list[BehaviourLine]


class LimbShape(Answer):
    """A limb as a picture needs it: radii at its two ends, mm."""

    name: str
    side: str
    radius_start: float
    radius_end: float


class ClusterPicture(Answer):
    """An elementary movement. share: of the training frames. stays: frames in a row, in the mean. limbs: of its
    prototype. arrows: from where to where the extremities go in `BehaviourDetail.arrow_seconds`, at the mean of the
    cluster's derivatives. source: the recording of the prototype, frame: its frame in it.
    """

    cluster: int
    share: float
    stays: float
    limbs: Limbs
    arrows: Limbs
    source: str
    frame: int


class Transition(Answer):
    """How often a cluster follows another, of the times that the first is left."""

    source: int
    target: int
    probability: float


class BehaviourDetail(Answer):
    """A model. clusters: most frequent first. transitions: between different clusters, memory left aside.
    context_lengths: states of the automaton by the length of their history, 0 first; kept_lengths: those of them that
    passed the ε test. problem: why no poses can be shown, "" if they can.
    """

    model: BehaviourLine
    problem: str = ""
    limbs: list[LimbShape]
    arrow_seconds: float
    clusters: list[ClusterPicture]
    transitions: list[Transition]
    context_lengths: list[int]
    kept_lengths: list[int]


class EntropyLine(Answer):
    """Entropies over memory for one ε, nats a frame: of what the automaton was learnt from, and of the rest."""

    epsilon: float
    memory: list[int]
    states: list[int]
    train: list[float]
    test: list[float]


class Entropies(Answer):
    """The automaton learnt again from four of five recordings (where there are fewer than five: four fifths of each),
    tested on the rest.
    """

    lines: list[EntropyLine]


class GeneratedWalk(Answer):
    """A walk through the automaton. frames: limbs of every frame; clusters, histories: where it is in each."""

    seed: int
    fps: float
    frames: list[Limbs]
    clusters: list[int]
    histories: list[list[int]]
