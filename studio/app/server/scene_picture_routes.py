"""Pictures and films of what the asking window's scene shows, drawn by its own browser."""

from pathlib import Path
from typing import Literal

from fastapi.responses import Response
from pydantic import Field

from studio.app.scene.scene_pictures import Film, png_of
from studio.app.server.answers import Router
from studio.app.server.app_state import App, Scene
from studio.app.server.export_routes import EXPORT, ExportState
from studio.app.server.schemas import Request
from studio.foundations.errors import NotFoundError
from studio.operations.exports import filmed_frames, keep_file
from studio.operations.jobs.job_runner import Job

router = Router(prefix="/api/scene", tags=["scene"])

MOST_FRAMES = 600
"""Frames of a film: a browser draws a few of them a second."""


class PictureRequest(Request):
    """How a picture is made. scale: pixels for each of the window's. transparent: without the scene's background."""

    scale: float = Field(2.0, ge=0.25, le=4.0)
    transparent: bool = False


class FilmRequest(Request):
    """What is filmed, and how. of: the shown frame's layers, or the run's frames. rate: layers a second, or how many
    times as fast as it was recorded. first, last: of the frames, half open; null: from the first to the last.
    """

    kind: Literal["mp4", "gif"] = "mp4"
    of: Literal["layers", "frames"] = "layers"
    rate: float = Field(3.0, ge=0.1, le=10.0)
    first: int | None = Field(None, ge=0)
    last: int | None = Field(None, ge=1)


@router.post("/picture", response_class=Response)
def picture(request: PictureRequest, scene: Scene) -> Response:
    """A PNG of the asking window's scene as it is shown, its caption below. 409 where no browser shows it."""
    made = scene.pictures.take(request.scale, transparent=request.transparent)
    return Response(png_of(made), media_type="image/png", headers={"cache-control": "no-store"})


@router.post("/films", status_code=202)
def begin_film(request: FilmRequest, app: App, scene: Scene) -> ExportState:
    """Begin a film of the asking window's scene, which shows it meanwhile. It is kept with the run's exports: ask for
    its state as for theirs, or wait for `export` events. 404 where no run is shown.
    """
    shown = scene.shown
    if not shown.run:
        raise NotFoundError("The scene shows no run.", "Open a run first.")
    run = app.workspace.session(shown.session).run(shown.run)
    frames: tuple[int, ...] = ()
    stem, rate = f"{shown.session}-{run.name}-layers-of-{shown.frame}", request.rate
    if request.of == "frames":
        frames = filmed_frames(run, request.first, request.last, MOST_FRAMES)
        stem, rate = f"{shown.session}-{run.name}-{frames[0]}-to-{frames[-1]}", run.record.fps * request.rate
    film = Film(request.kind, rate, frames)

    def work(job: Job) -> dict[str, object]:
        def write(place: Path) -> int:
            return scene.pictures.film(
                film, place, lambda done, total: job.report_or_stop("drawing", done, total)
            )

        return {"result": keep_file(run, stem, request.kind, rate, write, "A film of the scene")}

    state = ExportState(session=shown.session, run=run.name, format=request.kind)
    return app.jobs.begin(EXPORT, state, work)
