"""A run that is stopped, killed, resumed or annealed again gives the same poses bit for bit."""

from collections.abc import Mapping

import numpy as np
import pytest
from toy_session import true_poses
from tracked_runs import abandon, finish, opened

from studio.foundations.errors import NotFoundError, RunError, SettingsError
from studio.foundations.progress import no_progress
from studio.operations.jobs.batch import track_to_end
from studio.runs import tracking_run
from studio.runs.branching import prepare_branch
from studio.runs.new_run import prepare_run
from studio.runs.reannealing import Reannealing
from studio.runs.tracking_run import TrackingRun
from studio.search.settings import RunSettings, changed_settings
from studio.search.trackers.reported_limbs import ReportedLimb
from studio.search.trackers.tracker import LayerRecord
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

QUICK = {"particles": 40, "layers": 4, "start_repeats": 2}


def new_run(session: Session, name: str, seed: int = 7, **changes: object) -> StoredRun:
    start = true_poses()[0] + 0.02
    return prepare_run(session, name=name, seed=seed, start_pose=start, last=5, knobs={**QUICK, **changes})


def assert_same_layers(ones: list[LayerRecord], others: list[LayerRecord]) -> None:
    assert len(ones) == len(others)
    for one, other in zip(ones, others, strict=True):
        assert np.array_equal(one.poses, other.poses)
        assert np.array_equal(one.log_weights, other.log_weights)
        assert np.array_equal(one.variance_diffused, other.variance_diffused)
        assert (one.beta, one.layer) == (other.beta, other.layer)


def test_it_follows_the_arm_and_records_every_layer(session_on_disk: Session) -> None:
    run = new_run(session_on_disk, "a", particles=150, layers=8, refine_frames=False)
    poses = finish(session_on_disk, run)
    with run.results() as results:
        assert results.frames() == [0, 1, 2, 3, 4]
        assert [len(results.layers(frame)) for frame in range(5)] == [16, 8, 8, 8, 8]
        assert [record.layer for record in results.layers(0)] == list(range(16))
        carried = results.result(2).carried.particles
        assert carried.poses.shape == (150, 4)
        assert np.array_equal(carried.poses, results.layer(2, 7).poses)
        assert results.timeline().evaluations.tolist() == [2400, 1200, 1200, 1200, 1200]
    # A pixel is 20 mm here and a link 250 mm: 0.08 rad a link, which the four links share out among them.
    assert np.abs(poses - true_poses()[:5]).max() < 0.16
    assert run.summary().status == "finished"


def test_stopped_after_every_layer_and_taken_up_again(session_on_disk: Session) -> None:
    whole, broken = new_run(session_on_disk, "whole"), new_run(session_on_disk, "broken")
    wanted = finish(session_on_disk, whole)
    steps = 0
    while broken.summary().status != "finished":
        with opened(session_on_disk, broken) as tracking:
            tracking.step_layer()
            steps += 1
    assert steps == 2 * 4 + 4 * 4
    with broken.results() as results, whole.results() as others:
        assert np.array_equal(results.poses()[1], wanted)
        for frame in range(5):
            assert_same_layers(results.layers(frame), others.layers(frame))


def test_killed_inside_a_frame_after_settings_changed_in_it(session_on_disk: Session) -> None:
    """Frame 2 is left unfinished by a kill; its settings changed before its third layer and do so again."""

    def track(run: StoredRun, kill: bool) -> np.ndarray:
        with opened(session_on_disk, run) as tracking:
            while (tracking.next_frame, tracking.layers_done) != (2, 2):
                tracking.step_layer()
            version, settings = tracking.latest_settings()
            following = (version + 1, changed_settings(settings, {"survival": 0.2}))
            tracking.settings_source = lambda: following
            assert tracking.step_layer().applied is following[1]
            if kill:
                abandon(tracking)
        return finish(session_on_disk, run)

    whole, killed = new_run(session_on_disk, "whole"), new_run(session_on_disk, "killed")
    assert np.array_equal(track(whole, kill=False), track(killed, kill=True))
    with killed.results() as results:
        assert [(e.version, e.frame, e.layer) for e in results.settings_history()] == [(1, 0, 0), (2, 2, 2)]
        layers = results.layers(2)
    assert [record.settings_version for record in layers] == [1, 1, 2, 2]
    assert [record.alpha_wanted for record in layers] == [0.3, 0.3, 0.2, 0.2]


