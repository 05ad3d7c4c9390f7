"""Whether cameras agree on the silhouettes, as OpenAPI shows it."""

from pydantic import Field

from studio.jobs.job_runner import SessionJob
from studio.server.schemas import Answer, Number


class AlignmentLine(Answer):
    """One camera. before_px, after_px: by which the silhouettes miss, as it stands and turned (median, null where
    nothing shows); turn_degrees: by which it would be turned.
    """

    camera: str
    before_px: Number
    after_px: Number
    turn_degrees: Number


class AlignmentJob(SessionJob):
    """How comparing the cameras stands, and what came of it. needed: the misses matter; better: turning the cameras
    explains them; words: a sentence; kept: the session uses the turned cameras.
    """

    cameras: list[AlignmentLine] = Field(default_factory=list[AlignmentLine])
    frames: list[int] = Field(default_factory=list[int])
    needed: bool = False
    better: bool = False
    words: str = ""
    kept: bool = False


class AlignmentAnswer(Answer):
    """possible: there are several calibrated cameras. job: under way, or the last one with the calibration in use.
    turned: the cameras in use were turned from an earlier calibration, which can be had back. notes: what a change just
    made means for what is there.
    """

    session: str
    possible: bool
    job: AlignmentJob | None
    turned: bool
    notes: list[str] = Field(default_factory=list)
