"""A live run tracked as the studio does it, in a process of its own, with the scene open and a viewer taking part."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from studio.errors import RunError
from studio.progress import Progress
from studio.runs.live_summary import LiveSummary, summary_of
from studio.scene.light_viewer import LightViewer
from studio.scene.stage import SceneStage
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace
from studio.worker import commands
from studio.worker.control import StudioControl
from studio.worker.events import Event, StateChanged
from studio.worker.watchers import Subscription

PATIENCE_SECONDS = 120.0


@dataclass(frozen=True, slots=True)
class Watched:
    """live : how the run went. viewer_messages, viewer_bytes : what the viewer was sent a second, NaN without one."""

    live: LiveSummary
    viewer_messages: float
    viewer_bytes: float


def track_watched(
    workspace: Workspace, session: Session, run: StoredRun, report: Progress, *, scene: bool = True
) -> Watched:
    """Track a prepared live run of a session of the workspace to its end. scene : open it, with a viewer; else track
    in the process of its own alone.

    Raises RunError when the tracking fails or falls silent.
    """
    control, stage, viewer = StudioControl(workspace), None, None
    messages = size = float("nan")
    try:
        if scene:
            stage = SceneStage(workspace, control)
            viewer = LightViewer(stage.port, stage.relay_headers())
            stage.show_run(session.name, run.name)
        events = control.subscribe()
        control.open_run(session.name, run.name)
        control.request(commands.Start())
        _until(events, lambda state: state.live is not None and state.done > 0, report)
        before, began = (viewer.messages, viewer.size) if viewer else (0, 0), time.monotonic()
        _until(events, lambda state: state.state == "finished", report)
        spent = time.monotonic() - began
        if viewer:
            messages, size = (viewer.messages - before[0]) / spent, (viewer.size - before[1]) / spent
    finally:
        if viewer is not None:
            viewer.close()
        if stage is not None:
            stage.stop()
        control.close()
    return Watched(summary_of(run), messages, size)


def _until(events: Subscription[Event], is_reached: Callable[[StateChanged], bool], report: Progress) -> None:
    """Wait for a state of the tracking process, telling how it keeps up."""
    while True:
        event = events.get(timeout=PATIENCE_SECONDS)
        if not isinstance(event, StateChanged):
            continue
        if event.state in ("failed", "lost"):
            raise RunError(event.message, event.hint)
        if event.live is not None:
            report(event.live.in_words, event.frame - event.first, event.last - event.first)
        if is_reached(event):
            return
