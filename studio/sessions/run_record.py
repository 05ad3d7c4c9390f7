"""`run.json`: the request of a run, written once when it is made.

Everything that a run's poses depend on is here or in the run's folder: the body with its dimensions (`body/`), the
cameras (`cameras.toml`), the behaviour model if any (`search.behaviour.model`), the start pose, σ0, the seed and the
initial settings. Later settings and the progress are in the results store.
"""

from pathlib import Path

import msgspec

from studio.foundations.knobs import Value
from studio.sessions.manifest import FASTEST, MOST_FRAMES, is_time
from studio.sessions.record_files import RecordFile, renamed

SCHEMA_VERSION = 2
FILE_NAME = "run.json"
CAMERAS_NAME = "cameras.toml"
BEHAVIOUR_NAME = "behaviour.model"
OF_CLICKS = "clicked landmarks, carried to the other frames"
"""Start source of a run that no tracker searched."""


class RunRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A run's description.

    name : the run's folder. session : the session's name when the run was made. created : UTC, ISO 8601. first, last :
    frames, half open. fps : frames per second. settings : every knob by its flat name at the start. body : name or
    file of the body; dimensions : its lengths and radii, mm, as they were fitted to the subject. parameters : names of
    the pose vector. start_pose : radians and mm, None where the search starts uniformly. start_source : its origin, as
    text. sigma : σ0 of every parameter from frame to frame, rad and mm. software : the studio's version. notes : for
    readers of the results. behaviour : name of the behaviour model whose copy the run keeps, "" without one. live :
    frames came on a clock and those that came too fast were dropped; the results store lists the tracked ones.
    ping_pong : the footage is played forwards and backwards without end (`footage.capture.footage`), so that `last`
    may lie behind its end. made_from : the run that was corrected, or that this one leaves with other knobs, "" if
    none: other frames are that run's. corrected : the frame that restarts at corrected_pose. backwards_to : None
    where the frames after it follow from it; else these are the old ones, and from it down to this frame each was
    tracked from the one after it. subject_dimensions : the
    subject's, where the first frames gave the body another shape; empty where they did not. random_numbers : the kind
    that its search uses ("counted": `search.trackers.random_numbers`), "" if it was begun before they had a name.
    """

    schema: int = SCHEMA_VERSION
    name: str
    session: str
    created: str
    tracker: str
    weighting: str
    body: str
    dimensions: dict[str, float]
    parameters: tuple[str, ...]
    seed: int
    first: int
    last: int
    fps: float
    settings: dict[str, Value]
    sigma: tuple[float, ...]
    start_pose: tuple[float, ...] | None = None
    start_source: str = ""
    software: str = ""
    notes: tuple[str, ...] = ()
    behaviour: str = ""
    live: bool = False
    ping_pong: bool = False
    made_from: str = ""
    corrected: int | None = None
    corrected_pose: tuple[float, ...] | None = None
    backwards_to: int | None = None
    subject_dimensions: dict[str, float] = {}
    random_numbers: str = ""

    def is_restarted(self, frame: int) -> bool:
        """Whether a frame was started by a correction: the corrected one, or one that was tracked backwards from it."""
        if self.corrected is None:
            return False
        lowest = self.corrected if self.backwards_to is None else self.backwards_to
        return lowest <= frame <= self.corrected

    @property
    def frame_count(self) -> int:
        """How many frames the run is to track."""
        return self.last - self.first


def _impossible(record: RunRecord) -> str:
    """What no run can be of, a clause; "" for nothing."""
    frames = (record.first, record.last, record.corrected or 0, record.backwards_to or 0)
    if not all(0 <= frame <= MOST_FRAMES for frame in frames) or record.last < record.first:
        return f"that it is of frames {record.first} to {record.last}"
    if not 0.0 < record.fps <= FASTEST:
        return f"that its footage has {record.fps:g} frames per second"
    if not is_time(record.created):
        return f"that it was made at {record.created[:40]!r}"
    return ""


_RECORD = RecordFile(
    RunRecord,
    "a run's record",
    "Start a new run.",
    ("There is no run '{name}'.", "List the runs with 'studio runs'."),
    SCHEMA_VERSION,
    {1: renamed(to_and_fro="ping_pong")},
    impossible=_impossible,
)


def read_run_record(run_folder: Path) -> RunRecord:
    """The record of a run. Raises NotFoundError if there is none, SessionError for an invalid one."""
    return _RECORD.read(run_folder / FILE_NAME)


def write_run_record(run_folder: Path, record: RunRecord) -> None:
    _RECORD.write(run_folder / FILE_NAME, record)