def test_knobs_of_the_next_frame_wait_for_it(session_on_disk: Session) -> None:
    run = new_run(session_on_disk, "a")
    with opened(session_on_disk, run) as tracking:
        while tracking.next_frame < 1:
            tracking.step_layer()
        tracking.step_layer()
        version, settings = tracking.latest_settings()
        following = (version + 1, changed_settings(settings, {"particles": 20, "layers": 2}))
        tracking.settings_source = lambda: following
        while not tracking.finished:
            tracking.step_layer()
    with run.results() as results:
        assert [len(results.layers(frame)) for frame in (1, 2)] == [4, 2]
        assert [len(results.layer(frame, 0).poses) for frame in (1, 2)] == [40, 20]
        assert len(results.layer(1, 3).poses) == 40


def annealed_again(tracking: TrackingRun, frame: int, settings: RunSettings) -> Reannealing:
    again = Reannealing(tracking, frame, 9, settings)
    while not again.finished:
        again.step_layer()
    return again


@pytest.mark.parametrize("frame", [0, 1, 4])
def test_annealed_again_it_is_the_same_unless_a_knob_differs(session_on_disk: Session, frame: int) -> None:
    run = new_run(session_on_disk, "a")
    finish(session_on_disk, run)
    with opened(session_on_disk, run) as tracking, run.results() as results:
        settings = tracking.latest_settings()[1]
        stored = results.layers(frame)
        same = annealed_again(tracking, frame, settings)
        assert_same_layers(same.layers, stored)
        assert np.array_equal(same.result().estimate.pose, results.result(frame).estimate.pose)
        other = annealed_again(tracking, frame, changed_settings(settings, {"survival": 0.15}))
        # The first layer weighs the same particles: only the knob differs, not the start nor the keys.
        assert np.array_equal(other.layers[0].poses, stored[0].poses)
        assert other.layers[0].alpha_wanted == 0.15
        assert not np.array_equal(other.layers[1].poses, stored[1].poses)
        assert_same_layers(results.layers(frame), stored)
        assert results.frames() == [0, 1, 2, 3, 4]


def test_an_unfinished_frame_is_annealed_from_its_start_and_goes_on_where_it_stood(
    session_on_disk: Session,
) -> None:
    run, whole = new_run(session_on_disk, "a"), new_run(session_on_disk, "whole")
    wanted = finish(session_on_disk, whole)
    with opened(session_on_disk, run) as tracking:
        while (tracking.next_frame, tracking.layers_done) != (3, 2):
            tracking.step_layer()
        annealed_again(tracking, 3, changed_settings(tracking.latest_settings()[1], {"survival": 0.9}))
        annealed_again(tracking, 1, tracking.latest_settings()[1])
        with pytest.raises(NotFoundError, match="cannot be annealed"):
            Reannealing(tracking, 4, 1, tracking.latest_settings()[1])
        assert (tracking.next_frame, tracking.layers_done) == (3, 2)
    assert np.array_equal(finish(session_on_disk, run), wanted)


def test_an_answer_can_be_kept_and_what_followed_from_the_old_one_goes(session_on_disk: Session) -> None:
    run = new_run(session_on_disk, "a")
    old = finish(session_on_disk, run)
    with opened(session_on_disk, run) as tracking:
        again = annealed_again(
            tracking, 2, changed_settings(tracking.latest_settings()[1], {"survival": 0.2})
        )
        kept = again.result().estimate.pose
        again.keep()
        assert (tracking.next_frame, tracking.done) == (3, 3)
        assert tracking.latest_settings()[1].tracker.survival == 0.2
    new = finish(session_on_disk, run)
    assert np.array_equal(new[:2], old[:2])
    assert np.array_equal(new[2], kept)
    assert not np.array_equal(new[2], old[2])
    with run.results() as results:
        assert [e.version for e in results.settings_history()] == [1, 9]


@pytest.mark.parametrize("frame", [0, 2])
def test_an_answer_can_be_kept_in_a_run_of_its_own(session_on_disk: Session, frame: int) -> None:
    run = new_run(session_on_disk, "a")
    old = finish(session_on_disk, run)
    with opened(session_on_disk, run) as tracking:
        again = annealed_again(
            tracking, frame, changed_settings(tracking.latest_settings()[1], {"survival": 0.2})
        )
    made = prepare_branch(session_on_disk, run, frame, {"survival": 0.2})
    assert made.summary().done == frame
    track_to_end(session_on_disk, made, no_progress)
    with made.results() as results, run.results() as before:
        _, poses = results.poses()
        assert np.array_equal(poses[:frame], old[:frame])
        assert np.array_equal(poses[frame], again.result().estimate.pose)
        assert results.layer(4, 0).alpha_wanted == 0.2
        assert np.array_equal(before.poses()[1], old)
    assert (made.record.made_from, made.record.notes[-1]) == (
        "a",
        f"From frame {frame} on run 'a' with survival 0.2.",
    )


