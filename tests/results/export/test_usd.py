"""USD taken apart attribute by attribute, without the library's own skeleton queries."""

from pathlib import Path

import numpy as np
import pytest
from export_runs import FRAMES, MADE, moving_poses, track_of
from pxr import Usd, UsdGeom, UsdSkel
from scipy.spatial.transform import Rotation

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_frames
from studio.body.motion_files.recorded_motion import followed
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.results.export.skeleton import skeleton_of

FROM_Y_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
LEAST_MM = 0.1


def worlds_of(stage: Usd.Stage, time: float) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Turn (3, 3) and place (3,) of every joint in the file's world, from the animation's own attributes."""
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/body/skeleton/motion"))
    joints = list(motion.GetJointsAttr().Get())
    moves = np.array(motion.GetTranslationsAttr().Get(time))
    found: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for joint, move, turn in zip(joints, moves, motion.GetRotationsAttr().Get(time), strict=True):
        local = Rotation.from_quat([*turn.GetImaginary(), turn.GetReal()]).as_matrix()
        above, at = found.get(joint.rpartition("/")[0], (np.eye(3), np.zeros(3)))
        found[joint] = above @ local, at + above @ move
    return found


@pytest.mark.parametrize("name", ["human31", "branched_arms6"])
def test_joints_and_cones_are_where_they_are_meant(make_run, tmp_path: Path, name: str) -> None:
    session, run = make_run(name, lambda body: track_of(moving_poses(body)))
    report = export_run(session, run, FORMATS["usd"], {"track": MADE}, tmp_path / "walk.usd")
    assert "read back" in report.checked
    stage = Usd.Stage.Open(str(report.files[0]))
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Y", 1.0)
    assert (stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()) == (60.0, FRAMES - 1)
    assert stage.GetDefaultPrim().GetCustomDataByKey("source")["body"] == name
    body = load_body(name)
    skeleton = skeleton_of(body)
    places, _ = followed(skeleton.tree.parents, *skeleton.animated(moving_poses(body)))
    frames = limb_frames(body, moving_poses(body))
    prim = UsdSkel.Skeleton(stage.GetPrimAtPath("/body/skeleton"))
    joints = list(prim.GetJointsAttr().Get())
    bound = np.array(prim.GetBindTransformsAttr().Get())
    meshes = [UsdGeom.Mesh(found) for found in stage.Traverse() if found.IsA(UsdGeom.Mesh)]
    for row in range(0, FRAMES, 75):
        worlds = worlds_of(stage, row)
        for at, joint in enumerate(joints):
            assert np.linalg.norm(1000.0 * FROM_Y_UP @ worlds[joint][1] - places[row, at]) < LEAST_MM
        skinned = []
        for mesh in meshes:
            points = np.array(mesh.GetPointsAttr().Get())
            carried = UsdSkel.BindingAPI(mesh).GetJointIndicesPrimvar().Get()
            for point, joint in zip(points, carried, strict=True):
                turn, place = worlds[joints[joint]]
                skinned.append(1000.0 * FROM_Y_UP @ (place + turn @ (point - bound[joint][3, :3])))
        # Every limb's ends lie in the mesh: the hubs of its two caps.
        for limb, frame in zip(body.drawn, frames[row], strict=True):
            for end in (np.zeros(3), np.array([0.0, 0.0, limb.length])):
                hub = frame[:, :3] @ end + frame[:, 3]
                assert np.linalg.norm(np.array(skinned) - hub, axis=1).min() < LEAST_MM


def test_what_has_no_pose_is_said(make_run, tmp_path: Path) -> None:
    states = tuple("no evidence" if frame in range(3, 5) else "tracked" for frame in range(FRAMES))
    session, run = make_run("human31", lambda body: track_of(moving_poses(body), states=states))
    report = export_run(
        session, run, FORMATS["usd"], {"track": MADE, "last": 12, "names": "mixamo"}, tmp_path / "a.usd"
    )
    stage = Usd.Stage.Open(str(report.files[0]))
    assert stage.GetDefaultPrim().GetCustomDataByKey("gaps") == "3 to 4"
    assert any("2 of 12 frames are interpolated" in note for note in report.notes)
    prim = UsdSkel.Skeleton(stage.GetPrimAtPath("/body/skeleton"))
    assert "mixamorig:Hips" in list(prim.GetJointNamesAttr().Get()) or "Hips" in prim.GetJointsAttr().Get()[0]
