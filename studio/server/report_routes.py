"""What `studio reproduce` found, for the page of reports and as downloads."""

from pathlib import Path
from typing import Any

import msgspec
from fastapi import APIRouter
from pydantic import Field
from starlette.responses import FileResponse, Response

from studio.comparison.findings_document import REPORT, REPRODUCTIONS, RESULTS, SUMMARY
from studio.errors import NotFoundError, SessionError
from studio.foreign_files import read_file
from studio.server.app_state import App, AppState
from studio.server.schemas import Answer
from studio.typed_decoding import decode_json

router = APIRouter(tags=["reports"])

DOWNLOADS = {RESULTS: "application/json", SUMMARY: "text/markdown; charset=utf-8", REPORT: "text/html"}


class Reports(Answer):
    """What was reproduced so far. experiments: documents as results.json has them; none before the first command."""

    software: str = ""
    date: str = ""
    experiments: list[dict[str, Any]] = Field(default_factory=list[dict[str, Any]])


@router.get("/api/reports")
def reports(app: App) -> Reports:
    """What `studio reproduce` wrote into the workspace."""
    path = _folder(app) / RESULTS
    if not path.is_file():
        return Reports()
    try:
        return decode_json(read_file(path), _Results).as_reports()
    except (msgspec.DecodeError, OSError) as error:
        raise SessionError(
            f"'{path}' cannot be read: {error}.", "Run 'studio reproduce' again; what is measured is kept."
        ) from None


@router.get("/api/reports/{name}", response_class=Response)
def report_file(name: str, app: App) -> Response:
    """results.json, summary.md or report.html (the whole report in one file) as a download."""
    path = _folder(app) / name
    if name not in DOWNLOADS or not path.is_file():
        raise NotFoundError(f"There is no report '{name[:40]}'.", "Make one: studio reproduce all --quick.")
    return FileResponse(path, media_type=DOWNLOADS[name], filename=name)


class _Results(msgspec.Struct, frozen=True):
    software: str = ""
    date: str = ""
    experiments: list[dict[str, Any]] = msgspec.field(default_factory=list[dict[str, Any]])

    def as_reports(self) -> Reports:
        return Reports(software=self.software, date=self.date, experiments=self.experiments)


def _folder(app: AppState) -> Path:
    return app.workspace.root / REPRODUCTIONS
