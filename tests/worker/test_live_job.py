"""Live runs in the tracking process: what is told, and what commands do to them."""

from collections.abc import Callable

import numpy as np
import pytest
from live_driving import driving, live_run
from toy_session import FPS, FRAMES

from studio.runs.live_replay import compare, prepare_replay
from studio.runs.live_summary import summary_of
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.worker import commands
from studio.worker.events import Event, FrameFinished, LayerFinished, StateChanged
from studio.worker.live_tracking import replay_live, track_live
from studio.worker.open_live_run import OpenLiveRun, opened
from studio.worker.tracking_job import TrackingJob

LONG = 3000
"""Frames: nearly a minute, so that a run goes on until it is told otherwise."""


class Desk:
    """A job with everything that it says."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.job = TrackingJob(self.events.append)

    def do(self, command: commands.Command) -> None:
        self.job.serve(command)

    def work(self, until: Callable[[], bool]) -> None:
        while self.job.busy and not until():
            self.job.advance()

    def told(self, kind: type[Event]) -> list:
        return [event for event in self.events if isinstance(event, kind)]


@pytest.fixture
def desk():
    made = Desk()
    yield made
    made.job.close()


def begun(desk: Desk, run: StoredRun) -> None:
    desk.do(commands.Open(session=str(run.folder.parents[1]), run=str(run.folder)))
    desk.do(commands.Start())


def test_a_live_run_tells_how_it_keeps_up(session_on_disk: Session, desk: Desk) -> None:
    run = live_run(session_on_disk, last=40, to_and_fro=True)
    begun(desk, run)
    desk.work(lambda: False)
    states = desk.told(StateChanged)
    assert states[-1].state == "finished"
    assert run.summary().status == "finished"
    frames = desk.told(FrameFinished)
    found = summary_of(run)
    assert tuple(event.result.frame for event in frames) == found.tracked
    assert [event.latency_ms for event in frames] == pytest.approx(found.latencies.tolist())
    assert min(event.latency_ms for event in frames) > 0.0
    assert states[-1].live.dropped == len(found.dropped)
    assert len(found.tracked) + len(found.dropped) == 40 - found.tracked[0]
    assert all(event.result.carried.particles is None for event in frames), "the events are light"
    with run.results() as results:
        assert results.result(found.tracked[0]).carried.particles is not None, "the store is whole"
    assert {event.record.frame for event in desk.told(LayerFinished)} == set(found.tracked)


def test_a_pause_lets_no_time_pass(session_on_disk: Session, desk: Desk) -> None:
    run = live_run(session_on_disk, last=LONG, to_and_fro=True)
    begun(desk, run)
    desk.work(lambda: len(desk.told(FrameFinished)) >= 3)
    desk.do(commands.Pause())
    assert desk.told(StateChanged)[-1].state == "paused"
    before = summary_of(run).tracked[-1]
    desk.do(commands.Start())
    heard = len(desk.told(FrameFinished))
    desk.work(lambda: len(desk.told(FrameFinished)) > heard)
    following = next(frame for frame in summary_of(run).tracked if frame > before)
    assert following == before + 1, "the clock goes on where it stood"
    desk.do(commands.Cancel())
    desk.do(commands.Close())
    assert run.summary().status == "cancelled"
    kept = summary_of(run).tracked
    assert len(kept) >= 4
    replayed = prepare_replay(session_on_disk, run)
    assert replay_live(session_on_disk, run, replayed, lambda *_: None).different == ()
    assert compare(run, replayed).frames == len(kept)


def test_a_step_tracks_one_frame(session_on_disk: Session, desk: Desk) -> None:
    run = live_run(session_on_disk)
    desk.do(commands.Open(session=str(run.folder.parents[1]), run=str(run.folder)))
    desk.do(commands.StepFrame())
    desk.work(lambda: False)
    assert desk.told(StateChanged)[-1].state == "paused"
    assert summary_of(run).tracked == (0,)


def test_a_finished_live_run_is_annealed_again_where_frames_were_dropped(
    session_on_disk: Session, desk: Desk
) -> None:
    run = live_run(session_on_disk)
    with driving(session_on_disk, run) as drive:
        drive.to_end(2.5 / FPS)
    assert summary_of(run).tracked == (0, 2, 5, 7)
    desk.do(commands.Open(session=str(run.folder.parents[1]), run=str(run.folder)))
    for frame in (5, 6):
        desk.do(commands.Reanneal(frame=frame))
        desk.work(lambda: False)
    answers = [event.result for event in desk.told(FrameFinished) if event.reannealed]
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
    found = track_live(session_on_disk, run, lambda *told: said.append(told))
    assert found.tracked[-1] + 1 + len([frame for frame in found.dropped if frame > found.tracked[-1]]) == 8
    assert said[0][0] == "getting ready"
    assert said[-1][0].startswith("live")
    assert said[-1][2] == FRAMES
    assert run.record.fps == FPS


def test_ctrl_c_ends_a_live_run_and_keeps_it(session_on_disk: Session) -> None:
    run = live_run(session_on_disk, last=LONG, to_and_fro=True)

    def interrupted(step: str, done: int, total: int) -> None:
        if done > 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        track_live(session_on_disk, run, interrupted)
    assert run.summary().status == "cancelled"
    assert summary_of(run).tracked[-1] >= 5
    assert not run.being_tracked()
