"""What each command does, between two layers of a frame (no process here: the job is stepped by hand)."""

import errno
import itertools
from pathlib import Path

import cv2
import numpy as np
import pytest
from full_disk import ROLLED_BACK, break_at
from toy_session import make_session, true_poses

from studio.operations.jobs import commands
from studio.operations.jobs.events import (
    Acknowledged,
    Event,
    FrameFinished,
    LayerFinished,
    LogLine,
    SettingsApplied,
    StateChanged,
)
from studio.operations.jobs.tracking_job import TrackingJob
from studio.runs.moved_knobs import settings_with_moved, stored_settings
from studio.runs.new_run import prepare_run
from studio.sessions.run_log import read_log
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

LAYERS = 3


def new_run(session: Session, name: str) -> StoredRun:
    changes = {"particles": 30, "layers": LAYERS, "start_repeats": 1}
    return prepare_run(session, name=name, seed=5, start_pose=true_poses()[0], last=4, knobs=changes)


class Harness:
    """A job with everything that it says."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.job = TrackingJob(self.events.append)

    def ask(self, command: commands.Command) -> Acknowledged:
        self.job.serve(command)
        answer = self.events[-1]
        assert isinstance(answer, Acknowledged)
        assert answer.identifier == command.identifier
        assert answer.command == type(command).__name__
        return answer

    def open(self, run: StoredRun) -> None:
        assert self.ask(commands.Open(session=str(run.folder.parents[1]), run=str(run.folder))).ok

    def layers(self) -> list[tuple[int, int, bool]]:
        found = [event for event in self.events if isinstance(event, LayerFinished)]
        return [(event.record.frame, event.record.layer, event.reannealed) for event in found]

    def advance(self, times: int) -> None:
        for _ in range(times):
            assert self.job.busy
            self.job.advance()

    def work(self) -> None:
        while self.job.busy:
            self.job.advance()

    @property
    def state(self) -> StateChanged:
        return [event for event in self.events if isinstance(event, StateChanged)][-1]

    @property
    def settings(self) -> SettingsApplied:
        return [event for event in self.events if isinstance(event, SettingsApplied)][-1]


def test_a_full_disk_fails_the_frame_and_start_goes_on(
    harness: Harness, session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither the results nor the log find room; the process lives, and says why it stands."""
    whole, run = new_run(session_on_disk, "whole"), new_run(session_on_disk, "a")
    harness.open(whole)
    harness.ask(commands.Start())
    harness.work()
    harness.open(run)
    harness.ask(commands.Start())
    harness.advance(LAYERS)
    fault = break_at(harness.job._run.tracking._writer, 3, ROLLED_BACK)

    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr("studio.operations.jobs.open_run.append_to_log", refuse)
        harness.work()
        assert harness.state.state == "failed"
        assert "disk full" in harness.state.message
        assert "Make room" in harness.state.hint
        assert not harness.ask(commands.Cancel()).ok
    fault.mend()
    assert harness.ask(commands.Start()).ok
    harness.work()
    assert harness.state.state == "finished"
    with run.results() as found, whole.results() as wanted:
        assert np.array_equal(found.poses()[1], wanted.poses()[1])


@pytest.fixture
def harness():
    made = Harness()
    yield made
    made.job.close()


@pytest.fixture
def run(session_on_disk: Session) -> StoredRun:
    return new_run(session_on_disk, "a")


def poses_of(run: StoredRun) -> np.ndarray:
    with run.results() as results:
        return results.poses()[1]


@pytest.fixture
def unbroken(session_on_disk: Session) -> np.ndarray:
    whole, harness = new_run(session_on_disk, "unbroken"), Harness()
    harness.open(whole)
    harness.ask(commands.Start())
    harness.work()
    harness.job.close()
    return poses_of(whole)


def test_from_open_to_finished(harness: Harness, run: StoredRun) -> None:
    harness.open(run)
    assert (harness.state.state, harness.state.first, harness.state.last, harness.state.done) == (
        "paused",
        0,
        4,
        0,
    )
    assert (harness.state.session, harness.state.run) == ("toy", "a")
    assert harness.settings.values["particles"] == 30
    assert not harness.job.busy
    assert harness.ask(commands.Start()).ok
    assert harness.state.state == "tracking"
    harness.work()
    assert harness.state.state == "finished"
    assert harness.state.done == 4
    assert harness.layers() == [(frame, layer, False) for frame in range(4) for layer in range(LAYERS)]
    finished = [event for event in harness.events if isinstance(event, FrameFinished)]
    assert np.array_equal([event.result.estimate.pose for event in finished], poses_of(run))
    assert [entry.text for entry in read_log(run.folder)] == ["Tracking from frame 0.", "Finished: 4 frames."]
    assert not harness.ask(commands.Start()).ok


