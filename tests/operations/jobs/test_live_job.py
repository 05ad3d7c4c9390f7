"""Live runs in the tracking process: what is told, and what commands do to them."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from live_driving import driving, live_run
from toy_session import FPS, FRAMES

from studio.operations.jobs import commands
from studio.operations.jobs.events import Event, FrameFinished, LayerFinished, StateChanged
from studio.operations.jobs.live_tracking import replay_live, track_live
from studio.operations.jobs.open_live_run import OpenLiveRun, opened
from studio.operations.jobs.tracking_job import TrackingJob
from studio.runs.live.live_replay import compare, prepare_replay
from studio.runs.live.live_summary import summary_of
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

LONG = 3000
"""Frames: nearly a minute, so that a run goes on until it is told otherwise."""
PAUSED_SECONDS = 2.0


class Harness:
    """A job with everything that it says."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.job = TrackingJob(self.events.append)

    def do(self, command: commands.Command) -> None:
        self.job.serve(command)

    def work(self, until: Callable[[], bool]) -> None:
        while self.job.busy and not until():
            self.job.advance()

    def events_of(self, kind: type[Event]) -> list:
        return [event for event in self.events if isinstance(event, kind)]


@pytest.fixture
def harness():
    made = Harness()
    yield made
    made.job.close()


def begun(harness: Harness, run: StoredRun) -> None:
    harness.do(commands.Open(session=str(run.folder.parents[1]), run=str(run.folder)))
    harness.do(commands.Start())


def test_a_live_run_tells_how_it_keeps_up(session_on_disk: Session, harness: Harness) -> None:
    run = live_run(session_on_disk, last=40, ping_pong=True)
    begun(harness, run)
    harness.work(lambda: False)
    states = harness.events_of(StateChanged)
    assert states[-1].state == "finished"
    assert run.summary().status == "finished"
    frames = harness.events_of(FrameFinished)
    found = summary_of(run)
    assert tuple(event.result.frame for event in frames) == found.tracked
    assert [event.latency_ms for event in frames] == pytest.approx(found.latencies.tolist())
    assert min(event.latency_ms for event in frames) > 0.0
    assert states[-1].live.dropped == len(found.dropped)
    assert len(found.tracked) + len(found.dropped) == 40 - found.tracked[0]
    assert all(event.result.carried.particles is None for event in frames), "the events are light"
    with run.results() as results:
        assert results.result(found.tracked[0]).carried.particles is not None, "the store is whole"
    assert {event.record.frame for event in harness.events_of(LayerFinished)} == set(found.tracked)


def test_a_pause_lets_no_time_pass(session_on_disk: Session, harness: Harness) -> None:
    run = live_run(session_on_disk, last=LONG, ping_pong=True)
    begun(harness, run)
    harness.work(lambda: len(harness.events_of(FrameFinished)) >= 3)
    harness.do(commands.Pause())
    assert harness.events_of(StateChanged)[-1].state == "paused"
    before = summary_of(run).tracked[-1]
    time.sleep(PAUSED_SECONDS)
    harness.do(commands.Start())
    heard = len(harness.events_of(FrameFinished))
    harness.work(lambda: len(harness.events_of(FrameFinished)) > heard)
    following = next(frame for frame in summary_of(run).tracked if frame > before)
    # On a busy machine some frames are dropped; the pause alone would have been all of these.
    assert following < before + PAUSED_SECONDS * FPS / 2, "the clock goes on where it stood"
    harness.do(commands.Cancel())
    harness.do(commands.Close())
    assert run.summary().status == "cancelled"
    kept = summary_of(run).tracked
    assert len(kept) >= 4
    replayed = prepare_replay(session_on_disk, run)
    assert replay_live(session_on_disk, run, replayed, lambda *_: None).different == ()
    assert compare(run, replayed).frames == len(kept)


def test_a_step_tracks_one_frame(session_on_disk: Session, harness: Harness) -> None:
    run = live_run(session_on_disk)
    harness.do(commands.Open(session=str(run.folder.parents[1]), run=str(run.folder)))
    harness.do(commands.StepFrame())
    harness.work(lambda: False)
    assert harness.events_of(StateChanged)[-1].state == "paused"
    assert summary_of(run).tracked == (0,)


def test_a_finished_live_run_is_annealed_again_where_frames_were_dropped(
    session_on_disk: Session, harness: Harness
) -> None:
    run = live_run(session_on_disk)
    with driving(session_on_disk, run) as drive:
        drive.to_end(2.5 / FPS)
    assert summary_of(run).tracked == (0, 2, 5, 7)
    harness.do(commands.Open(session=str(run.folder.parents[1]), run=str(run.folder)))
    for frame in (5, 6):
        harness.do(commands.Reanneal(frame=frame))
        harness.work(lambda: False)
    answers = [event.result for event in harness.events_of(FrameFinished) if event.reannealed]
    assert [result.frame for result in answers] == [5, 6]
    with run.results() as results:
        assert np.array_equal(answers[0].estimate.pose, results.result(5).estimate.pose), "the same again"
        assert results.frames() == [0, 2, 5, 7]


def test_runs_are_opened_as_what_they_are(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    one = opened(str(session_on_disk.path), str(run.folder))
    assert isinstance(one, OpenLiveRun)
    one.close()


def test_a_live_run_in_this_process_ends_with_the_footage(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    said: list[tuple[str, int, int]] = []
    found = track_live(session_on_disk, run, lambda *events_of: said.append(events_of))
    assert found.tracked[-1] + 1 + len([frame for frame in found.dropped if frame > found.tracked[-1]]) == 8
    assert said[0][0] == "getting ready"
    assert said[-1][0].startswith("live")
    assert said[-1][2] == FRAMES
    assert run.record.fps == FPS


def test_ctrl_c_ends_a_live_run_and_keeps_it(session_on_disk: Session) -> None:
    run = live_run(session_on_disk, last=LONG, ping_pong=True)

    def interrupted(step: str, done: int, total: int) -> None:
        if done > 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        track_live(session_on_disk, run, interrupted)
    assert run.summary().status == "cancelled"
    assert summary_of(run).tracked[-1] >= 5
    assert not run.being_tracked()
