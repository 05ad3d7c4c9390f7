"""The web application: every route, behind the access guard, on one port.

Order of what a request passes: errors in words, policy headers, access, body limit, routes. Long-lived
things (the scene, the tracking process, the stream of events) start and stop with the application.
"""

import asyncio
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from http import HTTPStatus
from pathlib import Path
from typing import Any, cast

from fastapi import FastAPI
from starlette.staticfiles import StaticFiles

from studio.app.scene.window_scenes import WindowScenes
from studio.app.server import (
    alignment_routes,
    arena_routes,
    background_routes,
    behaviour_learning_routes,
    behaviour_routes,
    body_routes,
    calibration_routes,
    calibration_solving,
    camera_routes,
    comparison_routes,
    course_routes,
    event_stream,
    export_routes,
    film_routes,
    footage_routes,
    gallery_routes,
    guide_routes,
    health_routes,
    import_routes,
    job_routes,
    note_routes,
    page_routes,
    picture_routes,
    pose_routes,
    report_routes,
    result_routes,
    rig_routes,
    run_routes,
    scene_picture_routes,
    scene_relay,
    scene_routes,
    session_routes,
    settings_routes,
    stroke_routes,
    subject_routes,
    track_routes,
    trial_routes,
    upload_routes,
    view_routes,
    workflow_routes,
)
from studio.app.server.access import AccessGuard, HostRule, Tokens, binding_rule
from studio.app.server.app_state import AppState
from studio.app.server.body_limit import BodyLimit
from studio.app.server.content_policy import PolicyHeaders
from studio.app.server.error_responses import ErrorsInWords, add_error_handlers, log
from studio.app.server.event_messages import event_schemas
from studio.app.server.event_stream import EventStream
from studio.app.server.left_requests import LeftRequests
from studio.app.server.schemas import ErrorAnswer
from studio.app.server.viewers_budget import ViewersBudget
from studio.foundations.package import assets_folder
from studio.operations.course import COURSE
from studio.operations.gallery import GALLERY
from studio.operations.jobs.camera_service import RECORDINGS
from studio.operations.jobs.comparison_run import COMPARISON
from studio.operations.jobs.control import StudioControl
from studio.operations.jobs.events import RunState
from studio.operations.jobs.job_runner import JobKind
from studio.operations.jobs.learning_process import LEARNING
from studio.operations.kept_looks import forget_looks, let_looks_rest
from studio.operations.layer_outlines import LayerOutlines
from studio.sessions.workspace import Workspace

DESCRIPTION = (
    "Sessions, runs, settings and results of the capture studio. Every error is "
    "`{code, message, hint, status}`. Requests carry the cookie that the printed address sets, or the token "
    "as `Authorization: Bearer`. Lengths in mm, angles in radians, NaN as null. "
    "Events: WebSocket `/api/events`."
)
ROUTERS = (
    health_routes.router,
    page_routes.router,
    guide_routes.router,
    guide_routes.contents_router,
    gallery_routes.router,
    session_routes.router,
    workflow_routes.router,
    import_routes.router,
    upload_routes.router,
    footage_routes.router,
    camera_routes.router,
    calibration_routes.router,
    calibration_solving.router,
    background_routes.router,
    film_routes.router,
    stroke_routes.router,
    alignment_routes.router,
    subject_routes.router,
    body_routes.router,
    run_routes.router,
    settings_routes.router,
    result_routes.router,
    trial_routes.router,
    track_routes.router,
    job_routes.router,
    note_routes.router,
    pose_routes.router,
    export_routes.router,
    picture_routes.router,
    course_routes.router,
    view_routes.router,  # after the pictures, whose addresses are more special
    rig_routes.router,
    comparison_routes.router,
    behaviour_routes.router,
    behaviour_learning_routes.router,
    report_routes.router,
    arena_routes.router,
    scene_routes.router,
    scene_picture_routes.router,
    scene_relay.router,
    event_stream.router,
)
# As the routers made them: one that is included makes its routes a second time, while the first requests wait.
ROUTES = [route for router in ROUTERS for route in router.routes]
JOBS: tuple[JobKind[Any], ...] = (
    GALLERY,
    import_routes.IMPORT,
    footage_routes.SYNCHRONY,
    RECORDINGS,
    calibration_solving.CALIBRATION,
    background_routes.BACKGROUND,
    alignment_routes.ALIGNMENT,
    subject_routes.SUBJECT,
    pose_routes.START_POSE,
    track_routes.TRACK,
    export_routes.EXPORT,
    COURSE,
    view_routes.SEEDS,
    view_routes.SPLIT,
    view_routes.UNCERTAINTY,
    film_routes.FILM,
    film_routes.CARRIED,
    rig_routes.RIG,
    COMPARISON,
    LEARNING,
    report_routes.REPRODUCTION,
    arena_routes.RACE,
)
"""Work of which pages hear events."""
ERRORS = (400, 403, 404, 409, 422, 500)
SWEEP_SECONDS = 5.0


