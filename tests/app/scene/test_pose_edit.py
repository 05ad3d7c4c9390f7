"""A pose under edit as a value: undo, reset, going on, mirroring, dragging."""

import numpy as np
import pytest
from swaying_session import swaying_pose

from studio.app.scene import pose_edit
from studio.app.scene.pose_edit import MIRROR, RESET, ROUND, UNDO, PoseEdit
from studio.body.dragging import Dragger
from studio.body.forward_kinematics import marker_points
from studio.body.mirroring import Mirror
from studio.body.model import BodyModel


def start() -> PoseEdit:
    return pose_edit.edit_of(np.zeros(2))


def undone(edit: PoseEdit) -> PoseEdit:
    return pose_edit.changed_whole(edit, UNDO, None)


def test_undo_takes_back_what_one_source_did_at_once() -> None:
    edit = start()
    for value in (1.0, 2.0, 3.0):
        edit = pose_edit.entry_moved(edit, 0, value)
    edit = pose_edit.moved(edit, np.array([4.0, 0.0]))
    edit = pose_edit.entry_moved(edit, 1, 5.0)
    found = []
    while edit.past:
        edit = undone(edit)
        found.append(edit.pose.tolist())
    assert found == [[4.0, 0.0], [3.0, 0.0], [0.0, 0.0]]
    assert not edit.is_moved
    assert undone(edit).pose.tolist() == [0.0, 0.0]
    edit = pose_edit.changed_whole(pose_edit.moved(edit, np.ones(2)), RESET, None)
    assert edit.pose.tolist() == [0.0, 0.0]
    assert undone(edit).pose.tolist() == [1.0, 1.0], "a reset can be taken back"


def test_only_the_last_changes_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pose_edit, "REMEMBERED", 3)
    edit = start()
    for value in range(1, 9):
        edit = pose_edit.moved(edit, np.full(2, float(value)))
    assert [pose[0] for pose in edit.past] == [5.0, 6.0, 7.0]


def test_a_correction_restarts_and_the_start_pose_can_be_restored() -> None:
    edit = pose_edit.begun(pose_edit.entry_moved(start(), 0, 1.0))
    assert edit.pose.tolist() == [1.0, 0.0], "what was edited before is gone on with"
    corrected = pose_edit.begun(edit, np.full(2, 7.0), 3)
    assert (corrected.frame, corrected.is_moved) == (3, False)
    further = pose_edit.begun(corrected, np.full(2, 8.0), 3)
    assert (further.is_moved, undone(further).pose.tolist()) == (True, [7.0, 7.0])
    back = pose_edit.begun(pose_edit.ended(further))
    assert (back.frame, back.active, back.pose.tolist()) == (None, True, [0.0, 0.0])
    kept = pose_edit.begun(pose_edit.saved(pose_edit.moved(back, np.full(2, 2.0))), np.full(2, 9.0), 1)
    assert pose_edit.begun(kept).pose.tolist() == [2.0, 2.0], "the start pose is the one that was saved"


def test_a_found_pose_is_marked_until_the_editing_ends() -> None:
    edit = pose_edit.begun(start(), np.ones(2), confidence="confidence 92 %")
    assert edit.confidence == "confidence 92 %"
    assert pose_edit.ended(edit).confidence == ""


def test_mirror_and_round(human: BodyModel) -> None:
    pose, mirror = swaying_pose(human, 0), Mirror(human)
    edit = pose_edit.edit_of(pose)
    for change, wanted in ((MIRROR, mirror.mirrored(pose)), (ROUND, mirror.turned_round(pose))):
        np.testing.assert_array_equal(pose_edit.changed_whole(edit, change, mirror).pose, wanted)
    assert pose_edit.changed_whole(edit, MIRROR, None).pose is pose


def test_a_drag_is_one_change_and_moves_limb_or_root(human: BodyModel) -> None:
    dragger, pose = Dragger(human), swaying_pose(human, 0)
    grip = dragger.grip("left forearm")
    place = dragger.points(pose)[grip.limb]
    target = place + np.array([-90.0, 45.0, 110.0])
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    edit = pose_edit.dragged(
        pose_edit.edit_of(pose), dragger, grip.name, (place + target) / 2.0, turn, is_last=False
    )
    assert edit.held == grip.name
    edit = pose_edit.dragged(edit, dragger, grip.name, target, turn, is_last=True)
    assert (edit.held, len(edit.past)) == (None, 1)
    wrist = [marker.name for marker in human.markers].index("LWrist")
    assert np.linalg.norm(marker_points(human, edit.pose)[0, wrist] - target) < 10.0
    for entry, value in zip(human.parameters, edit.pose, strict=True):
        assert entry.lower <= value <= entry.upper
    np.testing.assert_array_equal(undone(edit).pose, pose)
    root = dragger.root_frame(pose)
    wxyz = pose_edit.Rotation.from_matrix(root[:, :3]).as_quat(scalar_first=True)
    carried = pose_edit.dragged(
        pose_edit.edit_of(pose), dragger, "", root[:, 3] + [100.0, -50.0, 20.0], wxyz, is_last=True
    )
    gone = marker_points(human, carried.pose)[0] - marker_points(human, pose)[0]
    np.testing.assert_allclose(gone, np.tile([100.0, -50.0, 20.0], (len(gone), 1)), atol=1.0)
