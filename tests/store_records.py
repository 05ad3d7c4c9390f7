"""Made-up records, layers and results for tests of the store."""

import numpy as np

from studio.runs.search_space import default_sigma, parameter_names
from studio.search.trackers.tracker import Estimate, FilterState, FrameResult, LayerRecord, ParticleSet
from studio.sessions.manifest import now
from studio.sessions.results_store import ResultsWriter
from studio.sessions.run_record import RunRecord
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


def layer_of(frame: int, layer: int, *, count: int = 12, size: int = 4) -> LayerRecord:
    """A layer's record filled with numbers that belong to no other (frame, layer)."""
    rng = np.random.default_rng((frame, layer))
    vectors = rng.normal(size=(5, size))
    return LayerRecord(
        frame=frame,
        layer=layer,
        settings_version=1,
        beta=float(rng.random()),
        alpha_wanted=float("nan"),
        alpha_reached=0.5,
        variance_weighed=vectors[0],
        variance_resampled=vectors[1],
        variance_diffused=vectors[2],
        best=vectors[3],
        best_log_weight=-1.25,
        mean=vectors[4],
        poses=rng.normal(size=(count, size)),
        log_weights=rng.normal(size=count),
        milliseconds=3.5,
    )


def result_of(frame: int, *, count: int = 12, size: int = 4, layers: int = 3) -> FrameResult:
    """A frame's result with a whole set at its end."""
    rng = np.random.default_rng((frame, 99))
    poses = rng.normal(size=(count, size))
    particles = ParticleSet(
        poses, rng.normal(size=count), rng.normal(size=count), {"velocities": rng.normal(size=(count, size))}
    )
    estimate = Estimate(poses[0], poses.mean(axis=0), poses[1], -0.5 - frame)
    return FrameResult(
        frame, estimate, layers, layers * count, 1, 12.0, FilterState(particles, poses[0], poses[2])
    )


def record_of(session: Session, name: str) -> RunRecord:
    """A run's record, made without the settings room."""
    body = session.body()
    return RunRecord(
        name=name,
        session=session.name,
        created=now(),
        tracker="annealed",
        weighting="edge-region",
        body=body.name,
        dimensions=dict(body.dimensions),
        parameters=parameter_names(body),
        seed=3,
        first=0,
        last=8,
        fps=60.0,
        settings={"layers": 10},
        sigma=tuple(default_sigma(body, 60.0).tolist()),
    )


def store_run(session: Session, name: str, frames: int) -> StoredRun:
    """A finished run of a session with so many frames of three layers each."""
    run = session.new_run(record_of(session, name))
    with ResultsWriter(run.folder) as writer:
        writer.write_settings(1, 0, 0, run.record.settings)
        for frame in range(frames):
            writer.write_frame(result_of(frame), [layer_of(frame, layer) for layer in range(3)], 2000)
    return run
