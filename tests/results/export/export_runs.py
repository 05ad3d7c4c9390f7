"""A run of 450 frames to be exported: a body that walks about, turns and bends every joint, and is lost for a while."""

from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
from store_records import record_of
from toy_session import make_session

from studio.body.model import BodyModel
from studio.runs.search_space import parameter_names
from studio.runs.tracks import Track, write_track
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

FRAMES = 450
LOST = range(200, 215)
STATES = tuple("no evidence" if frame in LOST else "tracked" for frame in range(FRAMES))
MADE = "moved"


def moving_poses(body: BodyModel, frames: int = FRAMES, fps: float = 60.0, seed: int = 4) -> np.ndarray:
    """(frames, D): every angle swings smoothly by up to a radian about neutral, the root walks 2 m and turns once."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames)[:, None] / fps
    poses = np.tile(body.neutral, (frames, 1))
    for at, entry in enumerate(body.parameters):
        swing = np.sin(rng.uniform(1.0, 4.0) * time[:, 0] + rng.uniform(0.0, 6.0))
        if entry.kind == "length":
            poses[:, at] += 1000.0 * swing * (0.05 if entry.name.endswith("z") else 1.0)
        else:
            poses[:, at] += rng.uniform(0.3, 1.0) * swing
    return poses


def track_of(poses: np.ndarray, frames: np.ndarray | None = None, states: tuple[str, ...] = ()) -> Track:
    """A derived track of poses, all tracked by default."""
    numbers = np.arange(len(poses)) if frames is None else frames
    sure = np.linspace(0.5, 0.99, len(poses))
    made_by = {"verb": "made", "from": "raw"}
    return Track(MADE, numbers, poses, sure, states or ("tracked",) * len(poses), made_by)


def run_of(folder: Path, body_name: str, track: Callable[[BodyModel], Track]) -> tuple[Session, StoredRun]:
    """A session in `folder` with a run of a body, whose derived track is given."""
    session = make_session(folder)
    body = session.body(body_name)
    about = {"body": body.name, "dimensions": dict(body.dimensions), "parameters": parameter_names(body)}
    run = session.new_run(msgspec.structs.replace(record_of(session, "first"), last=FRAMES, **about))
    write_track(run, track(body))
    return session, run
