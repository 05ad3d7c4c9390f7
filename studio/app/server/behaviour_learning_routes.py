"""Learning a behaviour model from runs and uploaded motion, in the background, with progress as `learning` events."""

import asyncio
import math
from typing import Annotated, Any

from pydantic import Field

from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState
from studio.app.server.requests import Arguments, MaybeName, body_of
from studio.app.server.upload_routes import forget, upload_folder
from studio.foundations.errors import NotFoundError
from studio.operations.behaviours import LearningChoices, learn, learning_choices, learning_order
from studio.operations.jobs.job_runner import Job
from studio.operations.jobs.learning_process import (
    LEARNING,
    LearningOptions,
    LearningOrder,
    LearningProgress,
    learn_in_process,
)

router = Router(prefix="/api/learning", tags=["behaviours"])


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
    return learning_choices(app.workspace, app.jobs.last(LEARNING))


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

    return app.jobs.begin(LEARNING, LearningProgress(name=order.name, body=order.options.body), work)


@router.delete("", status_code=202)
def cancel(app: App) -> LearningProgress:
    """Stop; nothing of the model is kept."""
    state = app.jobs.last(LEARNING)
    if state is None:
        raise NotFoundError("Nothing is being learnt.", "Begin with a form or 'POST /api/learning'.")
    app.jobs.cancel(LEARNING, state.key)
    return app.jobs.state(LEARNING, state.key)


def _order(arguments: Arguments, app: AppState) -> LearningOrder:
    app.jobs.check_free(LEARNING)
    sources, upload = arguments.more["sources"], arguments.more["upload"]
    options = LearningOptions(**{name: value for name, value in arguments.items() if name != "into"})
    folder = upload_folder(app, upload) if upload else None
    return learning_order(app.workspace, arguments["into"], sources, folder, options)
