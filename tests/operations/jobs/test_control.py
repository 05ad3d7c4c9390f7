"""The real process: it answers while it anneals, dies without a word, and goes on as if it had not."""

import dataclasses
import os
import queue
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import psutil
import pytest
from toy_session import make_session, true_poses
from waiting import until

from studio.foundations.errors import RunError, SettingsError
from studio.operations.jobs import commands
from studio.operations.jobs import process as tracking_process
from studio.operations.jobs.control import StudioControl
from studio.operations.jobs.events import (
    Acknowledged,
    Event,
    FrameFinished,
    LayerFinished,
    RunState,
    StateChanged,
)
from studio.operations.jobs.process import OwnedProcess, ProcessDiedError
from studio.operations.jobs.watchers import Subscription
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

PATIENCE = 120.0
LONG = 40


@pytest.fixture
def control(session_on_disk: Session) -> Iterator[StudioControl]:
    made = StudioControl(Workspace())
    yield made
    made.close()


def new_run(session: Session, name: str, last: int = 8, **changed: object) -> StoredRun:
    changes = {"particles": 100, "layers": 10, "start_repeats": 1} | changed
    return prepare_run(session, name=name, seed=11, start_pose=true_poses()[0], last=last, knobs=changes)


def wait_for(watching: Subscription, wanted: Callable[[Event], bool]) -> Event:
    """The first event that is wanted; fails with what came instead."""
    until, seen = time.monotonic() + PATIENCE, []
    while True:
        try:
            event = watching.get(timeout=until - time.monotonic())
        except queue.Empty:
            raise AssertionError(f"nothing of the kind among {seen[-20:]}") from None
        seen.append(type(event).__name__ + getattr(event, "state", ""))
        if wanted(event):
            return event


def in_state(*names: str) -> Callable[[Event], bool]:
    return lambda event: isinstance(event, StateChanged) and event.state in names


def poses_of(run: StoredRun) -> np.ndarray:
    with run.results() as results:
        return results.poses()[1]


def track(control: StudioControl, run: StoredRun) -> np.ndarray:
    watching = control.subscribe()
    control.track(run.session_name, run.name)
    wait_for(watching, in_state("finished"))
    watching.close()
    return poses_of(run)


@pytest.mark.slow
def test_killed_in_mid_run_it_is_lost_and_resumes_bit_for_bit(control: StudioControl) -> None:
    session = make_session(control.workspace.place_for("longer"), frames=LONG)
    whole, killed = (new_run(session, name, LONG, particles=1000) for name in ("whole", "killed"))
    wanted = track(control, whole)
    watching = control.subscribe()
    # A second a frame: it is killed in mid-run however long a busy machine keeps this thread waiting.
    control.request(commands.SetPace(seconds_a_layer=0.1))
    control.track("longer", "killed")
    wait_for(watching, lambda event: isinstance(event, FrameFinished) and event.result.frame >= 2)
    first = control.process_identifier
    assert first is not None
    os.kill(first, signal.SIGKILL)
    lost = wait_for(watching, in_state("lost"))
    assert isinstance(lost, StateChanged)
    assert "signal 9, SIGKILL" in lost.message
    assert "Resume" in lost.hint
    assert (lost.session, lost.run) == ("longer", "killed")
    assert control.state.state == "lost"
    assert 3 <= killed.summary().done < LONG
    assert killed.summary().status == "interrupted"
    with pytest.raises(RunError, match=r"^The tracking process died before it answered\. "):
        control.send(commands.Pause())
    control.restart()
    control.request(commands.SetPace())
    wait_for(watching, in_state("finished"))
    assert control.process_identifier != first
    assert np.array_equal(poses_of(killed), wanted)
    with killed.results() as results, whole.results() as others:
        for frame in range(LONG):
            for one, other in zip(results.layers(frame), others.layers(frame), strict=True):
                assert np.array_equal(one.poses, other.poses)


def test_commands_are_answered_while_a_frame_is_annealed(
    control: StudioControl, session_on_disk: Session
) -> None:
    new_run(session_on_disk, "long", particles=4000, layers=60)
    watching = control.subscribe()
    control.open_run("toy", "long")
    control.request(commands.Start())
    wait_for(watching, lambda event: isinstance(event, LayerFinished))
    control.change_settings(survival=0.4)
    changed = wait_for(
        watching, lambda event: isinstance(event, LayerFinished) and event.record.settings_version == 2
    )
    assert changed.record.alpha_wanted == 0.4
    with pytest.raises(SettingsError, match="survival"):
        control.change_settings(survival=7.0)
    control.request(commands.Pause())
    paused = wait_for(watching, in_state("paused"))
    assert isinstance(paused, StateChanged)
    control.request(commands.StepLayer())
    stepped = wait_for(watching, in_state("paused"))
    assert isinstance(stepped, StateChanged)
    assert 60 * stepped.frame + stepped.layer == 60 * paused.frame + paused.layer + 1
    control.request(commands.Cancel())
    assert wait_for(watching, in_state("cancelled"))


