"""Importing and uploading, as OpenAPI shows them."""

from typing import Literal

from pydantic import Field

from studio.capture.naming import CameraMatch
from studio.jobs.job_runner import NumberedJob
from studio.server.schemas import Answer, Request


class ImportState(NumberedJob):
    """How an import stands. name: of the session. layout: whose the source was taken for."""

    name: str
    notes: list[str] = Field(default_factory=list)
    warnings: list[str] = Field(default_factory=list)
    matching: list[CameraMatch] = Field(default_factory=list[CameraMatch])
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

    name: Literal["walk", "planar_arm", "branched_arms"] = "walk"
