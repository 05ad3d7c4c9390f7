"""Who is in front of the cameras, as OpenAPI shows it."""

from typing import Literal

from pydantic import Field

from studio.body.subject import SHORTEST_MM, TALLEST_MM
from studio.web.schemas import Answer, Number, Numbers, Request, RunName
from studio.worker.jobs import NumberedJob


class SubjectRequest(Request):
    """A person by height alone (mm), all lengths by published proportions, and measured lengths if there are any."""

    height_mm: float = Field(ge=SHORTEST_MM, le=TALLEST_MM)
    body: RunName | None = Field(None, description="Kinematic tree; null: the session's.")
    lengths_mm: dict[str, float] = Field(
        default_factory=dict, description="Pairs of markers: RHip_RKnee to mm."
    )


class LimbDrawing(Answer):
    """A drawn limb of the body as it stands upright. start, end: mm, x to the front, y to the left, z up. radii: at
    both. dimension: the name of its length, "" where it has none.
    """

    name: str
    side: str
    start: list[float]
    end: list[float]
    radii: tuple[float, float]
    dimension: str


class SubjectAnswer(Answer):
    """A session's person. dimensions: mm (ratios without unit), by the body's own names. source: of proportions.
    saved: whether the session has a subject at all; fitted: whether it was fitted to the footage.
    """

    body: str
    height_mm: Number
    dimensions: dict[str, float]
    notes: list[str]
    source: str
    limbs: list[LimbDrawing]
    saved: bool = False
    fitted: bool = False


class FitSubjectRequest(Request):
    """What a fit looks at and may change. frames: empty chooses `count` of them. keep: as the session's own."""

    frames: list[int] = Field(default_factory=list, max_length=24)
    count: int = Field(5, ge=1, le=24)
    symmetric: bool = True
    lengths: bool = True
    radii: bool = True
    run: RunName | None = Field(None, description="Whose poses to begin with; null: the newest.")
    body: RunName | None = None
    height_mm: float | None = Field(None, ge=SHORTEST_MM, le=TALLEST_MM)
    seed: int = Field(0, ge=0, le=2**63 - 1)
    keep: bool = Field(True, description="Write it as the session's subject; the old one stays beside it.")


class SizeLine(Answer):
    """A group of dimensions, mm. deviation: one standard deviation of `after`."""

    name: str
    kind: Literal["length", "radius"]
    before: Number
    after: Number
    deviation: Number


class FitSubjectState(NumberedJob):
    """How a fit stands. overlap: f_s of each frame's silhouettes.
    limbs: of the body that was found. file: what it was kept as, "" where it is not.
    """

    body: str = ""
    frames: list[int] = Field(default_factory=list)
    poses_from: str = ""
    sizes: list[SizeLine] = Field(default_factory=list)
    overlap_before: Numbers | None = None
    overlap: Numbers | None = None
    limbs: list[LimbDrawing] = Field(default_factory=list)
    file: str = ""