@pytest.mark.slow
def test_the_time_from_a_slider_to_its_last_layer_is_in_the_events(
    control: StudioControl, session_on_disk: Session
) -> None:
    track(control, new_run(session_on_disk, "a"))
    watching = control.subscribe()
    asked = time.monotonic()
    control.change_settings(survival=0.4)
    last = wait_for(watching, lambda event: isinstance(event, LayerFinished) and event.record.layer == 9)
    assert isinstance(last, LayerFinished)
    assert last.reannealed
    assert asked <= last.requested_at <= last.left_at <= time.monotonic()


def test_a_command_that_the_process_dies_of_is_answered(
    control: StudioControl, session_on_disk: Session
) -> None:
    control.start()
    process = psutil.Process(control.process_identifier)
    process.suspend()
    watching = control.subscribe()
    command = commands.Close(session=str(session_on_disk.path), run=str(session_on_disk.path / "runs" / "a"))
    threading.Timer(0.3, process.kill).start()
    about = f"run 'a' of session '{session_on_disk.name}'"
    with pytest.raises(RunError, match=f"^The tracking process died before it answered about {about}"):
        control.request(command)
    assert wait_for(watching, in_state("lost"))


def test_a_command_that_can_no_longer_be_sent_says_what_it_was_about(
    control: StudioControl, session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    control.start()

    def gone(_: object, command: object) -> None:
        raise ProcessDiedError(f"No {command} any more.", "Resume.")

    monkeypatch.setattr(OwnedProcess, "send", gone)
    command = commands.Close(session=str(session_on_disk.path), run=str(session_on_disk.path / "runs" / "a"))
    about = f"run 'a' of session '{session_on_disk.name}'"
    with pytest.raises(
        ProcessDiedError, match=f"^The tracking process died before it answered about {about}"
    ):
        control.request(command)


def test_a_command_that_is_sent_as_the_process_dies_revives_it(
    control: StudioControl, session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = new_run(session_on_disk, "a", last=2)
    control.start()
    first, real = control.process_identifier, OwnedProcess.send
    dying = [True]

    def send(process: OwnedProcess, command: commands.Command) -> None:
        if dying and process.identifier == first:
            dying.clear()
            psutil.Process(first).kill()
            raise ProcessDiedError("It has died.", "Resume.")
        real(process, command)

    monkeypatch.setattr(OwnedProcess, "send", send)
    watching = control.subscribe()
    control.send(commands.Start(session=str(session_on_disk.path), run=str(run.folder)))
    wait_for(watching, in_state("finished"))
    assert control.process_identifier != first
    assert run.summary().status == "finished"


@pytest.mark.slow
def test_a_process_that_is_slow_to_start_is_not_lost(
    control: StudioControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracking_process, "SILENT_SECONDS", 0.5)
    watching = control.subscribe()
    with pytest.raises(RunError, match="No run is open"):
        control.request(commands.Pause())
    assert isinstance(watching.get(timeout=PATIENCE), Acknowledged)


@pytest.mark.slow
def test_what_a_restarted_process_left_unanswered_is_refused(control: StudioControl) -> None:
    control.start()
    psutil.Process(control.process_identifier).suspend()
    refused = ThreadPoolExecutor(1).submit(control.request, commands.Pause())
    until(lambda: control._answers)
    control.restart()
    with pytest.raises(RunError, match=r"^The tracking process died before it answered\. "):
        refused.result(PATIENCE)
    with pytest.raises(RunError, match="No run is open"):
        control.request(commands.Pause())


@pytest.mark.slow
def test_a_silent_process_is_said_to_be_lost_until_it_speaks_again(
    session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracking_process, "SILENT_SECONDS", 3.0)
    control = StudioControl(Workspace())
    watching = control.subscribe()
    new_run(session_on_disk, "a")
    control.open_run("toy", "a")
    wait_for(watching, in_state("paused"))
    process = psutil.Process(control.process_identifier)
    process.suspend()
    silent = wait_for(watching, in_state("lost"))
    assert isinstance(silent, StateChanged)
    assert "silent" in silent.message
    process.resume()
    assert wait_for(watching, in_state("paused"))
    control.close()
    assert not process.is_running()


@pytest.mark.slow
def test_what_waits_is_brought_back(control: StudioControl, session_on_disk: Session) -> None:
    for name in ("a", "b"):
        new_run(session_on_disk, name, particles=2000, layers=20)
    watching = control.subscribe()
    control.track("toy", "a")
    control.track("toy", "b")
    wait_for(watching, lambda event: isinstance(event, FrameFinished))
    process = psutil.Process(control.process_identifier)
    process.kill()
    wait_for(watching, in_state("lost"))
    control.restart()
    wait_for(watching, lambda event: in_state("finished")(event) and event.run == "b")
    assert [run.summary().status for run in session_on_disk.runs()] == ["finished", "finished"]


@pytest.mark.slow
def test_what_was_renamed_meanwhile_stays_closed_when_the_process_is_started_again(
    control: StudioControl, session_on_disk: Session
) -> None:
    runs = [new_run(session_on_disk, name, particles=2000, layers=20) for name in ("a", "b")]
    watching = control.subscribe()
    for run in runs:
        control.track("toy", run.name)
    wait_for(watching, lambda event: isinstance(event, StateChanged) and event.waiting != ())
    psutil.Process(control.process_identifier).kill()
    wait_for(watching, in_state("lost"))
    for run in runs:
        run.folder.rename(run.folder.with_name(f"{run.name}-renamed"))
    control.restart()
    assert control.state.state == "idle"


@pytest.mark.slow
@pytest.mark.parametrize("lost", [False, True])
def test_windows_that_start_different_runs_at_once_each_get_theirs(
    control: StudioControl, session_on_disk: Session, lost: bool
) -> None:
    """From any state, the process being dead included: one process, and every run that was started is tracked."""
    names = ("a", "b", "c", "d")
    for name in names:
        new_run(session_on_disk, name, 2)
    watching = control.subscribe()
    control.start()
    if lost:
        control.open_run("toy", "a")
        psutil.Process(control.process_identifier).kill()
        wait_for(watching, in_state("lost"))
    together = threading.Barrier(2 * len(names))
    refused: list[Exception] = []

    def window(name: str, act: Callable[[], object]) -> None:
        together.wait()
        try:
            act()
        except RunError as problem:
            refused.append(problem)

    threads = [
        threading.Thread(target=window, args=(name, act))
        for name in names
        for act in (
            lambda name=name: control.track("toy", name),
            lambda name=name: control.request(
                commands.ChangeSettings(changes={"survival": 0.4}, **control.about("toy", name))
            ),
        )
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)

    # The newest state wins: that one of them is finished may be out of date before it is heard of.
    def all_are_finished(event: Event) -> bool:
        found = session_on_disk.runs()
        return in_state("finished")(event) and all(run.summary().status == "finished" for run in found)

    wait_for(watching, all_are_finished)
    assert all("is being tracked" in str(problem) for problem in refused)
    here = psutil.Process()
    tracking = [child for child in here.children() if "studio-tracking" in child.cmdline()]
    assert len(tracking) == 1


@pytest.mark.slow
def test_a_process_that_dies_after_its_last_frame_is_brought_back_with_what_waits(
    control: StudioControl, session_on_disk: Session
) -> None:
    new_run(session_on_disk, "a", 1)
    watching = control.subscribe()
    control.track("toy", "a")
    wait_for(watching, in_state("finished"))
    # As if it had died before it could say so.
    control._said = dataclasses.replace(control.state, state=RunState.TRACKING)
    psutil.Process(control.process_identifier).kill()
    wait_for(watching, in_state("lost"))
    control.restart()
    assert control.state.state != "failed"
    new_run(session_on_disk, "b", 1)
    control.track("toy", "b")
    wait_for(watching, lambda event: in_state("finished")(event) and event.run == "b")


def test_closing_saves_the_frame_at_hand_and_stops_the_process(
    control: StudioControl, session_on_disk: Session
) -> None:
    run = new_run(session_on_disk, "a", particles=4000, layers=60)
    watching = control.subscribe()
    control.track("toy", "a")
    process = psutil.Process(control.process_identifier)
    wait_for(watching, lambda event: isinstance(event, LayerFinished))
    control.close()
    assert not process.is_running()
    assert watching.closed
    with run.results() as results:
        partial = results.partial()
    assert partial.next_layer >= 1
    assert len(partial.state["set_poses"]) == 4000


@pytest.mark.slow
def test_the_process_ends_when_the_server_is_killed(session_on_disk: Session) -> None:
    script = textwrap.dedent(
        """
        import sys, time
        from studio.sessions.workspace import Workspace
        from studio.operations.jobs import commands
        from studio.operations.jobs.control import StudioControl
        if __name__ == "__main__":
            control = StudioControl(Workspace())
            try:
                control.request(commands.Pause())
            except Exception:
                pass
            print(control.process_identifier, flush=True)
            time.sleep(600)
        """
    )
    server = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    process = psutil.Process(int(server.stdout.readline()))
    server.kill()
    server.wait()
    server.stdout.close()
    process.wait(PATIENCE)


@pytest.mark.slow
def test_the_pace_comes_back_with_the_process(control: StudioControl) -> None:
    watching = control.subscribe()
    control.request(commands.SetPace(seconds_a_layer=0.2))
    wait_for(watching, lambda event: isinstance(event, StateChanged) and event.seconds_a_layer == 0.2)
    first = control.process_identifier
    psutil.Process(first).kill()
    wait_for(watching, in_state("lost"))
    control.restart()
    again = wait_for(watching, in_state("idle"))
    assert isinstance(again, StateChanged)
    assert again.seconds_a_layer == control.state.seconds_a_layer == 0.2
    assert control.process_identifier != first
    with pytest.raises(SettingsError, match="-1 seconds"):
        control.request(commands.SetPace(seconds_a_layer=-1.0))
