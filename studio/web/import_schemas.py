"""Importing and uploading, as OpenAPI shows them."""

from typing import Literal

from pydantic import Field

from studio.web.schemas import Answer, CameraMatching, Request, RunName
from studio.worker.jobs import NumberedJob


class SourceWish(Request):
    """Footage of a folder of this machine or of an upload, and how it is to be read."""

    source: str | None = Field(None, max_length=4096, description="Folder on the server's machine.")
    upload: RunName | None = Field(None, description="Identifier of a finished upload.")
    calibration: str | None = Field(None, max_length=4096, description="Which file, if there are several.")
    fps: float | None = Field(None, gt=0, le=10_000)
    trial: str | None = Field(None, max_length=4096, description="Which trial, where a folder holds several.")
    offsets: dict[str, int] = Field(
        default_factory=dict,
        max_length=64,
        description="By camera: its frame taken with the others' frame 0.",
    )
    rotations: dict[str, Literal[0, 90, 180, 270]] = Field(
        default_factory=dict, max_length=64, description="By camera: degrees clockwise to turn its pictures."
    )
    unit: Literal["", "mm", "m"] = Field(
        "", description="The calibration's; empty: what the file says or its size."
    )
    up: Literal["x", "y", "z", "-x", "-y", "-z"] = Field(
        "z", description="The calibration's axis that points up."
    )
    despite_findings: bool = Field(False, description="Import a calibration that would make results wrong.")
    copy_footage: bool = Field(True, alias="copy", description="False: refer to it where it lies.")


class ImportRequest(SourceWish):
    """What is to be imported."""

    name: RunName = Field(description="What the session will be called.")


class FootageAddition(SourceWish):
    """What is to be added to a session."""

    replace: bool = Field(False, description="Forget all cameras that the source does not name.")


class ImportState(NumberedJob):
    """How an import stands. name: of the session. layout: whose the source was taken for."""

    name: str
    notes: list[str] = Field(default_factory=list)
    warnings: list[str] = Field(default_factory=list)
    matching: list[CameraMatching] = Field(default_factory=list)
    layout: str = ""


class UploadState(Answer):
    """An unfinished upload: its files with the bytes received of each."""

    identifier: str
    files: dict[str, int]
    total: int
    limit: int


class FileState(Answer):
    """One file of an upload. received: its bytes; total: bytes of the whole upload."""

    path: str
    received: int
    total: int


class FolderView(Answer):
    """Folders of the server's machine that footage may be imported from."""

    path: str
    parent: str | None
    folders: list[str]


class SampleRequest(Request):
    """A session that travels with the studio."""

    name: Literal["walk"] = "walk"