def test_compiling_is_said_once(harness: Harness, run: StoredRun) -> None:
    harness.open(run)
    harness.ask(commands.Start())
    harness.work()
    said = [event.state for event in harness.events if isinstance(event, StateChanged)]
    assert said[:4] == ["paused", "tracking", "compiling", "tracking"]
    assert said.count("compiling") == 1


def test_every_command_works_inside_a_frame(harness: Harness, run: StoredRun, unbroken: np.ndarray) -> None:
    harness.open(run)
    harness.ask(commands.Start())
    harness.advance(LAYERS + 1)
    for command in (
        commands.Start(),
        commands.Seek(frame=0),
        commands.ChangeSettings(changes={}),
        commands.Pause(),
        commands.StepLayer(),
        commands.StepFrame(),
        commands.Reanneal(frame=0),
        commands.Start(),
        commands.Cancel(),
        commands.Start(),
    ):
        assert harness.ask(command).ok, command
        harness.advance(1) if harness.job.busy else None
    harness.work()
    assert np.array_equal(poses_of(run), unbroken)
    assert harness.ask(commands.Stop()).ok
    assert harness.job.stopped


def test_a_layers_step_stops_in_the_frame_and_the_next_goes_on_from_its_particles(
    harness: Harness, run: StoredRun, unbroken: np.ndarray
) -> None:
    harness.open(run)
    waiting = None
    for done in range(1, LAYERS):
        harness.ask(commands.StepLayer())
        harness.work()
        assert (harness.state.state, harness.state.frame, harness.state.layer) == ("paused", 0, done)
        last = [event for event in harness.events if isinstance(event, LayerFinished)][-1]
        if waiting is not None:
            assert np.array_equal(last.record.poses, waiting)
        with run.results() as results:
            partial = results.partial()
            assert [record.layer for record in results.layers(0)] == list(range(done))
        assert partial.next_layer == done
        waiting = partial.state["set_poses"]
    harness.ask(commands.Start())
    harness.work()
    assert np.array_equal(poses_of(run), unbroken)


def test_a_frames_step_stops_at_its_end(harness: Harness, run: StoredRun) -> None:
    harness.open(run)
    harness.ask(commands.StepLayer())
    harness.work()
    harness.ask(commands.StepFrame())
    harness.work()
    assert (harness.state.state, harness.state.frame, harness.state.layer, harness.state.done) == (
        "paused",
        1,
        0,
        1,
    )


def test_settings_change_between_two_layers_and_say_so(harness: Harness, run: StoredRun) -> None:
    harness.open(run)
    harness.ask(commands.Start())
    harness.advance(LAYERS + 1)
    assert harness.ask(commands.ChangeSettings(changes={"survival": 0.2})).ok
    harness.advance(1)
    said = harness.settings
    assert (said.version, said.frame, said.layer, said.changed) == (2, 1, 1, ("survival",))
    assert said.values["survival"] == 0.2
    last = [event for event in harness.events if isinstance(event, LayerFinished)][-1]
    assert (last.record.settings_version, last.record.alpha_wanted) == (2, 0.2)
    refused = harness.ask(commands.ChangeSettings(changes={"survival": 2.0}))
    assert (refused.ok, refused.code) == (False, "settings")
    assert "survival" in refused.message


def test_a_change_while_paused_anneals_the_frame_again_and_stores_nothing(
    harness: Harness, run: StoredRun, unbroken: np.ndarray
) -> None:
    harness.open(run)
    harness.ask(commands.StepFrame())
    harness.work()
    asked = commands.ChangeSettings(changes={"survival": 0.2})
    harness.events.clear()
    harness.ask(asked)
    assert harness.state.state == "reannealing"
    harness.work()
    assert harness.layers() == [(0, layer, True) for layer in range(LAYERS)]
    assert all(
        event.requested_at == asked.requested_at
        for event in harness.events
        if isinstance(event, LayerFinished)
    )
    assert (harness.settings.version, harness.settings.changed) == (2, ("survival",))
    assert harness.state.state == "paused"
    assert np.array_equal(poses_of(run), unbroken[:1])
    with run.results() as results:
        assert [entry.version for entry in results.settings_history()] == [1]
    harness.ask(commands.ChangeSettings(changes={"survival": 0.3}))
    harness.work()
    harness.ask(commands.Start())
    harness.work()
    assert np.array_equal(poses_of(run), unbroken)


