"""A live run tracks the newest frame, says what it dropped, and replays bit for bit."""

import msgspec
import numpy as np
import pytest
from live_driving import driving, live_request, live_run
from toy_session import FPS, true_poses

from studio.foundations.errors import NotFoundError, RunError
from studio.runs.live.live_replay import compare, prepare_replay, replay
from studio.runs.live.live_summary import summary_of
from studio.runs.new_run import prepare_run
from studio.runs.problem_source import ProblemSource
from studio.runs.run_footage import footage_of
from studio.search.settings import changed_settings
from studio.search.trackers.random_numbers import COUNTED
from studio.search.trackers.recovery_settings import INITIALISE, SPREAD
from studio.sessions.file_checksums import check_files
from studio.sessions.run_record import write_run_record
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

FRAME = 1.0 / FPS


def replayed(session: Session, run: StoredRun, name: str = "again", **changed: object) -> StoredRun:
    made = prepare_replay(session, run, name)
    problems = ProblemSource(session, made.body(), made.cameras(), footage=footage_of(session, made))
    list(replay(run, made, problems))
    problems.close()
    return made


def test_a_quick_tracker_drops_nothing(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    with driving(session_on_disk, run) as drive:
        drive.to_end(0.4 * FRAME)
    found = summary_of(run)
    assert found.tracked == tuple(range(8))
    assert found.dropped == ()
    assert found.dropped_share == 0.0
    assert found.frames_per_second == pytest.approx(FPS)
    assert np.allclose(found.latencies, 400.0 * FRAME)
    assert run.summary().status == "finished"


def test_a_slow_tracker_takes_the_newest_and_counts_the_others(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    with driving(session_on_disk, run) as drive:
        # A frame takes 2.5 frames' time: the newest is 2 after 0, 5 after 2, 7 after 5.
        drive.to_end(2.5 * FRAME)
        standing = drive.run.standing
        assert drive.run.finished
    assert standing.dropped == 4
    assert standing.dropped_share == 0.5
    found = summary_of(run)
    assert found.tracked == (0, 2, 5, 7)
    assert found.dropped == (1, 3, 4, 6)
    assert np.allclose(found.latencies / 1e3, np.array([2.5, 3.0, 2.5, 3.0]) * FRAME)
    assert found.latency(1.0) == pytest.approx(3e3 * FRAME)
    assert standing.latency_ms == pytest.approx(2750.0 * FRAME)
    assert found.frames_per_second == pytest.approx(FPS / 2.5)
    assert run.summary().status == "finished", "half of the frames, but it is over"


def test_the_body_is_followed_over_dropped_frames(session_on_disk: Session) -> None:
    changes = {"particles": 150, "layers": 6}
    run = live_run(session_on_disk, knobs=changes)
    with driving(session_on_disk, run) as drive:
        drive.to_end(1.8 * FRAME)
    with run.results() as results:
        frames, poses = results.poses()
    assert len(frames) < 8
    assert np.abs(poses - true_poses()[frames]).max() < 0.16


def test_a_frame_dropped_at_the_end_counts_too(session_on_disk: Session) -> None:
    run = live_run(session_on_disk, last=3)
    with driving(session_on_disk, run) as drive:
        assert drive.frame(1.5 * FRAME) == 0
        assert drive.frame(1.5 * FRAME) == 1
        drive.run.end()
        assert drive.run.standing.dropped == 1
    assert summary_of(run).dropped == (2,)
    assert run.summary().status == "finished"


def test_given_the_frames_everything_replays_bit_for_bit(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    with driving(session_on_disk, run) as drive:
        drive.frame(1.6 * FRAME)
        drive.frame(1.6 * FRAME)
        # A slider moves on the way.
        newer = changed_settings(drive.run.latest_settings()[1], {"particles": 55})
        drive.run.settings_source = lambda: (2, newer)
        drive.to_end(1.6 * FRAME)
    again = replayed(session_on_disk, run)
    same = compare(run, again)
    assert same.frames == len(summary_of(run).tracked) < 8
    assert same.different == ()
    with run.results() as one, again.results() as other:
        newest = one.frames()[-1]
        for first, second in zip(one.layers(newest), other.layers(newest), strict=True):
            assert len(first.poses) == 55
            assert np.array_equal(first.poses, second.poses)
            assert np.array_equal(first.log_weights, second.log_weights)
        assert one.result(newest).settings_version == other.result(newest).settings_version == 2


def test_a_run_of_other_random_numbers_is_not_replayed(session_on_disk: Session) -> None:
    """One of before they were counted, as its record says."""
    run = live_run(session_on_disk)
    with driving(session_on_disk, run) as drive:
        drive.frame(1.6 * FRAME)
    assert run.record.random_numbers == COUNTED
    write_run_record(run.folder, msgspec.structs.replace(run.record, random_numbers=""))
    before = session_on_disk.run(run.name)
    with pytest.raises(RunError, match="drew their random numbers in turn") as caught:
        prepare_replay(session_on_disk, before)
    assert f"studio of {before.record.created[:10]}" in caught.value.hint
    assert [known.name for known in session_on_disk.runs()] == [run.name]


def test_other_frames_give_another_run(session_on_disk: Session) -> None:
    runs = [live_run(session_on_disk, name) for name in ("one", "other")]
    for run, seconds in zip(runs, (0.5 * FRAME, 1.6 * FRAME), strict=True):
        with driving(session_on_disk, run) as drive:
            drive.to_end(seconds)
    different = compare(*runs).different
    both = set(summary_of(runs[0]).tracked) & set(summary_of(runs[1]).tracked)
    assert both == {0, 1, 3, 4, 6, 7}
    assert not {0, 1} & set(different), "up to the first dropped frame both start alike"
    assert set(different) >= both - {0, 1}, "what comes after a dropped frame starts from elsewhere"


def test_a_cancelled_run_stays_and_can_be_resumed(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    with driving(session_on_disk, run) as drive:
        drive.frame(1.6 * FRAME)
        drive.frame(1.6 * FRAME)
        drive.run.mark_cancelled()
    assert run.summary().status == "cancelled"
    assert summary_of(run).tracked == (0, 1)
    with driving(session_on_disk, run) as drive:
        drive.run.mark_going_on()
        assert drive.run.standing.dropped == 0
        drive.to_end(1.6 * FRAME)
    found = summary_of(run)
    # The clock begins anew with frame 2: 1.6, 3.2 and 4.8 frames later the newest are 3, 5 and 6.
    assert found.tracked == (0, 1, 2, 3, 5, 6, 7)
    assert found.dropped == (4,)
    assert compare(run, replayed(session_on_disk, run)).different == ()


def test_forth_and_back_goes_on_behind_the_end(session_on_disk: Session) -> None:
    run = live_run(session_on_disk, last=20, ping_pong=True)
    with driving(session_on_disk, run) as drive:
        drive.to_end(0.5 * FRAME)
    with run.results() as results:
        frames, poses = results.poses()
    assert frames.tolist() == list(range(20))
    # The same pictures again, on the way back and the second time forth.
    assert np.abs(poses[14:] - true_poses()[:6]).max() < 0.3
    assert compare(run, replayed(session_on_disk, run)).different == ()


def test_a_live_run_recovers_quickly_by_default(session_on_disk: Session) -> None:
    assert live_run(session_on_disk, "a").record.settings["recovery"] == SPREAD
    asked = live_run(session_on_disk, "b", knobs={"recovery": INITIALISE})
    assert asked.record.settings["recovery"] == INITIALISE
    assert prepare_run(session_on_disk, name="c").record.settings["recovery"] == INITIALISE


def test_what_cannot_be_done_live_is_refused(session_on_disk: Session) -> None:
    with pytest.raises(RunError, match="cannot train"):
        prepare_run(session_on_disk, **live_request(knobs={"online_learning": True}))
    with pytest.raises(RunError, match="Only a live run"):
        prepare_run(session_on_disk, ping_pong=True)
    with pytest.raises(RunError, match="do not lie"):
        prepare_run(session_on_disk, **live_request(last=9))
    plain = prepare_run(session_on_disk, name="plain")
    with pytest.raises(NotFoundError, match="not tracked live"):
        summary_of(plain)
    with pytest.raises(RunError, match="no frames"):
        prepare_replay(session_on_disk, live_run(session_on_disk))


def test_a_replay_names_what_it_replays(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    with driving(session_on_disk, run) as drive:
        drive.to_end(3.0 * FRAME)
    made = prepare_replay(session_on_disk, run)
    assert "'live' tracked live" in made.record.notes[-1]
    assert made.record.live


def test_a_replay_has_the_calibration_of_what_it_replays_and_is_no_damage(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    with driving(session_on_disk, run) as drive:
        drive.to_end(3.0 * FRAME)
    cameras = session_on_disk.path / "calibration" / "cameras.toml"
    cameras.write_text(cameras.read_text() + "# Solved again.\n")
    made = prepare_replay(session_on_disk, run)
    assert (made.folder / "cameras.toml").read_bytes() == (run.folder / "cameras.toml").read_bytes()
    assert check_files(made.folder).damaged == {}
