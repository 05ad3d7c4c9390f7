"""Two scenes beside each other: the stored frame in one, a trial of it in the other, everything else alike."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from threading import Event

import numpy as np
import pytest
from scene_fakes import FakeControl
from swaying_session import LAYERS, cloud_record, frame_result, swaying_pose
from test_scene_server import body_stands_at, open_run, views
from waiting import until

from studio.app.scene.model import LiveSearch, Model
from studio.app.scene.scene_server import SceneServer
from studio.app.scene.twin import Places, following, joining
from studio.app.scene.window_scenes import WindowScenes
from studio.body.model import BodyModel
from studio.operations.jobs.events import FrameFinished, LayerFinished
from studio.sessions.workspace import Workspace

FRAME, SHIFT = 2, 120.0


@dataclass
class Camera:
    """A viewer's, in a browser that answers with the place that it was put to."""

    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    look_at: np.ndarray = field(default_factory=lambda: np.ones(3))


@pytest.fixture
def scenes(workspace: Workspace, control: FakeControl) -> Iterator[WindowScenes]:
    made = WindowScenes(workspace, control)  # type: ignore[arg-type]
    yield made
    made.stop()


def tried_pose(human: BodyModel) -> np.ndarray:
    pose = swaying_pose(human, FRAME)
    pose[4] += SHIFT
    return pose


def emit_trial(control: FakeControl, human: BodyModel) -> None:
    for layer in range(LAYERS):
        control.emit(LayerFinished("swaying", "run-1", cloud_record(human, FRAME, layer), True))
    control.emit(FrameFinished("swaying", "run-1", frame_result(human, FRAME, shift=SHIFT), True))


def split(scenes: WindowScenes) -> tuple[SceneServer, SceneServer]:
    """The window's scene at the frame, and its second one."""
    stored = scenes.scene("w")
    open_run(stored)
    stored.show_frame(FRAME)
    until(lambda: stored.shown.frame == FRAME)
    scenes.split("w", True)
    tried = scenes.twin("w")
    until(lambda: tried.shown.frame == FRAME)
    return stored, tried


def test_the_stored_stays_at_the_left_and_the_trial_is_at_the_right(
    scenes: WindowScenes, control: FakeControl, human: BodyModel
) -> None:
    stored, tried = split(scenes)
    emit_trial(control, human)
    until(lambda: body_stands_at(tried, human, tried_pose(human)))
    until(lambda: body_stands_at(stored, human, swaying_pose(human, FRAME)))
    assert not stored._controller.model.live.records
    assert not views(tried).beside.handles[0].visible, "the stored one is beside it"
    assert not tried._controller.panel.tabs.visible
    # Another trial, and one to compare it with in the first scene.
    other = LiveSearch(FRAME, True, (cloud_record(human, FRAME, 0),), frame_result(human, FRAME, shift=-60.0))
    stored.show_trial(other)
    beside = swaying_pose(human, FRAME)
    beside[4] -= 60.0
    until(lambda: body_stands_at(stored, human, beside))
    stored.show_trial(None)
    until(lambda: body_stands_at(stored, human, swaying_pose(human, FRAME)))
    # Joined again, the first scene shows what is tried.
    scenes.split("w", False)
    assert scenes.twin("w") is None
    until(lambda: stored._controller.model.options.trials)
    emit_trial(control, human)
    until(lambda: body_stands_at(stored, human, tried_pose(human)))


def test_a_trial_that_is_shown_while_the_first_scene_is_busy_is_kept(
    scenes: WindowScenes, human: BodyModel
) -> None:
    stored = scenes.scene("w")
    open_run(stored)
    stored.show_frame(FRAME)
    until(lambda: stored.shown.frame == FRAME)
    goes_on = Event()

    def hold(model: Model) -> Model:
        goes_on.wait(60.0)
        return model

    stored._controller.post(hold)
    scenes.split("w", True)
    tried = scenes.twin("w")
    trial = frame_result(human, FRAME, shift=SHIFT)
    tried.show_trial(LiveSearch(FRAME, True, (cloud_record(human, FRAME, 0),), trial))
    goes_on.set()
    until(lambda: tried.shown.frame == FRAME)
    until(lambda: body_stands_at(tried, human, tried_pose(human)))


def test_what_is_chosen_in_either_is_chosen_in_both(scenes: WindowScenes) -> None:
    stored, tried = split(scenes)
    stored.show_layer(1)
    stored.set_options(dark=False)
    until(lambda: tried.shown.layer == 1 and not tried._controller.model.options.dark)
    tried.select(limb="left arm")
    until(lambda: stored.shown.limb == "left arm")
    stored.show_frame(1)
    until(lambda: tried.shown.frame == 1)
    stored.look_from((1.0, 2.0, 3.0, 0.0, 0.0, 1.0))
    until(lambda: tried.shown.eye == (1.0, 2.0, 3.0, 0.0, 0.0, 1.0))


def test_a_viewer_s_place_goes_across_and_is_not_sent_back(scenes: WindowScenes) -> None:
    stored, tried = split(scenes)
    one, other = stored._controller, tried._controller
    put: list[tuple[float, ...]] = []
    other.put_viewers = lambda eye: (other._places.note(eye), put.append(eye))
    back: list[tuple[float, ...]] = []
    one.put_viewers = back.append  # type: ignore[method-assign]
    # The second scene's browser says where it begins, also while it is put elsewhere.
    other._sees(Camera(position=np.full(3, 3.0)))  # type: ignore[arg-type]
    one._sees(Camera())  # type: ignore[arg-type]
    other._sees(Camera(position=np.full(3, 3.0)))  # type: ignore[arg-type]
    assert back == []
    assert put == [(0.0, 0.0, 0.0, 1.0, 1.0, 1.0)]
    other._sees(Camera(look_at=np.ones(3) + 0.005))  # type: ignore[arg-type]
    assert back == [], "a browser's answer is no move"
    other._sees(Camera(position=np.array([0.5, 0.0, 0.0])))  # type: ignore[arg-type]
    assert back == [(0.5, 0.0, 0.0, 1.0, 1.0, 1.0)]


def test_each_keeps_what_is_its_own(control: FakeControl) -> None:
    leader, follower = Model(control.state), Model(control.state)
    leader = replace(leader, options=replace(leader.options, trials=False, trails=False))
    follower = replace(follower, options=replace(follower.options, stored=False))
    options = following(follower, leader).options
    assert (options.trials, options.stored, options.trails) == (True, False, False)
    joined = joining(leader, replace(follower, selection=replace(follower.selection, particle=3, layer=2)))
    assert (joined.selection.particle, joined.selection.layer) == (3, None)
    assert joined.options is leader.options
    assert not Places().is_echo((0.0,) * 6)


def test_a_viewer_who_is_slow_to_say_where_it_was_put_did_not_move(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr("studio.app.scene.twin.time.monotonic", lambda: clock[0])
    places, here, there = Places(), (1.0,) * 6, (2.0,) * 6
    places.note(here)
    clock[0] += 60.0
    assert places.is_echo(here)
    assert not places.is_echo(there)
    places.note(there)
    clock[0] += 60.0
    assert not places.is_echo(here), "it went back by itself"
