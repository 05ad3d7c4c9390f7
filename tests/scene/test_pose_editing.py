"""A pose under a person's hands: sliders, balls, gizmos, undo, mirror, the search around it, saving."""

import asyncio
import dataclasses
import math
import threading
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scene_fakes import FakeControl
from swaying_session import swaying_pose
from waiting import until

from studio.body.dragging import Dragger
from studio.body.forward_kinematics import marker_points
from studio.body.mirroring import Mirror
from studio.body.model import BodyModel
from studio.errors import StudioError
from studio.scene import pose_refining
from studio.scene.edited_pose import EditedPose
from studio.scene.guarded_server import GuardedServer
from studio.scene.pose_desk import PoseDesk
from studio.scene.pose_editor import MIRROR, RESET, ROUND, UNDO, PoseEditor, PoseWishes
from studio.scene.stage import SceneStage
from studio.sessions.workspace import Workspace

SOMEBODY = 7


def by_hand(handle, value: object) -> None:
    """What happens when a viewer moves a control."""
    handle._impl.value = value
    for callback in handle._impl.update_cb:
        asyncio.run(callback(SimpleNamespace(target=handle, client_id=SOMEBODY)))


def drag(gizmo, place: np.ndarray, phase: str = "update") -> None:
    """What happens when a viewer drags a gizmo to a place (mm)."""
    target = SimpleNamespace(position=place / 1000.0, wxyz=gizmo.wxyz)
    for callback in gizmo._impl_aux.update_cb:
        asyncio.run(callback(SimpleNamespace(target=target, client_id=SOMEBODY, phase=phase)))


@pytest.fixture
def control() -> FakeControl:
    return FakeControl("swaying", "run-1", "paused")


@pytest.fixture
def stage(workspace: Workspace, control: FakeControl) -> Iterator[SceneStage]:
    made = SceneStage(workspace, control)
    made.show_run("swaying", "run-1")
    until(lambda: made.shown.run == "run-1" and len(editor_of(made).sliders) == 31)
    yield made
    made.stop()


def desk_of(stage: SceneStage) -> PoseDesk:
    return stage._director.posing


def editor_of(stage: SceneStage) -> PoseEditor:
    return stage._director.state._panel.pose


def pose_is(stage: SceneStage, wanted: np.ndarray) -> bool:
    editing = stage.poses.editing
    return editing is not None and np.allclose(editing.pose, wanted, atol=1e-9)


def begin(stage: SceneStage) -> None:
    """Edit the start pose, and wait until the balls are there."""
    by_hand(editor_of(stage).editing, True)
    until(lambda: stage.shown.editing and desk_of(stage)._handles is not None)


class Wishes:
    """Remembers what a tab asks for."""

    def __init__(self) -> None:
        self.asked: list[tuple] = []

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *given: self.asked.append((name, *given))


def test_the_tab_speaks_degrees_and_asks_in_radians(server: GuardedServer, human: BodyModel) -> None:
    wishes = Wishes()
    editor = PoseEditor(server.gui, server.gui.add_tab_group().add_tab("Pose"), cast("PoseWishes", wishes))
    pose = swaying_pose(human, 2)
    editor.show_body(human, pose, ("left forearm",), has_sides=True)
    assert len(editor.sliders) == 31
    knee = 9
    by_hand(editor.sliders[knee], -30.0)
    assert wishes.asked == [("ask_value", knee, pytest.approx(math.radians(-30.0)))]
    # What the scene itself shows is asked for by nobody.
    wishes.asked.clear()
    edited = EditedPose(pose)
    moved = pose.copy()
    moved[4] += 123.0
    edited.put(moved)
    editor.show(edited, editing=True, about="Start pose", grip="left forearm")
    asyncio.run_coroutine_threadsafe(asyncio.sleep(0), server.get_event_loop()).result(5)
    assert wishes.asked == []
    assert editor.sliders[4].value == pytest.approx(moved[4], abs=0.05)
    assert not editor.save.disabled
    assert editor.grip.value == "left forearm"
    by_hand(editor.grip, "none")
    assert wishes.asked == [("ask_grip", "")]


