"""Results, as OpenAPI shows them."""

from pydantic import Field

from studio.server.schemas import Answer, Number, Numbers, ParameterView, Request, Value
from studio.server.setting_schemas import SettingsChange


class FrameLine(Answer):
    """A finished frame in the timeline. lost: whether a limb is off by more than 150 mm (with truth only). tracking:
    whether the tracker thinks that it is on the body.
    """

    frame: int
    log_weight: Number
    milliseconds: Number
    evaluations: int
    layers: int
    settings_version: int
    error_mm: Number = None
    lost: bool = False
    lost_limbs: list[str] = Field(
        default_factory=list[str], description="Limbs that are off by more than 150 mm (truth)."
    )
    tracking: str = Field("tracked", description="tracked, limb lost, lost, no evidence or recovered.")


class LiveView(Answer):
    """How a live run went. dropped: frames that came and were not tracked; incomplete: moments of a take at which not
    every camera's picture came in time. latencies_ms: from the last picture of a set
    to its pose, of the tracked frames in order.
    """

    tracked: int
    dropped: list[int]
    dropped_share: float
    incomplete: list[int] = Field(default_factory=list[int])
    frames_per_second: Number
    latency_median_ms: Number
    latency_p95_ms: Number
    latency_worst_ms: Number
    latencies_ms: Numbers


class FramesSummary(Answer):
    """A run's frames. first, last: half open. truth_problem: why the error cannot be measured though there
    is a truth.
    """

    first: int
    last: int
    fps: float
    describe: str
    score: tuple[str, str] = Field(description="What the best particle is reported by, and its unit.")
    frames: list[FrameLine]
    settings_changes: list[SettingsChange]
    damaged: dict[int, str] = Field(
        {}, description="Frames damaged on the disk, and what of each; resuming the run tracks them again."
    )
    checked: bool = Field(True, description="Whether all that is stored was read and checked for damage.")
    partial: int | None = Field(None, description="The frame in which the search stands, if it does.")
    mean_mm: Number = None
    worst_mm: Number = None
    mean_milliseconds: Number = None
    truth_problem: str = ""
    made_from: str | None = Field(None, description="The run that this one corrects.")
    corrected: int | None = Field(None, description="The frame whose pose was given.")
    backwards_to: int | None = Field(None, description="The last frame tracked backwards; null: onwards.")
    track: str = Field("raw", description="Whose poses the errors are of.")


class LayerView(Answer):
    """One layer without its particles; the same entries as a `layer` event."""

    frame: int
    layer: int
    settings_version: int
    beta: Number
    alpha_wanted: Number
    alpha_reached: Number
    model_free_share: Number = Field(
        None, description="Of a frame's first layer: particles moved without the behaviour model."
    )
    variance_weighed: Numbers
    variance_resampled: Numbers
    variance_diffused: Numbers
    best: Numbers
    mean: Numbers
    best_log_weight: Number
    log_weight_quantiles: Numbers
    effective_share: Number
    particles: int
    milliseconds: Number


class FrameDetail(Answer):
    """A frame with all its layers. pose, mean, mode and log_weight are null in a frame that is not
    finished.
    """

    frame: int
    finished: bool
    parameters: list[ParameterView]
    layers: list[LayerView]
    pose: Numbers | None
    mean: Numbers | None
    mode: Numbers | None
    log_weight: Number
    evaluations: int
    milliseconds: Number
    settings_version: int
    tracking: str | None = Field(None, description="As in the timeline; null in an unfinished frame.")
    searched: list[float] | None = Field(
        None, description="The pose that the search found, where `pose` was refined after it."
    )
    disagreement: dict[str, float] = Field(
        {}, description="Of each limb, the share of its area that silhouettes and pose do not agree about."
    )
    limbs_lost: list[str] = Field([], description="Limbs that are probably not where the pose has them.")
    notes: list[str] = Field(
        [],
        description="What its numbers do not say: weights that chose nothing, cameras that showed nothing.",
    )
    settings: dict[str, Value]


class ParticlesView(Answer):
    """The particles of a layer as they were weighed. log_weights: raw, before β."""

    frame: int
    layer: int
    beta: Number
    parameters: list[str]
    poses: list[Numbers]
    log_weights: Numbers


class PoseError(Answer):
    """How far a pose is from the truth, mm. limbs: by limb."""

    error_mm: Number
    limbs: dict[str, Number]


class PoseGiven(Request):
    """A pose, radians and mm, in the order of the run's parameters."""

    pose: list[float] = Field(max_length=512)


class Outcome(Answer):
    """A frame's stored pose and another one. before, after: null without a truth in this frame."""

    frame: int
    log_weight: Number
    evaluations: int
    milliseconds: Number
    before: PoseError | None = None
    after: PoseError | None = None


class EvaluationView(Answer):
    """A run against the session's truth, in mm, without alignment unless said.

    lost_frames: how many frames have a limb that is off by more than 150 mm; lost_frame_numbers: which.
    without_offsets_mm: with each marker's constant offset removed; common_offset_mm: the mean of these offsets.
    """

    frames: list[int]
    mean_mm: Number
    std_mm: Number
    worst_mm: Number
    lost_frames: int
    lost_frame_numbers: list[int]
    lost_limbs: list[str]
    per_marker_mm: dict[str, Number]
    per_frame_mm: Numbers
    root_aligned_mm: Number
    procrustes_mm: Number
    without_offsets_mm: Number
    common_offset_mm: Number
    unmatched_markers: list[str]
