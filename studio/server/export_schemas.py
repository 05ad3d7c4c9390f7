"""Exports of runs, as OpenAPI shows them."""

from pydantic import Field

from studio.jobs.job_runner import NumberedJob
from studio.server.schemas import Answer, Request, Value
from studio.server.setting_schemas import KnobView


class FormatView(Answer):
    """A format. opens: what opens it. takes: names of the options that mean something here. unit, up: what auto is."""

    name: str
    title: str
    opens: str
    takes: list[str]
    unit: str
    up: str
    what: str = Field(description="motion, video, scene or cameras.")


class ExportChoices(Answer):
    """What a run can be exported to, and how. calibrations: writers by the ending of their files."""

    formats: list[FormatView]
    options: list[KnobView]
    calibrations: dict[str, list[str]]


class ExportRequest(Request):
    """A format's name, and options by name where they are not the usual ones."""

    format: str = Field(max_length=20)
    options: dict[str, Value] = Field(default_factory=dict)


class ExportLine(Answer):
    """A finished export. checked: what reading the file back showed. notes: on gaps, names and axes. stale: why it does
    not hold its track as it is now.
    """

    file: str
    format: str
    made: str
    bytes: int
    frames: int
    fps: float
    checked: str
    notes: list[str]
    options: dict[str, Value]
    track: str = ""
    stale: str = ""


class ExportState(NumberedJob):
    """How an export stands. result: of one that is done."""

    run: str
    format: str
    result: ExportLine | None = None


class ExportList(Answer):
    """A run's exports, newest first, those under way, and its tracks and cameras to choose among. best: the track that
    is written unless another is chosen; note: on better ones that are out of date.
    """

    exports: list[ExportLine]
    running: list[ExportState]
    tracks: list[str]
    best: str
    note: str = ""
    cameras: list[str]