def test_undo_takes_back_what_one_hand_did_at_once() -> None:
    edited = EditedPose(np.zeros(2))
    for value in (1.0, 2.0, 3.0):
        edited.put(np.array([value, 0.0]), hand="slider")
    edited.settle()
    edited.put(np.array([4.0, 0.0]), hand="slider")
    edited.put(np.array([4.0, 5.0]), hand="other")
    found = []
    while edited.can_undo:
        edited.undo()
        found.append(edited.pose.tolist())
    assert found == [[4.0, 0.0], [3.0, 0.0], [0.0, 0.0]]
    assert not edited.is_moved
    edited.put(np.ones(2))
    edited.reset()
    edited.undo()
    assert edited.pose.tolist() == [1.0, 1.0], "a reset can be taken back"


def test_a_slider_moves_the_body_and_saving_keeps_it(
    stage: SceneStage, human: BodyModel, workspace: Workspace
) -> None:
    by_hand(editor_of(stage).sliders[9], -40.0)
    wanted = swaying_pose(human, 0)
    wanted[9] = np.deg2rad(-40.0)
    until(lambda: pose_is(stage, wanted) and stage.shown.editing)
    desk_of(stage).ask_saving()
    until(lambda: editor_of(stage).save.disabled)
    session = workspace.session("swaying")
    stored = session.start_pose(human)
    assert stored is not None
    np.testing.assert_allclose(stored, wanted, atol=1e-12)
    by_hand(editor_of(stage).sliders[9], -20.0)
    desk_of(stage).ask_saving()
    until(lambda: (session.path / "start_pose-before.csv").exists())
    by_hand(editor_of(stage).editing, False)
    until(lambda: not stage.shown.editing and stage.poses.editing is None)


def test_a_dragged_ball_takes_the_limb_along_and_only_the_newest_place_counts(
    stage: SceneStage, human: BodyModel
) -> None:
    begin(stage)
    desk = desk_of(stage)
    handles = desk._handles
    assert handles is not None
    assert all(ball.visible for ball in handles.balls)
    assert not handles.gizmo.visible
    at = Dragger(human).grip("left forearm").limb
    for callback in handles.balls[at]._impl.click_cb:
        callback.callback(cast("Any", SimpleNamespace()))
    until(lambda: handles.gizmo.visible and not handles.balls[at].visible)
    start = swaying_pose(human, 0)
    place = Dragger(human).points(start)[at]
    np.testing.assert_allclose(handles.gizmo.position, place / 1000.0, atol=1e-6)
    # The scene's thread is busy while the hand moves on: the places in between are never solved for.
    gate, solved = threading.Event(), []
    desk._post(cast("Any", lambda: gate.wait(5.0)))
    dragger = desk._dragger
    assert dragger is not None
    plain = dragger.dragged
    cast("Any", dragger).dragged = lambda *given: solved.append(given[2]) or plain(*given)
    for step in range(1, 9):
        drag(handles.gizmo, place + step * np.array([-10.0, 5.0, 12.0]))
    target = place + np.array([-90.0, 45.0, 110.0])
    drag(handles.gizmo, target, "end")
    gate.set()
    until(lambda: stage.poses.editing is not None and stage.poses.editing.moved)
    pose = stage.poses.editing.pose
    assert len(solved) == 1
    wrist = [marker.name for marker in human.markers].index("LWrist")
    assert np.linalg.norm(marker_points(human, pose)[0, wrist] - target) < 10.0
    for entry, value in zip(human.parameters, pose, strict=True):
        assert entry.lower <= value <= entry.upper
    desk.ask_change(UNDO)
    until(lambda: pose_is(stage, start))


def test_the_root_gizmo_carries_the_body(stage: SceneStage, human: BodyModel) -> None:
    begin(stage)
    handles = desk_of(stage)._handles
    assert handles is not None
    until(lambda: handles.root.visible)
    start = swaying_pose(human, 0)
    drag(handles.root, np.array(handles.root.position) * 1000.0 + [100.0, -50.0, 20.0], "end")
    until(lambda: stage.poses.editing is not None and stage.poses.editing.moved)
    pose = stage.poses.editing.pose
    gone = marker_points(human, pose)[0] - marker_points(human, start)[0]
    np.testing.assert_allclose(gone, np.tile([100.0, -50.0, 20.0], (len(gone), 1)), atol=1.0)


