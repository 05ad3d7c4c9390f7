"""What refinement and smoothing gain on rendered footage: issue 5's fourth show, and its third's smoothness."""

import numpy as np
import pytest

from studio.body.inverse_kinematics import pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, read_trc
from studio.operations.jobs.batch import track_to_end
from studio.results.evaluation.errors import evaluate, rows_of_frames
from studio.runs.new_run import prepare_run
from studio.runs.refining import refine_run, smooth_run
from studio.runs.tracks import Track, read_track, write_track
from studio.sessions.samples import install_sample
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

FRAMES, EVERY = 90, 6
SEEDS = (0, 1, 2)


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return install_sample(Workspace(tmp_path_factory.mktemp("gain")), "walk")


def tracked(session: Session, seed: int) -> StoredRun:
    """A run of 1000 evaluations a frame, its frames not yet refined."""
    changes = {"particles": 100, "layers": 10, "refine_frames": False}
    run = prepare_run(session, seed=seed, last=FRAMES, knobs=changes, fit_shape=False)
    track_to_end(session, run, lambda _step, _done, _total: None)
    return run


def true_track(body: BodyModel, truth: MarkerMotion, raw: Track, fps: float) -> Track:
    """Every sixth frame's true pose: the skeleton that was rendered is the body's own."""
    rows, names = rows_of_frames(truth, fps), tuple(marker.name for marker in body.markers)
    columns = [truth.names.index(name) for name in names]
    poses = []
    for frame, start in zip(raw.frames[::EVERY], raw.poses[::EVERY], strict=True):
        pose, rms = pose_from_markers(body, names, truth.positions[rows[int(frame)]][columns], start)
        assert rms < 0.1
        poses.append(pose)
    chosen = slice(None, None, EVERY)
    return Track(
        "truth",
        raw.frames[chosen],
        np.array(poses),
        raw.confidence[chosen],
        raw.states[chosen],
        {"verb": "test"},
    )


@pytest.mark.slow
def test_half_of_the_error_above_the_floor_goes_and_the_motion_is_smooth(walk: Session) -> None:
    assert walk.truth_path is not None
    truth, fps, body = read_trc(walk.truth_path), walk.manifest.fps, walk.body()

    def error(run: StoredRun, name: str) -> tuple[float, float]:
        track = read_track(run, name)
        chosen = np.isin(track.frames, np.arange(0, FRAMES, EVERY))
        found = evaluate(track.poses[chosen], track.frames[chosen], body, truth, fps)
        return found.mean_mm, found.worst_mm

    runs = [tracked(walk, seed) for seed in SEEDS]
    write_track(runs[0], true_track(body, truth, read_track(runs[0]), fps))
    refine_run(walk, runs[0], source="truth", into="floor")
    floor = error(runs[0], "floor")[0]
    for run in runs:
        made, smoothed = refine_run(walk, run), smooth_run(run)
        (raw, raw_worst), (refined, refined_worst) = error(run, "raw"), error(run, "refined")
        assert refined - floor < 0.5 * (raw - floor)
        assert refined_worst < raw_worst
        print(
            f"raw {raw:.1f}, refined {refined:.1f}, floor {floor:.1f} mm; {made.jitter_after:.1f} mm a frame²"
        )
        assert made.jitter_before > 5.0
        assert made.jitter_after < 5.0
        assert smoothed.jitter_after < made.jitter_after
        assert error(run, "smoothed")[0] < refined + 0.3
