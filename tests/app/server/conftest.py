"""A workspace with a small real session, and the application served on it."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from web_doubles import TOKEN, VIEWERS_TOKEN, RecordingControl, RecordingScenes, Studio, let_in, serving

from studio.app.server.access import Tokens
from studio.app.server.app import build_app
from studio.footage.capture.calibration_files import write_calibration
from studio.foundations.geometry.camera import Camera
from studio.runs.new_run import prepare_run
from studio.search.trackers.tracker import Estimate, FilterState, FrameResult, LayerRecord, ParticleSet
from studio.sessions.importers.importing import ImportOptions, import_source
from studio.sessions.named_rows import write_pose
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

WIDTH, HEIGHT, FRAMES = 96, 64, 4
NO_DISTORTION = np.zeros(5)


def camera(name: str, angle: float) -> Camera:
    """A camera 4 m from the z axis, 1 m up, looking at the axis."""
    centre = np.array([4000.0 * np.cos(angle), 4000.0 * np.sin(angle), 1000.0])
    forward = np.array([-np.cos(angle), -np.sin(angle), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    rotation = np.stack([np.cross(down, forward), down, forward])
    matrix = np.array([[90.0, 0.0, 47.5], [0.0, 90.0, 31.5], [0.0, 0.0, 1.0]])
    return Camera(name, WIDTH, HEIGHT, matrix, NO_DISTORTION, rotation, -rotation @ centre)


def make_source(folder: Path) -> Path:
    """Footage of two cameras as pictures, with a calibration and a start pose."""
    rng = np.random.default_rng(7)
    for name in ("cam1", "cam2"):
        (folder / "pictures" / name).mkdir(parents=True)
        for frame in range(FRAMES):
            blocks = rng.integers(0, 255, (HEIGHT // 16, WIDTH // 16, 3), dtype=np.uint8)
            picture = blocks.repeat(16, axis=0).repeat(16, axis=1)
            cv2.imwrite(str(folder / "pictures" / name / f"{frame:04d}.png"), picture)
    (folder / "calibration").mkdir()
    write_calibration((camera("cam1", 0.0), camera("cam2", 1.5)), folder / "calibration" / "cameras.toml")
    return folder


@pytest.fixture(scope="session")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that can be imported; nobody changes it."""
    return make_source(tmp_path_factory.mktemp("source"))


@pytest.fixture(scope="session")
def imported(tmp_path_factory: pytest.TempPathFactory, source: Path) -> Path:
    """The source as the session 'take1', with a start pose; nobody changes it."""
    session = import_source(
        source, tmp_path_factory.mktemp("imported") / "take1", ImportOptions(fps=25.0)
    ).session
    body = session.body()
    write_pose(session.path / "start_pose.csv", tuple(entry.name for entry in body.parameters), body.neutral)
    return session.path


@pytest.fixture
def workspace(tmp_path: Path, imported: Path) -> Workspace:
    """A workspace with the session 'take1'."""
    made = Workspace(tmp_path / "workspace")
    shutil.copytree(imported, made.root / "take1")
    return made


@pytest.fixture
def session(workspace: Workspace) -> Session:
    """The session 'take1'."""
    return workspace.session("take1")


def record(rng: np.random.Generator, frame: int, layer: int, size: int, particles: int = 7) -> LayerRecord:
    """A layer with numbers that can be told apart."""
    poses = rng.normal(size=(particles, size))
    flat = np.full(size, 4.0 / (layer + 1))
    return LayerRecord(
        frame=frame,
        layer=layer,
        settings_version=1,
        beta=0.5 + layer,
        alpha_wanted=0.5,
        alpha_reached=0.4,
        variance_weighed=flat,
        variance_resampled=flat / 2,
        variance_diffused=flat / 3,
        best=poses[0],
        best_log_weight=-1.0,
        mean=poses.mean(0),
        poses=poses,
        log_weights=rng.normal(size=particles),
        milliseconds=3.0,
    )


@pytest.fixture
def tracked(session: Session) -> StoredRun:
    """A run of 'take1' with two of four frames done, three layers each."""
    run = prepare_run(session, name="first", seed=3)
    rng = np.random.default_rng(11)
    size = len(run.record.parameters)
    with ResultsWriter(run.folder) as writer:
        writer.write_settings(1, 0, 0, run.record.settings)
        for frame in range(2):
            layers = [record(rng, frame, layer, size) for layer in range(3)]
            pose = rng.normal(size=size)
            particles = ParticleSet(layers[-1].poses, np.log(np.full(7, 1 / 7)), layers[-1].log_weights)
            result = FrameResult(
                frame,
                Estimate(pose, pose, layers[-1].best, -1.5),
                3,
                21,
                1,
                9.0,
                FilterState(particles, pose),
            )
            writer.write_frame(result, layers, 2000)
        writer.write_settings(2, 1, 1, run.record.settings | {"survival": 0.77})
    return run


@pytest.fixture
def control() -> RecordingControl:
    """The tracking process's double."""
    return RecordingControl()


@pytest.fixture
def scenes() -> RecordingScenes:
    """The scenes' double."""
    return RecordingScenes()


@pytest.fixture
def studio(
    workspace: Workspace, control: RecordingControl, scenes: RecordingScenes, source: Path, tmp_path: Path
) -> Iterator[Studio]:
    """The application on the workspace, served, and a client that was let in."""
    log_path = tmp_path / "server.log"
    app = build_app(
        workspace,
        control,
        scenes,
        Tokens(TOKEN, VIEWERS_TOKEN),
        footage_roots=(source.parent.resolve(),),
        log_path=log_path,
    )
    with serving(app) as base, let_in(base, TOKEN) as client:
        yield Studio(client, base, control, scenes, workspace, app, log_path)
