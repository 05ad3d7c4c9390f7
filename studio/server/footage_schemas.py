"""A session's footage in step: offsets, turns and their estimate, as OpenAPI shows them."""

from pydantic import Field

from studio.jobs.job_runner import SessionJob
from studio.server.schemas import Answer

MOST_OFFSET = 1_000_000


class FootageCamera(Answer):
    """One camera's footage. offset: the file's frame that is frame 0 of the session. turned: degrees clockwise."""

    name: str
    kind: str
    offset: int
    turned: int
    width: int
    height: int
    frame_count: int
    has_masks: bool
    has_background: bool


class FootageState(Answer):
    """How a session's cameras are put together. frame_count: frames that all have. stale_runs: those made before the
    footage was last changed. notes: what the change that was just made means.
    """

    session: str
    layout: str
    fps: float
    frame_count: int
    cameras: list[FootageCamera]
    stale_runs: list[str]
    notes: list[str] = Field(default_factory=list)


class TimedAnswer(Answer):
    """Offsets by a recorder's times; nothing of it is applied. apart: frames that they are apart at most after it."""

    offsets: dict[str, int]
    apart: float
    notes: list[str]


class PairView(Answer):
    """Two cameras by themselves: lag in frames, correlation there, peak over the next best, frames nearly as good."""

    first: str
    second: str
    lag: int
    peak: float
    ratio: float
    within: int
    sure: bool


class SynchronyState(SessionJob):
    """How an estimate of the offsets stands, and what it found; nothing of it is applied. confidence: peak over second
    peak; spread: frames that it may be off.
    """

    offsets: dict[str, int] = Field(default_factory=dict)
    confidence: dict[str, float] = Field(default_factory=dict)
    spread: dict[str, int] = Field(default_factory=dict)
    sure: bool = False
    notes: list[str] = Field(default_factory=list)
    pairs: list[PairView] = Field(default_factory=list[PairView])