class Application(FastAPI):
    """Serves `ROUTES`."""

    def openapi(self) -> dict[str, Any]:
        """The document, in which every route may answer an error."""
        if self.openapi_schema is None:
            document = super().openapi()
            schemas = document["components"]["schemas"]
            for unused in ("HTTPValidationError", "ValidationError"):  # FastAPI's own, which no route answers
                del schemas[unused]
            for name in schemas.keys() - _named_in_requests(document):
                if properties := schemas[name].get("properties"):
                    schemas[name]["required"] = list(properties)
            schemas |= {name: one for name, one in event_schemas(JOBS).items() if name not in schemas}
            schemas["ErrorAnswer"] = ErrorAnswer.model_json_schema()
            content = {"application/json": {"schema": {"$ref": "#/components/schemas/ErrorAnswer"}}}

            def described(statuses: tuple[int, ...]) -> dict[str, dict[str, Any]]:
                return {
                    str(one): {"description": HTTPStatus(one).phrase, "content": content} for one in statuses
                }

            for operations in document["paths"].values():
                for operation in operations.values():
                    too_large = (413,) if "requestBody" in operation else ()
                    operation["responses"] |= described((*ERRORS, *too_large))
        return super().openapi()


def _named_in_requests(document: dict[str, Any]) -> set[str]:
    """The schemas of what is sent to the API: of these, entries may be left out. Answers have all of theirs."""
    schemas = document["components"]["schemas"]
    named: set[str] = set()
    left = [op.get("requestBody") for operations in document["paths"].values() for op in operations.values()]
    while left:
        one = left.pop()
        if isinstance(one, dict):
            entry = cast("dict[str, object]", one)
            name = str(entry.get("$ref", "")).rpartition("/")[2]
            if name and name not in named:
                named.add(name)
                left.append(schemas[name])
            left += entry.values()
        elif isinstance(one, list):
            left += cast("list[object]", one)
    return named


def build_app(
    workspace: Workspace,
    control: StudioControl,
    scenes: WindowScenes,
    tokens: Tokens,
    *,
    hosts: HostRule | None = None,
    footage_roots: tuple[Path, ...] = (),
    log_path: Path | None = None,
) -> FastAPI:
    """The application. It ends `scenes` and `control` when it stops.

    hosts : the Host headers that are answered (default: this machine's loopback).
    footage_roots : folders from which footage may be imported by path.
    log_path : named in answers to unforeseen errors.
    """
    state = AppState(
        workspace,
        control,
        scenes,
        EventStream(control, scenes.open_scenes, LayerOutlines(workspace)),
        footage_roots,
        log_path,
    )
    app = Application(
        title="Capture studio",
        routes=ROUTES,
        description=DESCRIPTION,
        lifespan=_lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
    )
    app.state.studio = state
    add_error_handlers(app)
    app.mount("/assets", StaticFiles(directory=assets_folder()), name="assets")
    # The last one added is the first to see a request.
    app.add_middleware(BodyLimit)
    app.add_middleware(LeftRequests)
    app.add_middleware(ViewersBudget, tracking=lambda: control.state.state is RunState.TRACKING)
    app.add_middleware(
        AccessGuard,
        token=tokens.owner,
        viewers_token=tokens.viewers,
        hosts=hosts or binding_rule("127.0.0.1", False),
    )
    app.add_middleware(PolicyHeaders)
    app.add_middleware(ErrorsInWords, log_path=log_path)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncGenerator[None]:
    """Start the stream and the tracking process; end them and the scenes, whatever happens."""
    state: AppState = app.state.studio
    sweeping = asyncio.create_task(_close_unused_scenes(state))
    try:
        state.events.start()
        scene_routes.report_moves(state)
        await asyncio.to_thread(state.control.start)
        yield
    finally:
        sweeping.cancel()
        await asyncio.to_thread(state.jobs.close)
        await asyncio.to_thread(state.cameras.close)
        await state.events.stop()
        await asyncio.to_thread(forget_looks)
        ends = (asyncio.to_thread(state.scenes.stop), asyncio.to_thread(state.control.close))
        for problem in await asyncio.gather(*ends, return_exceptions=True):
            if isinstance(problem, BaseException):
                log.error("closing failed", exc_info=problem)


async def _close_unused_scenes(state: AppState) -> None:
    """Let the scenes of windows that are gone go, and what was not looked at for long, over and over."""
    while True:
        await asyncio.sleep(SWEEP_SECONDS)
        await asyncio.to_thread(state.scenes.close_unused, state.events.windows())
        await asyncio.to_thread(let_looks_rest)
