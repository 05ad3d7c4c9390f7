"""A pose under a person's hands: sliders, balls, gizmos, undo, mirror, the search around it, saving."""

import dataclasses
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scene_fakes import FakeControl, by_hand, drag, press
from swaying_session import swaying_pose
from waiting import until

from studio.app.scene import pose_refining
from studio.app.scene.pose_edit import UNDO
from studio.app.scene.pose_handles import PoseHandles
from studio.app.scene.pose_panel import PosePanel
from studio.app.scene.scene_server import SceneServer
from studio.body.dragging import Dragger
from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.foundations.errors import StudioError
from studio.operations.jobs.events import RunState
from studio.sessions.workspace import Workspace


@pytest.fixture
def stage(workspace: Workspace, control: FakeControl) -> Iterator[SceneServer]:
    made = SceneServer(workspace, control)
    made.show_run("swaying", "run-1")
    until(lambda: made.shown.run == "run-1" and len(tab_of(made).sliders) == 31)
    yield made
    made.stop()


def tab_of(stage: SceneServer) -> PosePanel:
    return stage._controller.panel.pose


def handles_of(stage: SceneServer) -> PoseHandles:
    found = stage._controller.handles
    assert found is not None
    return found


def pose_is(stage: SceneServer, wanted: np.ndarray) -> bool:
    editing = stage.poses.editing
    return editing is not None and np.allclose(editing.pose, wanted, atol=1e-9)


def begin(stage: SceneServer) -> None:
    """Edit the start pose, and wait until the balls are there."""
    by_hand(tab_of(stage).editing.handle, True)
    until(lambda: stage.shown.editing and all(ball.visible for ball in handles_of(stage).balls))


def test_a_slider_moves_the_body_and_saving_keeps_it(
    stage: SceneServer, human: BodyModel, workspace: Workspace
) -> None:
    by_hand(tab_of(stage).sliders[9].handle, -40.0)
    wanted = swaying_pose(human, 0)
    wanted[9] = np.deg2rad(-40.0)
    until(lambda: pose_is(stage, wanted) and stage.shown.editing)
    until(lambda: not tab_of(stage).save.disabled)
    press(tab_of(stage).save)
    until(lambda: tab_of(stage).save.disabled)
    session = workspace.session("swaying")
    stored = session.start_pose(human)
    assert stored is not None
    np.testing.assert_allclose(stored, wanted, atol=1e-12)
    by_hand(tab_of(stage).sliders[9].handle, -20.0)
    press(tab_of(stage).save)
    until(lambda: (session.path / "start_pose-before.csv").exists())
    by_hand(tab_of(stage).editing.handle, False)
    until(lambda: not stage.shown.editing and stage.poses.editing is None)


def test_a_dragged_ball_takes_the_limb_along_and_only_the_newest_place_counts(
    stage: SceneServer, human: BodyModel
) -> None:
    begin(stage)
    handles = handles_of(stage)
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
    stage._controller.post(lambda model: (gate.wait(5.0), model)[1])
    subject = stage._controller.model.subject
    plain = subject.dragger.dragged
    cast("Any", subject.dragger).dragged = lambda *given: solved.append(given[2]) or plain(*given)
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
    press(tab_of(stage).back, UNDO)
    until(lambda: pose_is(stage, start))


def test_the_root_gizmo_carries_the_body(stage: SceneServer, human: BodyModel) -> None:
    begin(stage)
    root = handles_of(stage).root
    until(lambda: root.visible)
    start = swaying_pose(human, 0)
    drag(root, np.array(root.position) * 1000.0 + [100.0, -50.0, 20.0], "end")
    until(lambda: stage.poses.editing is not None and stage.poses.editing.moved)
    pose = stage.poses.editing.pose
    gone = marker_points(human, pose)[0] - marker_points(human, start)[0]
    np.testing.assert_allclose(gone, np.tile([100.0, -50.0, 20.0], (len(gone), 1)), atol=1.0)


def test_a_frame_is_corrected_from_the_pose_that_is_shown_there(stage: SceneServer, human: BodyModel) -> None:
    stage.poses.edit("swaying", "run-1", 2)
    until(lambda: stage.shown.editing and stage.shown.frame == 2)
    editing = stage.poses.editing
    assert (editing.session, editing.run, editing.frame, editing.moved) == ("swaying", "run-1", 2, False)
    assert pose_is(stage, swaying_pose(human, 2))
    wanted = swaying_pose(human, 3)
    stage.poses.edit("swaying", "run-1", 2, wanted.tolist())
    until(lambda: pose_is(stage, wanted))
    assert stage.poses.editing.moved
    stage.poses.leave()
    until(lambda: not stage.shown.editing)
    stage.poses.edit("swaying")
    until(lambda: stage.poses.editing is not None and stage.poses.editing.frame is None)
    assert stage.poses.editing.run == ""


def test_the_editing_ends_when_the_run_is_tracked_or_another_is_opened(
    stage: SceneServer, control: FakeControl
) -> None:
    stage.poses.edit("swaying", "run-1", 2)
    until(lambda: stage.shown.editing and stage.shown.frame == 2)
    paused = control.state
    control.emit(dataclasses.replace(paused, run="run-9", state=RunState.TRACKING))
    control.emit(paused)
    by_hand(tab_of(stage).sliders[4].handle, 250.0)
    until(lambda: stage.poses.editing is not None and stage.poses.editing.moved)
    control.emit(dataclasses.replace(paused, state=RunState.TRACKING))
    until(lambda: not stage.shown.editing)
    assert stage.poses.editing is None
    handles = handles_of(stage)
    until(lambda: not any(ball.visible for ball in handles.balls))
    # Whoever begins to edit while it goes on is left to it.
    stage.poses.edit("swaying", "run-1", 1)
    until(lambda: stage.shown.editing)
    control.emit(dataclasses.replace(paused, state=RunState.TRACKING, frame=3))
    stage.show_layer(1)
    until(lambda: stage.shown.layer == 1)
    assert stage.shown.editing
    stage.show_run("swaying")
    until(lambda: stage.shown.run == "" and not stage.shown.editing)


def test_refining_reports_shows_and_can_fail(
    stage: SceneServer, human: BodyModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin(stage)
    better = swaying_pose(human, 1)
    requested: list[int] = []

    def found(session, search, progress):
        requested.append(search.frame)
        progress("searching", 1, 2)
        return SimpleNamespace(pose=better, gain=1.0, overlap_before=0.5, overlap=0.9)

    monkeypatch.setattr(pose_refining, "improve_pose", found)
    press(tab_of(stage).refine)
    until(lambda: pose_is(stage, better))
    assert requested == [stage.shown.frame]
    until(lambda: not tab_of(stage).progress.visible)

    def refused(*_: object, **__: object) -> None:
        raise StudioError("Nothing is to be seen.", "Choose another frame.")

    problems: list[StudioError] = []
    monkeypatch.setattr(pose_refining, "improve_pose", refused)
    stage._controller.refused = problems.append
    press(tab_of(stage).refine)
    until(lambda: problems)
    assert problems[0].message == "Nothing is to be seen."
    assert pose_is(stage, better)
