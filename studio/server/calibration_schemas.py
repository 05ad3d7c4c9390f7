"""Calibrating a session's cameras, as OpenAPI shows it. Lengths in mm, angles in degrees, pixels as stored."""

from typing import Annotated

from pydantic import Field

from studio.calibration.findings import Finding
from studio.capture.naming import CameraMatch
from studio.jobs.job_runner import NumberedJob
from studio.server.schemas import Answer, Number, Numbers, Request, RunName
from studio.sessions.importers.importing import Unit, Up

Pixel = tuple[float, float]
Place = Annotated[str, Field(max_length=4096)]


class FootagePlace(Request):
    """Files of this machine or of an upload. path: a full path, or with an upload a path inside it."""

    path: Place = ""
    upload: RunName | None = None


class CalibrationFileRequest(Request):
    """A calibration to look at. Nothing is changed by it. file: which one of a folder or upload that holds several;
    earlier: one that the session used before, instead of a path.
    """

    path: Place = ""
    upload: RunName | None = None
    file: Place = ""
    earlier: str = Field("", max_length=64)
    unit: Unit = ""
    up: Up = "z"


class DistanceRequest(Request):
    """A measured distance between two cameras' lenses."""

    first: str = Field(max_length=64)
    second: str = Field(max_length=64)
    mm: float = Field(gt=0, le=1e6)


class PointRequest(Request):
    """A point clicked in two cameras or more. world: where it is known to lie, mm; for all points or for none."""

    pixels: dict[str, Pixel] = Field(min_length=2, max_length=64)
    world: tuple[float, float, float] | None = None


class FloorRequest(Request):
    """Points of the floor: the first is the origin, the second lies on X. proposal: "" for the calibration in use."""

    proposal: str = Field("", max_length=64)
    points: list[PointRequest] = Field(min_length=3, max_length=64)


class ApplyRequest(Request):
    """anyway: also if a finding says that results would be wrong."""

    anyway: bool = False


class CalibratedCamera(Answer):
    """A camera as it stands. forward: its optical axis; rms_px: of its board corners, null where no board was seen."""

    name: str
    width: int
    height: int
    focal_px: Numbers
    centre_px: Numbers
    position: Numbers
    forward: Numbers
    quarter_turns: int
    rms_px: Number = None


class ClickedPoint(Answer):
    """A clicked point in space, mm, and how many pixels each camera's click misses it by."""

    place: Numbers
    missed_px: dict[str, Number]


class Rig(Answer):
    """Cameras with what speaks for and against them. report: as the command writes it, {} for files."""

    source: str
    cameras: list[CalibratedCamera]
    notes: list[str] = Field(default_factory=list)
    findings: list[Finding] = Field(default_factory=list[Finding])
    usable: bool = True
    floor: str = ""
    report: dict[str, object] = Field(default_factory=dict)
    points: list[ClickedPoint] = Field(default_factory=list[ClickedPoint])


class ProposalView(Rig):
    """A calibration to look at before it is applied; it lives until the studio ends. unit_note: how the unit was
    found. matching: the footage's cameras to the calibration's own names.
    """

    identifier: str
    session: str
    unit_note: str = ""
    matching: list[CameraMatch] = Field(default_factory=list[CameraMatch])


class CalibrationView(Answer):
    """The calibration in use, null while there is none. earlier: those before it, newest first. stale_runs: tracked
    with another one. changed: when it was replaced (ISO 8601). board_footage: folders in the session, if any. notes:
    what the change that was just made means.
    """

    session: str
    present: Rig | None
    changed: str = ""
    earlier: list[str] = Field(default_factory=list)
    stale_runs: list[str] = Field(default_factory=list)
    board_footage: bool = False
    footage: list[str] = Field(default_factory=list, description="Names of the cameras that have footage.")
    formats: dict[str, str] = Field(default_factory=dict, description="Formats of the export.")
    notes: list[str] = Field(default_factory=list)


class SolveState(NumberedJob):
    """How a calibration from boards stands. share: of all, about, null while unknown; seconds_left: of all; proposal:
    what came of it.
    """

    share: Number = None
    proposal: str = ""
