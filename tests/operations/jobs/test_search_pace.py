"""The search at a pace: layers wait for their time, commands do not, and nothing that is found changes."""

import math

import numpy as np
import pytest
from toy_session import true_poses

from studio.foundations.errors import SettingsError
from studio.operations.jobs import commands
from studio.operations.jobs.events import Acknowledged, Event, LayerFinished, StateChanged
from studio.operations.jobs.process import _loop
from studio.operations.jobs.search_pace import MOST_SECONDS, SPEEDS, SearchPace, in_words, pace_view
from studio.operations.jobs.tracking_job import TrackingJob
from studio.runs.new_run import prepare_run
from studio.runs.pace import Pace
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

LAYERS, FRAMES = 3, 3


class Afternoon:
    """A clock that only waiting moves, commands that come at given times, and what was said when."""

    def __init__(self, *coming: tuple[float, commands.Command]) -> None:
        self.now = 0.0
        self.coming = list(coming)
        self.said: list[tuple[float, Event]] = []
        self.job = TrackingJob(lambda event: self.said.append((self.now, event)), lambda: self.now)

    def poll(self, timeout: float) -> bool:
        """As of a pipe: wait for a command, at most so long."""
        assert timeout >= 0.0
        assert self.coming, self.said[-3:]
        at = self.coming[0][0]
        self.now = max(self.now, min(at, self.now + timeout))
        return at <= self.now

    def recv(self) -> commands.Command:
        """The command that came."""
        return self.coming.pop(0)[1]

    def spend(self) -> "Afternoon":
        """Until the last command has been served, which must be a Stop."""
        _loop(self.job, self)  # pyright: ignore[reportArgumentType] - as much of a pipe as the loop uses
        assert self.job.stopped
        return self

    def layers(self) -> list[float]:
        """When each layer was done."""
        return [at for at, event in self.said if isinstance(event, LayerFinished)]

    def states(self) -> list[tuple[float, StateChanged]]:
        """Every state and when it was said."""
        return [(at, event) for at, event in self.said if isinstance(event, StateChanged)]


def new_run(session: Session, name: str) -> StoredRun:
    changes = {"particles": 30, "layers": LAYERS, "start_repeats": 1}
    return prepare_run(session, name=name, seed=5, start_pose=true_poses()[0], last=FRAMES, knobs=changes)


def opening(run: StoredRun) -> commands.Open:
    return commands.Open(session=str(run.folder.parents[1]), run=str(run.folder))


def poses_of(run: StoredRun) -> np.ndarray:
    with run.results() as results:
        return results.poses()[1]


def test_layers_wait_for_their_time_and_commands_are_served_at_once(session_on_disk: Session) -> None:
    quick, watched = new_run(session_on_disk, "quick"), new_run(session_on_disk, "watched")
    Afternoon((0.0, opening(quick)), (0.0, commands.Start()), (9.0, commands.Stop())).spend()
    spent = Afternoon(
        (0.0, opening(watched)),
        (0.0, commands.SetPace(seconds_a_layer=0.5)),
        (0.0, commands.Start()),
        (1.3, commands.Pause()),
        (1.4, commands.Start()),
        (2.1, commands.SetPace(seconds_a_layer=2.0)),
        (4.5, commands.SetPace()),
        (9.0, commands.Stop()),
    ).spend()
    # Paused in the third layer's time, gone on in it; from 2.1 s on the layer begun at 2.0 s has two seconds.
    assert spent.layers() == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0, 4.0, 4.5, 4.5, 4.5])
    assert next(at for at, state in spent.states() if at > 0.5 and state.state == "paused") == 1.3
    assert [at for at, state in spent.states() if state.state == "finished"] == pytest.approx([4.5])
    assert np.array_equal(poses_of(watched), poses_of(quick))
    assert "seconds_a_layer" not in watched.record.settings


def test_steps_and_annealing_again_are_not_held_back(session_on_disk: Session) -> None:
    spent = Afternoon(
        (0.0, opening(new_run(session_on_disk, "a"))),
        (0.0, commands.SetPace(seconds_a_layer=MOST_SECONDS)),
        (0.0, commands.StepFrame()),
        (1.0, commands.StepLayer()),
        (1.5, commands.StepLayer()),
        (2.0, commands.Reanneal(frame=0)),
        (3.0, commands.Stop()),
    ).spend()
    assert spent.layers() == [0.0] * LAYERS + [1.0, 1.5] + [2.0] * LAYERS


def test_the_state_says_the_pace_and_estimates_hold_for_it(session_on_disk: Session) -> None:
    spent = Afternoon(
        (0.0, commands.SetPace(seconds_a_layer=0.5)),
        (0.0, opening(new_run(session_on_disk, "a"))),
        (0.0, commands.Start()),
        (2.2, commands.Pause()),
        (2.3, commands.SetPace(seconds_a_layer=5.0)),
        (2.4, commands.Stop()),
    ).spend()
    assert {state.seconds_a_layer for at, state in spent.states() if at < 2.3} == {0.5}
    paused, slower = (state for at, state in spent.states() if at in (2.2, 2.3))
    # The layers themselves took next to nothing; on a busy machine one may take longer than its half second.
    assert paused.frames_per_second <= 1.001 / (LAYERS * 0.5)
    assert math.isnan(slower.seconds_left), "one frame foretells nothing"
    assert slower.frames_per_second == pytest.approx(1.0 / (LAYERS * 5.0))
    assert (slower.state, slower.seconds_a_layer) == ("paused", 5.0)


def test_estimates_count_what_each_layer_takes_or_waits() -> None:
    pace = Pace()
    assert math.isnan(pace.progress(0, 10, 1.0).seconds_left)
    for _ in range(3):
        pace.add([0.1, 0.3])
        pace.add([0.2, 0.2])
    assert pace.progress(6, 14).seconds_left == pytest.approx(8 * 0.4)
    assert pace.progress(6, 14, 0.25).frames_per_second == pytest.approx(2 / (0.25 + 0.3 + 0.25 + 0.25))
    assert pace.progress(6, 14, 0.25).seconds_left == pytest.approx(8 * 0.525, rel=0.05)


@pytest.mark.parametrize("seconds", [-0.1, math.nan, math.inf, 10.5])
def test_what_is_no_pace_is_refused_in_words(seconds: float) -> None:
    said: list[Event] = []
    job = TrackingJob(said.append)
    job.serve(commands.SetPace(seconds_a_layer=0.25))
    job.serve(commands.SetPace(seconds_a_layer=seconds))
    refused = said[-1]
    assert isinstance(refused, Acknowledged)
    assert not refused.ok
    assert refused.code == SettingsError.code
    assert f"{seconds:g}" in refused.message
    assert "0 " in refused.hint
    states = [event for event in said if isinstance(event, StateChanged)]
    assert [state.seconds_a_layer for state in states] == [0.25]


def test_the_choices_in_words() -> None:
    assert [choice.label for choice in pace_view().choices] == [
        "full speed",
        "10 layers/s",
        "3 layers/s",
        "1 layer/s",
    ]
    assert [choice.seconds_a_layer for choice in pace_view(1.0).choices] == list(SPEEDS)
    assert [choice.label for choice in pace_view(0.05).choices][:3] == [
        "full speed",
        "20 layers/s",
        "10 layers/s",
    ]
    assert in_words(2.5) == "2.5 s a layer"
    for choice in pace_view().choices:
        SearchPace().set(choice.seconds_a_layer)
