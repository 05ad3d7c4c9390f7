"""A check of a run's track, as OpenAPI shows it."""

from pydantic import Field

from studio.server.schemas import Answer, Number


class JumpLine(Answer):
    """A limb that leaps into a frame. mm: the largest second difference of its markers; usual_mm: the median."""

    frame: int
    limb: str
    mm: Number
    usual_mm: Number


class CheckLine(Answer):
    """What was measured. inside: per looked-at frame and camera, the share of the model's pixels that lie in the mask;
    covered: of the mask's, under the model. poor: frames whose views have too little of it inside; turned: sudden
    turns. lost_limbs: limbs that the masks deny in more than one of the frames, with these.
    """

    cameras: list[str]
    frames: list[int]
    inside: list[list[Number]]
    covered: list[list[Number]]
    poor: list[int]
    lost: list[int]
    doubtful: list[int]
    turned: list[int]
    jitter_mm: Number
    jumps: list[JumpLine] = Field(default_factory=list[JumpLine])
    lost_limbs: dict[str, list[int]] = Field(default_factory=dict)
    inside_mean: Number
    good: bool
    words: str


class CheckAnswer(Answer):
    """track: the one that is requested; usual: the best, which is exported unless another is chosen; note: on better
    tracks that are out of date; check: null before.
    """

    track: str
    usual: str
    note: str = ""
    check: CheckLine | None
