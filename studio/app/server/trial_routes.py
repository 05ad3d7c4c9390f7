"""Trials: frames that were annealed again with moved knobs and are not stored, beside the stored result."""

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.app.server.run_routes import RUN, RunInPath
from studio.operations.frame_trials import TrialLayers, TrialList, trial_layers, trials_of_frame
from studio.operations.inspecting import inspected

router = Router(prefix="/api", tags=["trials"])


@router.get(RUN + "/frames/{frame}/trials")
def trials(run: RunInPath, frame: int, app: App) -> TrialList:
    """All that was tried of a frame and is kept, beside the stored result."""
    return trials_of_frame(inspected(run), app.events.tried, frame)


@router.get(RUN + "/trials/{trial}")
def trial(run: RunInPath, trial: str, app: App) -> TrialLayers:
    """A trial by its name, with its layers."""
    return trial_layers(inspected(run), app.events.tried, trial)
