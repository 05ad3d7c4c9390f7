"""What the routes need of the storeys below: the tracking process, the scenes, and where things lie."""

from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

from fastapi import Depends, Request

from studio.app.scene.scene_server import SceneServer
from studio.app.scene.window_scenes import WindowScenes
from studio.app.server.access import VIEWING
from studio.app.server.event_stream import EventStream
from studio.app.server.windows import Window
from studio.operations.calibration_proposals import Proposals
from studio.operations.jobs.camera_service import CameraService
from studio.operations.jobs.commands import Close
from studio.operations.jobs.control import StudioControl
from studio.operations.jobs.events import RunState
from studio.operations.jobs.job_runner import JobRunner, keep_in_place
from studio.operations.jobs.process import ProcessDiedError
from studio.operations.kept_looks import forget_looks
from studio.sessions.session import RUNS_NAME
from studio.sessions.work_under_way import STATE_NAME
from studio.sessions.workspace import Workspace


@dataclass(slots=True)
class AppState:
    """Everything a route may use, kept in `app.state.studio`.

    scenes : of all windows. footage_roots : folders that may be imported from. log_path :
    the server's log file. proposals : calibrations not in use yet. uploads : those under way, by their identifiers.
    jobs : work in the background. cameras : where live ones are looked at and recorded.
    """

    workspace: Workspace
    control: StudioControl
    scenes: WindowScenes
    events: EventStream
    footage_roots: tuple[Path, ...] = ()
    log_path: Path | None = None
    proposals: Proposals = field(default_factory=Proposals)
    uploads: dict[str, dict[str, int]] = field(default_factory=dict[str, dict[str, int]])
    jobs: JobRunner = field(init=False)
    cameras: CameraService = field(init=False)

    def __post_init__(self) -> None:
        """Give all work beside the routes its place, which reports its progress to all watchers."""
        self.jobs = JobRunner(self.events.publish, self.log_path, partial(keep_in_place, self.workspace))
        self.events.under_way = self.jobs.messages
        self.cameras = CameraService(self.jobs)

    @property
    def state_folder(self) -> Path:
        """Where the server keeps what is its own: preferences, presets, unfinished uploads."""
        return self.workspace.root / STATE_NAME


def app_state(request: Request) -> AppState:
    """What routes use, as their dependency."""
    return request.app.state.studio


App = Annotated[AppState, Depends(app_state)]


def scene_of(app: App, window: Window = "") -> SceneServer:
    """The scene of the requesting window, as a dependency of routes."""
    return app.scenes.scene(window, VIEWING.get())


Scene = Annotated[SceneServer, Depends(scene_of)]


@contextmanager
def moving(app: AppState, session: str, run: str = "") -> Generator[None]:
    """Inside, a session (or a run of it) may be renamed or deleted: nothing has it open, and no job of it begins.

    Raises RunError while a job of it is under way, or as `release`.
    """
    with app.jobs.moving(session, run):
        release(app, session, run)
        yield


def release(app: AppState, session: str, run: str = "") -> None:
    """Free a session (or only a run of it) for renaming or deleting: footage, results and scene are closed.

    Raises RunError while the run is being tracked, or trackers are being compared on the session.
    """
    if not run:
        app.jobs.check_movable(session)
    state, folder = app.control.state, app.workspace.root / session
    # Else the process itself knows whether that is what it has open; a search elsewhere is not waited for.
    if state.state is not RunState.LOST and (state.session == session or not state.state.searches):
        # A process that died meanwhile has nothing open any more.
        with suppress(ProcessDiedError):
            app.control.request(Close(session=str(folder), run=str(folder / RUNS_NAME / run) if run else ""))
    for scene in app.scenes.open_scenes().values():
        if scene.shown.session == session and (not run or scene.shown.run == run):
            scene.show_run(session if run else "")
    app.events.tried.forget(session, run)
    forget_looks()