def test_moved_knobs_are_kept_for_whoever_opens_the_run_next(
    harness: Harness, run: StoredRun, session_on_disk: Session
) -> None:
    other = new_run(session_on_disk, "other")
    harness.open(run)
    harness.ask(commands.StepFrame())
    harness.work()
    harness.ask(commands.ChangeSettings(changes={"survival": 0.2}))
    harness.work()
    harness.open(other)
    assert harness.settings.values["survival"] != 0.2, "they are of the one run"
    harness.job.close()
    again = Harness()
    again.open(run)
    assert again.settings.values["survival"] == settings_with_moved(run).tracker.survival == 0.2
    # The search goes on with them; then they are the run's own, and no longer moved.
    again.ask(commands.Start())
    again.advance(1)
    last = [event for event in again.events if isinstance(event, LayerFinished)][-1]
    assert (last.record.frame, last.record.settings_version, last.record.alpha_wanted) == (1, 2, 0.2)
    version, stored = stored_settings(run)
    assert (version, stored.tracker.survival) == (2, 0.2)
    again.ask(commands.ChangeSettings(changes={"survival": 0.7}))
    again.work()
    assert settings_with_moved(run).tracker.survival == 0.7
    again.job.close()


def test_moved_knobs_are_put_back(harness: Harness, run: StoredRun, unbroken: np.ndarray) -> None:
    harness.open(run)
    harness.ask(commands.StepFrame())
    harness.work()
    before = harness.settings
    harness.ask(commands.ChangeSettings(changes={"survival": 0.2, "particles": 40}))
    harness.advance(1)
    assert harness.state.state == "reannealing"
    assert harness.ask(commands.PutBackSettings()).ok
    assert harness.state.state == "paused"
    assert not harness.job.busy
    assert (harness.settings.version, harness.settings.values) == (before.version, before.values)
    assert settings_with_moved(run).tracker.particles == before.values["particles"]
    assert not (run.folder / "moved_knobs.json").exists()
    harness.ask(commands.Start())
    harness.work()
    assert np.array_equal(poses_of(run), unbroken)


def test_a_kept_result_leaves_no_knob_moved(harness: Harness, run: StoredRun) -> None:
    harness.open(run)
    harness.ask(commands.StepFrame())
    harness.work()
    harness.ask(commands.ChangeSettings(changes={"survival": 0.2}))
    harness.work()
    harness.ask(commands.Reanneal(frame=0, keep=True))
    harness.work()
    assert stored_settings(run)[1].tracker.survival == 0.2
    assert not (run.folder / "moved_knobs.json").exists()


@pytest.mark.parametrize(
    "content",
    [b"", b"[1]", b'{"after": 1, "values": {"survival": 7}}', b'{"after": 9, "values": {"survival": 0.2}}'],
)
def test_what_is_kept_of_moved_knobs_never_keeps_a_run_closed(
    harness: Harness, run: StoredRun, content: bytes
) -> None:
    (run.folder / "moved_knobs.json").write_bytes(content)
    harness.open(run)
    assert harness.settings.version == 1
    assert harness.settings.values["survival"] == stored_settings(run)[1].tracker.survival


def test_a_dragged_slider_shows_an_answer_and_then_the_newest(harness: Harness, run: StoredRun) -> None:
    harness.open(run)
    harness.ask(commands.StepFrame())
    harness.work()
    harness.events.clear()
    harness.ask(commands.ChangeSettings(changes={"survival": 0.2}))
    harness.advance(1)
    for survival in (0.25, 0.31, 0.35):
        harness.ask(commands.ChangeSettings(changes={"survival": survival}))
    harness.work()
    wanted = [event.record.alpha_wanted for event in harness.events if isinstance(event, LayerFinished)]
    assert wanted == [0.2] * LAYERS + [0.35] * LAYERS


def test_the_selected_frame_is_the_one_that_is_annealed(harness: Harness, run: StoredRun) -> None:
    harness.open(run)
    harness.ask(commands.Start())
    harness.work()
    assert harness.ask(commands.Seek(frame=2)).ok
    assert harness.state.selected == 2
    harness.events.clear()
    harness.ask(commands.Reanneal())
    harness.work()
    assert harness.layers() == [(2, layer, True) for layer in range(LAYERS)]
    again = [event.record for event in harness.events if isinstance(event, LayerFinished)]
    with run.results() as results:
        for one, other in zip(again, results.layers(2), strict=True):
            assert np.array_equal(one.poses, other.poses)
            assert np.array_equal(one.log_weights, other.log_weights)
    refused = harness.ask(commands.Seek(frame=9))
    assert (refused.ok, refused.code) == (False, "not-found")
    assert harness.state.state == "finished"


