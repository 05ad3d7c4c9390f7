"""Whether the server can work, for a monitor: `GET /health`, which needs no cookie and names nothing."""

import shutil
from typing import Annotated

from fastapi import APIRouter, Depends
from starlette.responses import JSONResponse

from studio.app.server.access import HEALTH_PATH
from studio.app.server.app_state import AppState, app_state
from studio.operations.jobs.events import RunState

router = APIRouter(include_in_schema=False)

LEAST_FREE_BYTES = 200_000_000


@router.get(HEALTH_PATH)
def health(app: Annotated[AppState, Depends(app_state)]) -> JSONResponse:
    """200 with status "ok", else 503 with what is wrong: "tracking process lost", "disk full"."""
    wrong = ["tracking process lost"] if app.control.state.state is RunState.LOST else []
    try:
        full = shutil.disk_usage(app.workspace.root).free < LEAST_FREE_BYTES
    except OSError:
        full = True
    wrong += ["disk full"] if full else []
    answer = {"status": "; ".join(wrong) or "ok"}
    return JSONResponse(answer, 503 if wrong else 200, {"cache-control": "no-store"})
