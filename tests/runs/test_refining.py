"""Tracks made of a run: refined and smoothed beside what was found, refused where they would write over it."""

import dataclasses

import numpy as np
import pytest
from toy_session import true_poses
from tracked_runs import finish, opened

from studio.body.forward_kinematics import marker_points
from studio.foundations.errors import NotFoundError, RunError, SettingsError, WorkCancelledError
from studio.runs.new_run import prepare_run
from studio.runs.refining import jitter, refine_run, smooth_run
from studio.runs.sides import WAITING
from studio.runs.tracks import RAW, SIDES, Track, read_track, track_digest, track_names, write_track
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.smoothing import SmoothingSettings
from studio.search.trackers.tracker import LOST
from studio.sessions.process_lock import ProcessLock
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

LOOKING = "looking for turns"


@pytest.fixture
def run(session_on_disk: Session) -> StoredRun:
    stored = prepare_run(
        session_on_disk, start_pose=true_poses()[0] + 0.02, knobs={"particles": 20, "layers": 3}
    )
    finish(session_on_disk, stored)
    return stored


def test_refining_comes_nearer_and_the_weighting_agrees(session_on_disk: Session, run: StoredRun) -> None:
    rng = np.random.default_rng(1)
    raw = read_track(run)
    shaken = dataclasses.replace(raw, name="shaken", poses=true_poses() + 0.15 * rng.standard_normal((8, 4)))
    write_track(run, shaken)
    reports: list[tuple[int, int]] = []
    made = refine_run(
        session_on_disk,
        run,
        source="shaken",
        progress=lambda _step, done, total: reports.append((done, total)),
    )
    assert reports == [(done, 8) for done in range(9)]
    before = np.abs(shaken.poses - true_poses()).mean()
    assert np.abs(made.track.poses - true_poses()).mean() < 0.6 * before
    with opened(session_on_disk, run) as tracking:
        settings = tracking.latest_settings()[1]
        for frame in range(8):
            problem = tracking.problems.problem(frame, settings)
            old, new = problem.log_likelihood(np.stack([shaken.poses[frame], made.track.poses[frame]]))
            assert new >= old
    back = read_track(run, "refined")
    assert np.array_equal(back.poses, made.track.poses)
    assert back.made_by["verb"] == "refine"
    assert back.made_by["from"] == "shaken"
    assert back.made_by["refinement_steps"] == RefinementSettings().refinement_steps
    assert np.array_equal(read_track(run).poses, raw.poses)


def test_frames_whose_silhouettes_do_not_agree_keep_their_pose(
    session_on_disk: Session, run: StoredRun
) -> None:
    settings = RefinementSettings(refinement_least_overlap=1.0, refinement_acceleration=0.0)
    made = refine_run(session_on_disk, run, settings=settings)
    assert made.moved == 0
    assert np.array_equal(made.track.poses, read_track(run).poses)


def test_a_clip_is_looked_at_as_a_whole_once(session_on_disk: Session, run: StoredRun) -> None:
    steps: list[str] = []

    def refine(into: str) -> list[str]:
        steps.clear()
        refine_run(session_on_disk, run, into=into, progress=lambda step, _done, _total: steps.append(step))
        return steps

    assert LOOKING in refine("first")
    assert LOOKING not in refine("second")
    raw = read_track(run)
    looked_at = run.folder / "tracks" / "looked-at.json"
    assert track_digest(raw) in looked_at.read_text()
    looked_at.write_text(looked_at.read_text().replace(track_digest(raw), "of another"))
    assert LOOKING in refine("third")


def test_who_refines_while_the_clip_is_looked_at_waits_for_what_is_found(
    session_on_disk: Session, run: StoredRun
) -> None:
    """The tracking process looks at a clip after its last frame: refining meanwhile did all of it again."""
    (run.folder / "tracks").mkdir()
    held = ProcessLock.take(run.folder / "tracks" / "looking.lock")
    assert held is not None
    steps: list[str] = []

    def found(step: str, _done: int, _total: int) -> None:
        """Another process ends its look, and corrects the second frame, while this one waits."""
        steps.append(step)
        if step == WAITING:
            raw = read_track(run)
            poses = raw.poses + 0.01 * (raw.frames == 1)[:, None]
            made_by = {"from": RAW, "from_digest": track_digest(raw), "exchanged": ["frame 1: told"]}
            write_track(run, dataclasses.replace(raw, name=SIDES, poses=poses, made_by=made_by))
            held.free()

    made = refine_run(session_on_disk, run, progress=found)
    assert steps.count(WAITING) == 1
    assert LOOKING not in steps
    assert made.track.made_by["from"] == SIDES

    def cancelled(step: str, _done: int, _total: int) -> None:
        raise WorkCancelledError("Enough.", "")

    again = ProcessLock.take(run.folder / "tracks" / "looking.lock")
    with pytest.raises(WorkCancelledError):
        refine_run(session_on_disk, run, into="other", progress=cancelled)
    assert again is not None
    again.free()