def test_an_answer_that_is_kept_is_the_runs_own(
    harness: Harness, run: StoredRun, unbroken: np.ndarray
) -> None:
    harness.open(run)
    harness.ask(commands.Start())
    harness.work()
    harness.ask(commands.Seek(frame=1))
    harness.ask(commands.ChangeSettings(changes={"survival": 0.2}))
    harness.work()
    harness.ask(commands.Reanneal(frame=1, keep=True))
    harness.work()
    last = [event for event in harness.events if isinstance(event, FrameFinished)][-1]
    assert not last.reannealed
    assert np.array_equal(poses_of(run)[1], last.result.estimate.pose)
    # What it replaced and what followed from that is in the trash, and can be brought back.
    workspace = Workspace(run.folder.parent.parent.parent)
    (trashed,) = workspace.trashed()
    restored = workspace.restore_run(trashed)
    assert np.array_equal(poses_of(restored), unbroken)
    assert restored.damage() == ""
    assert (harness.state.state, harness.state.done, harness.state.frame) == ("paused", 2, 2)
    harness.ask(commands.Start())
    harness.work()
    assert harness.state.state == "finished"
    with run.results() as results:
        assert {record.settings_version for record in results.layers(3)} == {2}


def test_cancelled_and_taken_up_after_all(harness: Harness, run: StoredRun, unbroken: np.ndarray) -> None:
    harness.open(run)
    harness.ask(commands.Start())
    harness.advance(LAYERS + 2)
    assert harness.ask(commands.Cancel()).ok
    assert harness.state.state == "cancelled"
    assert not harness.job.busy
    harness.job.close()
    assert run.summary().status == "cancelled"
    other = Harness()
    other.open(run)
    assert other.state.state == "cancelled"
    other.ask(commands.Start())
    other.work()
    other.job.close()
    assert np.array_equal(poses_of(run), unbroken)
    assert run.summary().status == "finished"


def test_without_a_run_everything_is_refused_in_words(harness: Harness, tmp_path: Path) -> None:
    for command in (commands.Start(), commands.Pause(), commands.Reanneal(frame=0), commands.Cancel()):
        answer = harness.ask(command)
        assert not answer.ok
        assert answer.hint
    missing = harness.ask(commands.Open(session=str(tmp_path), run=str(tmp_path / "runs" / "x")))
    assert missing.code == "not-found"
    assert harness.job.busy is False


def test_runs_wait_for_each_other(harness: Harness, session_on_disk: Session) -> None:
    runs = [new_run(session_on_disk, name) for name in ("a", "b", "c", "d")]
    folder = str(session_on_disk.path)
    for run in runs:
        assert harness.ask(commands.Start(session=folder, run=str(run.folder))).ok
    assert harness.state.run == "a"
    assert harness.state.waiting == (("toy", "b"), ("toy", "c"), ("toy", "d"))
    assert harness.ask(commands.Start(session=folder, run=str(runs[1].folder))).ok
    assert harness.ask(commands.Start(session=folder, run=str(runs[0].folder))).ok
    assert harness.state.waiting == (("toy", "b"), ("toy", "c"), ("toy", "d")), "each waits once"
    assert harness.ask(commands.Dequeue(session=folder, run=str(runs[2].folder))).ok
    harness.advance(2)
    harness.ask(commands.Cancel())
    assert (harness.state.run, harness.state.state, harness.state.waiting) == (
        "b",
        "tracking",
        (("toy", "d"),),
    )
    harness.work()
    assert [run.summary().status for run in runs] == ["cancelled", "finished", "new", "finished"]


def about(run: StoredRun) -> commands.About:
    return commands.about(run.folder)


WINDOWS = {
    "start a": lambda a, b: commands.Start(**about(a)),
    "start b": lambda a, b: commands.Start(**about(b)),
    "look at a": lambda a, b: commands.Open(**about(a)),
    "change b": lambda a, b: commands.ChangeSettings(changes={"survival": 0.4}, **about(b)),
}


