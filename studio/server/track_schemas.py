"""Tracks of a run, refining, smoothing and correcting, as OpenAPI shows them."""

from typing import Literal

from pydantic import Field

from studio.jobs.job_runner import NumberedJob
from studio.server.schemas import Answer, Number
from studio.server.setting_schemas import KnobView

Verb = Literal["refine", "smooth", "correct", "pose", "check"]


class TrackLine(Answer):
    """A track of a run. made_by: verb, what it was made from, settings, and of a smoothed one the frames that were
    filled and left out; empty for raw. jitter_mm: root mean square second difference of the markers. mean_mm, worst_mm:
    against the session's truth; mean_angle_deg, mean_direction_deg: the same, of the angles between limbs and of the
    limbs' directions.
    """

    name: str
    frames: int
    made_by: dict[str, object] = Field(default_factory=dict)
    jitter_mm: Number = None
    mean_mm: Number = None
    mean_angle_deg: Number = None
    mean_direction_deg: Number = None
    worst_mm: Number = None


class TrackList(Answer):
    """The run's tracks, raw first, those under way, and the knobs of refining and smoothing."""

    tracks: list[TrackLine]
    running: list["TrackJobState"]
    refine_settings: list[KnobView]
    smooth_settings: list[KnobView]


class TrackJobState(NumberedJob):
    """How refining, smoothing or correcting stands.

    made_run: the corrected run. track: the track that is made. pose, gain, overlap_before, overlap: of a search around
    a pose (verb pose; run is "" where it is the session's).
    """

    verb: Verb
    run: str
    track: str = ""
    made_run: str = ""
    jitter_before_mm: Number = None
    jitter_after_mm: Number = None
    moved: int = 0
    filled: int = 0
    left_out: int = 0
    pose: list[float] | None = None
    gain: Number = None
    overlap_before: Number = None
    overlap: Number = None