def test_a_run_that_would_be_the_same_again_is_refused(session_on_disk: Session) -> None:
    run = new_run(session_on_disk, "a")
    finish(session_on_disk, run)
    for knobs, cause in (
        (None, "No knob differs"),
        ({"survival": 7}, "survival"),
        ({"start_repeats": 3}, "cannot change inside a run"),
    ):
        with pytest.raises(SettingsError, match=cause):
            prepare_branch(session_on_disk, run, 2, knobs)
    with pytest.raises(RunError, match="Frame 9"):
        prepare_branch(session_on_disk, run, 9, {"survival": 0.2})
    assert [one.name for one in session_on_disk.runs()] == ["a"]


def test_fewer_particles_recorded_change_no_pose(session_on_disk: Session) -> None:
    all_kept = finish(session_on_disk, new_run(session_on_disk, "all"))
    few = new_run(session_on_disk, "few", record_particles=5)
    assert np.array_equal(finish(session_on_disk, few), all_kept)
    with few.results() as results:
        assert len(results.layer(3, 0).poses) == 5
        carried = results.result(3).carried.particles
        assert len(carried.poses) == 40


def test_seeds_differ(session_on_disk: Session) -> None:
    one, other = new_run(session_on_disk, "a", seed=1), new_run(session_on_disk, "b", seed=2)
    assert not np.array_equal(finish(session_on_disk, one), finish(session_on_disk, other))


def test_without_a_start_pose_the_cloud_is_spread_over_the_limits(session_on_disk: Session) -> None:
    run = prepare_run(session_on_disk, last=1, knobs={"particles": 400, "layers": 1})
    assert run.record.start_pose is None
    finish(session_on_disk, run)
    with run.results() as results:
        cloud = results.layer(0, 0).poses
    # The standard deviation of an even spread over ±60° is 120° / √12.
    assert np.allclose(cloud.std(axis=0), np.deg2rad(120.0) / np.sqrt(12.0), rtol=0.1)


def test_one_tracks_at_a_time_and_a_finished_run_has_no_frame_left(session_on_disk: Session) -> None:
    run = new_run(session_on_disk, "a")
    with opened(session_on_disk, run), pytest.raises(RunError, match="being tracked"):
        ResultsWriter(run.folder)
    finish(session_on_disk, run)
    with opened(session_on_disk, run) as tracking, pytest.raises(RunError, match="no frame left"):
        tracking.step_layer()


def test_progress_is_measured_over_frames(session_on_disk: Session) -> None:
    run = new_run(session_on_disk, "a")
    with opened(session_on_disk, run) as tracking:
        assert np.isnan(tracking.progress().seconds_left)
        while tracking.next_frame < 2:
            tracking.step_layer()
        progress = tracking.progress()
        assert (progress.done, progress.total) == (2, 5)
        assert progress.frames_per_second > 0.0
        assert np.isnan(progress.seconds_left), "two frames foretell nothing"


class Source:
    """Reports the arm elsewhere than any pose has it; counts how often it is asked."""

    def __init__(self, limb: str, markers: int) -> None:
        self.limbs, self.asked = (limb,), 0
        self._reported = {limb: ReportedLimb((markers - 1,), np.array([[9e3, 0.0, 9e3]]))}

    def elsewhere(self, _pose: np.ndarray, pictures: Mapping[str, np.ndarray]) -> Mapping[str, ReportedLimb]:
        assert pictures
        self.asked += 1
        return self._reported


@pytest.mark.parametrize(("every", "in_frames"), [(2, [0, 2, 4]), (0, [])])
def test_the_network_is_asked_where_limbs_are(
    session_on_disk: Session, monkeypatch: pytest.MonkeyPatch, every: int, in_frames: list[int]
) -> None:
    run = new_run(session_on_disk, "asking", ask_network_every=every)
    body = run.body()
    source = Source(body.parameters[0].limb, len(body.markers))
    monkeypatch.setattr(tracking_run, "LimbsByNetwork", lambda *_: source)
    finish(session_on_disk, run)
    assert source.asked == len(in_frames)
    with run.results() as results:
        named = [frame for frame in results.frames() if source.limbs[0] in results.result(frame).limbs_lost]
    # Named also where it is not asked, once it was said to be elsewhere.
    assert named == ([frame for frame in range(5) if frame >= in_frames[0]] if in_frames else [])
