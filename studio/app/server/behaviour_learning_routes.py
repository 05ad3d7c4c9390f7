"""Learning a behaviour model from runs and uploaded motion, in the background, with progress as `learning` events."""

import asyncio
import math
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Field

from studio.app.server.answers import Shown
from studio.app.server.app_state import App, AppState
from studio.app.server.requests import Arguments, MaybeName, body_of
from studio.app.server.schemas import Answer
from studio.app.server.upload_routes import forget, upload_folder
from studio.body.catalogue import list_bodies, load_body
from studio.foundations.errors import BehaviourError, NotFoundError
from studio.foundations.knobs import Knob, knobs_of
from studio.operations.behaviours import learn
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.operations.jobs.learning_process import LearningOrder, learn_in_process
from studio.results.drawing_footage.recipe_file import recipe_names
from studio.runs.behaviour_models import SUFFIX, models_folder
from studio.runs.learning.oversampling import OversamplingSettings
from studio.runs.learning.recordings import FPS, MOTION_FILES
from studio.search.behaviour.settings import LearningSettings
from studio.sessions.archives import ENDINGS, unpacked
from studio.sessions.names import checked_name
from studio.sessions.session import BODIES_NAME

router = APIRouter(prefix="/api/learning", tags=["behaviours"])


Source = str


class LearningProgress(SessionJob):
    """How the learning stands. learnt: frames, clusters, states, entropies and the frames that fitted badly, when it is
    done.
    """

    name: str
    body: str
    learnt: dict[str, object] = Field(default_factory=dict)


LEARNING = JobKind(
    "learning",
    "learning",
    LearningProgress,
    busy="Model '{name}' is being learnt; one is learnt at a time.",
    page="/behaviours?name={name}",
)


class LearningChoices(Answer):
    """What a form needs: the knobs group after group, the bodies, the endings of motion files, bundled recipes of a
    person, and what is being learnt or was last, null before the first.
    """

    knobs: list[Annotated[Knob, Shown]]
    bodies: list[str]
    default_body: str
    fps: float
    endings: list[str]
    recipes: list[str]
    progress: LearningProgress | None


SKELETON = ".asf"
GIVEN: dict[str, Any] = {
    "sources": (
        Annotated[list[str], Field(max_length=500)],
        Field([], description="Runs as SESSION/RUN, recipes."),
    ),
    "upload": (MaybeName, Field(None, description="Identifier of a finished upload of motion files.")),
}


@router.get("")
def choices(app: App) -> LearningChoices:
    """What can be learnt from and with, and what is being learnt."""
    knobs = [entry for kind in (LearningSettings, OversamplingSettings) for entry in knobs_of(kind)]
    return LearningChoices(
        knobs=knobs,
        bodies=list(list_bodies((app.workspace.root / BODIES_NAME,))),
        default_body=app.workspace.usual_body(),
        fps=FPS,
        endings=[*MOTION_FILES, SKELETON, *ENDINGS],
        recipes=list(recipe_names()),
        progress=app.jobs.last(LEARNING),
    )


@router.post("", status_code=202)
async def begin(
    arguments: Annotated[Arguments, body_of(learn, "LearningRequest", **GIVEN)], app: App
) -> LearningProgress:
    """Begin to learn a model; its name must be free. 409 while another one is learnt."""
    order = await asyncio.to_thread(_order, arguments, app)

    def work(job: Job) -> dict[str, object]:
        try:
            learnt = learn_in_process(order, job.report, job.check)
        finally:
            if arguments.more["upload"]:
                forget(app, arguments.more["upload"])
        known = {
            name: None if isinstance(value, float) and math.isnan(value) else value
            for name, value in learnt.items()
        }
        return {"learnt": known}

    return app.jobs.begin(LEARNING, LearningProgress(name=order.name, body=order.body), work)


@router.delete("", status_code=202)
def cancel(app: App) -> LearningProgress:
    """Stop; nothing of the model is kept."""
    state = app.jobs.last(LEARNING)
    if state is None:
        raise NotFoundError("Nothing is being learnt.", "Begin with a form or 'POST /api/learning'.")
    app.jobs.cancel(LEARNING, state.key)
    return app.jobs.state(LEARNING, state.key)


def _order(arguments: Arguments, app: AppState) -> LearningOrder:
    """The request, checked. Raises StudioError: a name that is taken, no such source, wrong knobs."""
    app.jobs.check_free(LEARNING)
    workspace, name, upload = app.workspace, arguments["into"], arguments.more["upload"]
    body = arguments.get("body") or workspace.usual_body()
    if (models_folder(workspace.root) / f"{checked_name(name, 'model')}{SUFFIX}").exists():
        raise BehaviourError(
            f"There is a model '{name}' already.", "Choose another name, or delete that one first."
        )
    load_body(body, (workspace.root / BODIES_NAME,))
    for source in (*arguments.more["sources"], *arguments["tests"]):
        _check(source, app)
    files = _motion_in(upload_folder(app, upload)) if upload else ()
    sources = (*arguments.more["sources"], *files)
    if not sources:
        raise BehaviourError("There is nothing to learn from.", "Choose runs, or motion files to upload.")
    order = LearningOrder(
        workspace.root,
        name,
        body,
        sources,
        tuple(arguments["tests"]),
        arguments["fps"],
        arguments["seed"],
        arguments["knobs"],
    )
    order.settings()
    return order


def _check(source: str, app: AppState) -> None:
    """A run of the workspace or a bundled recipe, never a path. Raises NotFoundError, NameRefused."""
    if source in recipe_names():
        return
    session, slash, run = source.partition("/")
    if not slash:
        raise NotFoundError(
            f"There is no source '{source[:80]}'.", "Name a run as SESSION/RUN, or upload motion files."
        )
    app.workspace.session(session).run(run)


def _motion_in(folder: Path) -> tuple[str, ...]:
    """The motion files of an upload, out of its archive if it is one. Raises BehaviourError where there are none."""
    files = [path for path in unpacked(folder).rglob("*") if path.is_file()]
    found = sorted(str(path) for path in files if path.suffix.lower() in MOTION_FILES)
    if not found:
        raise BehaviourError(
            "The uploaded files hold no motion.", f"Motion files end in {', '.join(MOTION_FILES)}."
        )
    return tuple(found)
