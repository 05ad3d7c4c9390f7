"""Who is in front of the cameras, as OpenAPI shows it."""

from typing import Literal

from pydantic import Field

from studio.jobs.job_runner import NumberedJob
from studio.server.schemas import Answer, Number, Numbers


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
    frames: list[int] = Field(default_factory=list[int])
    poses_from: str = ""
    sizes: list[SizeLine] = Field(default_factory=list[SizeLine])
    overlap_before: Numbers | None = None
    overlap: Numbers | None = None
    limbs: list[LimbDrawing] = Field(default_factory=list[LimbDrawing])
    file: str = ""
