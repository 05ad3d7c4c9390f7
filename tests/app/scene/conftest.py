"""The swaying session with a run, and a scene to draw on."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scene_fakes import FakeControl
from swaying_session import (
    FRAMES,
    LAYERS,
    cloud_record,
    frame_result,
    make_session,
    ring_camera,
    swaying_pose,
)

from studio.app.scene.guarded_server import GuardedServer
from studio.app.scene.scene_server import SceneServer
from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.foundations.geometry.camera import Camera
from studio.runs.new_run import prepare_run
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace


@pytest.fixture(scope="session")
def cameras() -> tuple[Camera, ...]:
    """Four cameras; the last one lies on its side."""
    bearings = np.deg2rad([20.0, 110.0, 200.0, 290.0])
    turns = (0, 0, 0, 1)
    return tuple(
        ring_camera(f"cam{number + 1}", bearing, turn)
        for number, (bearing, turn) in enumerate(zip(bearings, turns, strict=True))
    )


@pytest.fixture(scope="session")
def human() -> BodyModel:
    """The Lee-walk body."""
    return load_body("human31")


@pytest.fixture
def workspace(tmp_path: Path, cameras: tuple[Camera, ...], human: BodyModel) -> Workspace:
    """A workspace with the session `swaying` and its run `run-1`, five of six frames done."""
    root = tmp_path / "studio"
    root.mkdir()
    session = make_session(root / "swaying", cameras, human)
    run = prepare_run(session, start_pose=swaying_pose(human, 0), knobs={"layers": LAYERS})
    with ResultsWriter(run.folder) as writer:
        for frame in range(FRAMES - 1):
            layers = [cloud_record(human, frame, layer) for layer in range(LAYERS)]
            writer.write_frame(frame_result(human, frame), layers)
    return Workspace(root)


@pytest.fixture
def stored(workspace: Workspace) -> tuple[Session, StoredRun]:
    """The session and its run."""
    session = workspace.session("swaying")
    return session, session.run("run-1")


@pytest.fixture(scope="session")
def server() -> Iterator[GuardedServer]:
    """A viser server that views are drawn on; every test uses bodies and names of its own making."""
    made = GuardedServer()
    yield made
    made.stop()


@pytest.fixture
def control() -> FakeControl:
    """The run is paused."""
    return FakeControl("swaying", "run-1", "paused")


@pytest.fixture
def stage(workspace: Workspace, control: FakeControl) -> Iterator[SceneServer]:
    """A scene that shows nothing yet."""
    made = SceneServer(workspace, control)
    yield made
    made.stop()