def test_smoothing_takes_the_refined_track_else_the_raw(session_on_disk: Session, run: StoredRun) -> None:
    assert smooth_run(run, into="first").track.made_by["from"] == "raw"
    refine_run(session_on_disk, run)
    made = smooth_run(run)
    assert made.track.made_by["from"] == "refined"
    assert track_names(run) == ("raw", "first", "refined", "smoothed")
    assert made.jitter_after < made.jitter_before
    assert made.jitter_after == pytest.approx(jitter(run, read_track(run, "smoothed")))


def test_filled_frames_are_marked_and_long_gaps_stay(run: StoredRun) -> None:
    raw = read_track(run)
    states = list(raw.states)
    states[2] = LOST
    kept = [0, 1, 2, 3, 4, 6, 7]
    holed = Track(
        "holed",
        raw.frames[kept],
        raw.poses[kept],
        raw.confidence[kept],
        tuple(states[at] for at in kept),
        {"verb": "test"},
    )
    write_track(run, holed)
    made = smooth_run(run, source="holed")
    assert made.filled == (2, 5)
    assert made.track.made_by["filled"] == (2, 5)
    assert made.track.frames.tolist() == list(range(8))
    assert made.track.states[2] == LOST
    assert made.track.states[5] == ""
    assert made.track.confidence[[2, 5]].tolist() == [0.0, 0.0]
    assert made.track.confidence[0] == raw.confidence[0]
    open_gaps = smooth_run(run, source="holed", into="open", settings=SmoothingSettings(longest_gap=0.0))
    assert open_gaps.track.frames.tolist() == [0, 1, 3, 4, 6, 7]
    assert open_gaps.left_out == (2,)


def test_refusals_keep_what_is_there(session_on_disk: Session, run: StoredRun) -> None:
    smooth_run(run)
    for refused in (
        lambda: smooth_run(run),
        lambda: smooth_run(run, source="smoothed"),
        lambda: smooth_run(run, into="raw"),
        lambda: refine_run(session_on_disk, run, into="smoothed"),
    ):
        with pytest.raises(RunError):
            refused()
    with pytest.raises(NotFoundError, match="no track 'nothing'"):
        smooth_run(run, source="nothing", into="other")
    with pytest.raises(SettingsError, match="None of the track's 8 frames"):
        smooth_run(run, into="other", settings=SmoothingSettings(least_confidence=1.0))
    assert track_names(run) == ("raw", "smoothed")
    assert (
        smooth_run(run, replace=True, settings=SmoothingSettings(smoothing_frequency=3.0)).jitter_after > 0.0
    )


def test_a_cancelled_refinement_keeps_nothing(session_on_disk: Session, run: StoredRun) -> None:
    def stopped(_step: str, done: int, _total: int) -> None:
        if done == 2:
            raise WorkCancelledError("Stopped.")

    with pytest.raises(WorkCancelledError):
        refine_run(session_on_disk, run, progress=stopped)
    assert track_names(run) == ("raw",)


def test_a_run_without_frames_is_refused(session_on_disk: Session) -> None:
    empty = prepare_run(session_on_disk, start_pose=true_poses()[0])
    with pytest.raises(RunError, match="no finished frame"):
        refine_run(session_on_disk, empty)


def test_jitter_is_that_of_frames_that_follow_each_other(run: StoredRun) -> None:
    raw, body = read_track(run), run.body()
    points = marker_points(body, raw.poses)
    second = points[2:] - 2.0 * points[1:-1] + points[:-2]
    squares = (second**2).sum(axis=2)
    assert jitter(run, raw) == pytest.approx(np.sqrt(squares.mean()))
    kept = [0, 1, 2, 4, 5, 6, 7]
    holed = Track("holed", raw.frames[kept], raw.poses[kept], raw.confidence[kept], raw.states[:7])
    assert jitter(run, holed) == pytest.approx(np.sqrt(squares[[0, 4, 5]].mean()))
    few = Track("few", raw.frames[::2], raw.poses[::2], raw.confidence[::2], raw.states[::2])
    assert jitter(run, few) == 0.0