@pytest.mark.parametrize("order", list(itertools.permutations(WINDOWS)), ids=", ".join)
def test_in_whatever_order_windows_are_heard_each_command_is_about_its_run(
    harness: Harness, session_on_disk: Session, order: tuple[str, ...]
) -> None:
    """What each window saw before it asked is of no account: a refusal names the run that is tracked."""
    a, b = new_run(session_on_disk, "a"), new_run(session_on_disk, "b")
    answers: dict[str, Acknowledged] = {}
    for what in order:
        answers[what] = harness.ask(WINDOWS[what](a, b))
        if answers[what].ok and what == "change b":
            assert answers[what].run == "b"
        if not answers[what].ok:
            assert what == "change b"
            assert "Run 'a' of session 'toy' is being tracked." in answers[what].message
    # Looking at a paused b's search; whoever wants it to go on asks again.
    for run in (a, b):
        assert harness.ask(commands.Start(**about(run))).ok
    harness.work()
    assert [run.summary().status for run in (a, b)] == ["finished", "finished"]
    with a.results() as results:
        assert {record.settings_version for record in results.layers(0)} == {1}, "b's knob is not a's"
    errors = [event.text for event in harness.events if isinstance(event, LogLine) and event.level == "error"]
    assert errors == [], "what was started does not wait any more"


def test_a_command_without_a_run_is_about_the_open_one_and_a_release_names_what_it_means(
    harness: Harness, run: StoredRun, session_on_disk: Session
) -> None:
    other = new_run(session_on_disk, "b")
    harness.open(run)
    assert harness.ask(commands.Close(**about(other))).ok
    assert harness.ask(commands.Close(session=str(run.folder.parents[2] / "elsewhere"))).ok
    assert harness.state.run == "a"
    harness.ask(commands.Start())
    assert not harness.ask(commands.Close(**about(run))).ok
    assert not harness.ask(commands.Close(session=about(run)["session"])).ok
    harness.work()
    assert harness.ask(commands.Close(session=about(run)["session"])).ok
    assert harness.state.state == "idle"


def test_another_run_opened_while_tracking_leaves_the_first_saved_whole(
    harness: Harness, run: StoredRun, session_on_disk: Session, unbroken: np.ndarray
) -> None:
    other = new_run(session_on_disk, "b")
    harness.open(run)
    harness.ask(commands.Start())
    harness.advance(LAYERS + 2)
    harness.open(run)
    assert harness.state.state == "tracking"
    harness.open(other)
    assert (harness.state.run, harness.state.state) == ("b", "paused")
    with run.results() as results:
        partial = results.partial()
    assert (partial.frame, partial.next_layer) == (1, 2)
    harness.open(run)
    harness.ask(commands.Start())
    harness.work()
    assert np.array_equal(poses_of(run), unbroken)


def test_a_frame_that_cannot_be_read_fails_the_run_and_can_be_tried_again(
    harness: Harness, run: StoredRun, session_on_disk: Session, unbroken: np.ndarray
) -> None:
    path = session_on_disk.path / "pictures" / "front" / "0002.png"
    picture = path.read_bytes()
    path.write_bytes(picture[: len(picture) // 2])
    harness.open(run)
    harness.ask(commands.Start())
    harness.work()
    assert (harness.state.state, harness.state.done) == ("failed", 2)
    assert "0002.png" in harness.state.message
    assert harness.state.hint
    errors = [event for event in harness.events if isinstance(event, LogLine) and event.level == "error"]
    assert len(errors) == 1
    path.write_bytes(picture)
    assert harness.ask(commands.Start()).ok
    harness.work()
    assert harness.state.state == "finished"
    assert np.array_equal(poses_of(run), unbroken)


def test_a_fault_of_the_program_is_an_event_with_its_traceback(
    harness: Harness, run: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    harness.open(run)
    monkeypatch.setattr(cv2, "imdecode", lambda *_: 1 / 0)
    harness.ask(commands.Start())
    harness.work()
    assert harness.state.state == "failed"
    assert "ZeroDivisionError" in harness.state.message
    assert any(isinstance(event, LogLine) and "Traceback" in event.text for event in harness.events)


def test_closing_a_run_lets_go_of_its_pictures(harness: Harness, run: StoredRun, tmp_path: Path) -> None:
    harness.open(run)
    harness.ask(commands.Start())
    harness.advance(2)
    opened = harness.job._run
    make_session(Workspace().root / "other")
    harness.open(new_run(Workspace().session("other"), "x"))
    assert not opened._problems._evidence
    assert not opened._problems._problems
    assert not run.being_tracked()