def test_mirror_round_and_reset(stage: SceneStage, human: BodyModel) -> None:
    begin(stage)
    desk, start = desk_of(stage), swaying_pose(human, 0)
    mirror = Mirror(human)
    desk.ask_change(MIRROR)
    until(lambda: pose_is(stage, mirror.mirrored(start)))
    desk.ask_change(RESET)
    until(lambda: pose_is(stage, start))
    desk.ask_change(ROUND)
    until(lambda: pose_is(stage, mirror.turned_round(start)))


def test_a_frame_is_corrected_from_the_pose_that_is_shown_there(stage: SceneStage, human: BodyModel) -> None:
    stage.poses.edit("swaying", "run-1", 2)
    until(lambda: stage.shown.editing and stage.shown.frame == 2)
    editing = stage.poses.editing
    assert editing is not None
    assert (editing.session, editing.run, editing.frame, editing.moved) == ("swaying", "run-1", 2, False)
    assert pose_is(stage, swaying_pose(human, 2))
    wanted = swaying_pose(human, 3)
    stage.poses.edit("swaying", "run-1", 2, wanted.tolist())
    until(lambda: pose_is(stage, wanted))
    assert stage.poses.editing is not None
    assert stage.poses.editing.moved
    stage.poses.leave()
    until(lambda: not stage.shown.editing)
    stage.poses.edit("swaying")
    until(lambda: stage.poses.editing is not None and stage.poses.editing.frame is None)
    assert stage.poses.editing is not None
    assert stage.poses.editing.run == ""


def test_the_editing_ends_when_the_run_is_tracked_or_another_is_opened(
    stage: SceneStage, control: FakeControl
) -> None:
    stage.poses.edit("swaying", "run-1", 2)
    until(lambda: stage.shown.editing and stage.shown.frame == 2)
    paused = control.state
    control.say(dataclasses.replace(paused, run="run-9", state="tracking"))
    control.say(paused)
    desk_of(stage).ask_value(4, 250.0)
    until(lambda: stage.poses.editing is not None and stage.poses.editing.moved)
    control.say(dataclasses.replace(paused, state="tracking"))
    until(lambda: not stage.shown.editing)
    assert stage.poses.editing is None
    handles = desk_of(stage)._handles
    assert handles is not None
    assert not any(ball.visible for ball in handles.balls)
    # Whoever begins to edit while it goes on is left to it.
    stage.poses.edit("swaying", "run-1", 1)
    until(lambda: stage.shown.editing)
    control.say(dataclasses.replace(paused, state="tracking", frame=3))
    stage.show_layer(1)
    until(lambda: stage.shown.layer == 1)
    assert stage.shown.editing
    stage.show_run("swaying")
    until(lambda: stage.shown.run == "" and not stage.shown.editing)


def test_refining_tells_shows_and_can_fail(
    stage: SceneStage, human: BodyModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin(stage)
    better = swaying_pose(human, 1)
    asked: list[int] = []

    def found(session, frame, pose, *, run, progress, cancelled):
        asked.append(frame)
        progress("searching", 1, 2)
        return SimpleNamespace(pose=better, gain=1.0, overlap_before=0.5, overlap=0.9)

    monkeypatch.setattr(pose_refining, "better_pose", found)
    desk_of(stage).ask_refinement()
    until(lambda: pose_is(stage, better))
    assert asked == [stage.shown.frame]
    until(lambda: not editor_of(stage).progress.visible)

    def refused(*_: object, **__: object) -> None:
        raise StudioError("Nothing is to be seen.", "Choose another frame.")

    problems: list[StudioError] = []
    monkeypatch.setattr(pose_refining, "better_pose", refused)
    desk_of(stage)._refused = problems.append
    desk_of(stage).ask_refinement()
    until(lambda: problems)
    assert problems[0].message == "Nothing is to be seen."
    assert pose_is(stage, better)
