"""BVH read by two other readers: bvhsdk, and the strict one with which recordings are read."""

import contextlib
import io
from pathlib import Path

import bvhsdk
import numpy as np
import pytest
from export_runs import FRAMES, MADE, moving_poses, track_of

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames
from studio.body.motion_files.bvh import read_bvh
from studio.body.motion_files.recorded_motion import followed
from studio.results.export.bvh_writing import smooth_angles
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.results.export.options import Axes
from studio.results.export.skeleton import Skeleton, skeleton_of

BVH = FORMATS["bvh"]
LEAST_MM, LEAST_DEGREES = 0.1, 0.01
FROM_Y_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def meant(body_name: str, rest: str = "tpose") -> tuple[Skeleton, np.ndarray, np.ndarray]:
    """The skeleton and where its joints are meant to be, mm, z up, of the fixture's motion."""
    body = load_body(body_name)
    skeleton = skeleton_of(body, rest)
    return skeleton, *followed(skeleton.tree.parents, *skeleton.animated(moving_poses(body)))


def angle_between(one: np.ndarray, other: np.ndarray) -> float:
    """Degrees, from the quaternion's vector part: exact for small angles."""
    relative = one.swapaxes(-1, -2) @ other
    across = np.stack([relative[..., 2, 1] - relative[..., 1, 2], relative[..., 0, 2] - relative[..., 2, 0],
                       relative[..., 1, 0] - relative[..., 0, 1]], axis=-1)  # fmt: skip
    return float(np.degrees(np.arcsin(np.linalg.norm(across, axis=-1) / 2.0)).max())


def seen_by_bvhsdk(path: Path, names: tuple[str, ...], rows: range) -> tuple[np.ndarray, np.ndarray]:
    """Places and turns of joints in some rows, in the file's axes and unit."""
    with contextlib.redirect_stdout(io.StringIO()):
        read = bvhsdk.ReadFile(str(path))
    joints = {joint.name: joint for joint in read.getlistofjoints()}
    with contextlib.redirect_stdout(io.StringIO()):
        found = np.array([[joints[name].getGlobalTransform(row) for name in names] for row in rows])
    return found[..., :3, 3], found[..., :3, :3]


@pytest.mark.parametrize("name", ["human31", "human29", "human34", "dog", "branched_arms6"])
def test_bvhsdk_sees_the_same_joints(make_run, tmp_path: Path, name: str) -> None:
    session, run = make_run(name, lambda body: track_of(moving_poses(body)))
    report = export_run(session, run, BVH, {"track": MADE}, tmp_path / "walk.bvh")
    assert report.frames == FRAMES
    skeleton, places, turns = meant(name)
    rows = range(0, FRAMES, 9)
    seen, turned = seen_by_bvhsdk(report.files[0], skeleton.names, rows)
    world = seen @ FROM_Y_UP.T * 1000.0
    assert np.linalg.norm(world - places[rows], axis=-1).max() < LEAST_MM
    assert angle_between(FROM_Y_UP @ turned @ FROM_Y_UP.T, turns[rows]) < LEAST_DEGREES


@pytest.mark.parametrize(("unit", "mm"), [("m", 1000.0), ("cm", 10.0), ("mm", 1.0)])
@pytest.mark.parametrize("order", ["ZXY", "XYZ", "YZX"])
def test_every_frame_is_read_as_recordings_are(
    make_run, tmp_path: Path, unit: str, mm: float, order: str
) -> None:
    """All 450 frames; the other reader knows every order of axes and turns y up into its own z up."""
    session, run = make_run("human29", lambda body: track_of(moving_poses(body)))
    requested = {"track": MADE, "unit": unit, "euler": order}
    report = export_run(session, run, BVH, requested, tmp_path / "walk.bvh")
    skeleton, places, _ = meant("human29")
    read = read_bvh(report.files[0], unit_mm=mm)
    assert read.fps == pytest.approx(60.0, abs=1e-3)
    columns = [read.names.index(name) for name in skeleton.names]
    assert len(read.positions) == FRAMES
    assert np.linalg.norm(read.positions[:, columns] - places, axis=-1).max() < LEAST_MM


def test_z_up_and_other_names(make_run, tmp_path: Path) -> None:
    session, run = make_run("human34", lambda body: track_of(moving_poses(body)))
    requested = {"track": MADE, "up": "z", "names": "mixamo", "unit": "cm"}
    report = export_run(session, run, BVH, requested, tmp_path / "walk.bvh")
    _, places, _ = meant("human34")
    seen, _ = seen_by_bvhsdk(report.files[0], ("Hips", "LeftForeArm", "RightFoot"), range(0, FRAMES, 50))
    skeleton = skeleton_of(load_body("human34"))
    columns = [skeleton.names.index(name) for name in ("pelvis", "left_forearm", "right_foot")]
    assert np.linalg.norm(10.0 * seen - places[::50][:, columns], axis=-1).max() < LEAST_MM


def test_end_sites_are_at_the_tips(make_run, tmp_path: Path) -> None:
    """The file's own end sites lead to the far ends of the limbs: fingertips and toes."""
    session, run = make_run("human29", lambda body: track_of(moving_poses(body)))
    report = export_run(session, run, BVH, {"track": MADE}, tmp_path / "walk.bvh")
    read = read_bvh(report.files[0], unit_mm=1000.0)
    body = load_body("human29")
    poses = moving_poses(body)
    frames = joint_frames(body, poses)
    for limb in body.drawn:
        name = body.joints[limb.joint].name
        if f"{name}_end" not in read.names:
            continue
        tip = frames[:, limb.joint, :, 3] + limb.length * frames[:, limb.joint, :, 2]
        seen = read.positions[:, read.names.index(f"{name}_end")]
        assert np.linalg.norm(seen - tip, axis=-1).max() < LEAST_MM, limb.name


def test_a_gap_is_interpolated_and_reported(make_run, tmp_path: Path) -> None:
    """Twenty frames lost in the middle: their rotations lie between those at the ends, and the report says so."""
    states = tuple("lost" if 100 <= frame < 120 else "tracked" for frame in range(FRAMES))
    session, run = make_run("planar_arm4", lambda body: track_of(moving_poses(body), states=states))
    report = export_run(session, run, BVH, {"track": MADE}, tmp_path / "arm.bvh")
    assert any("20 of 450 frames are interpolated" in note for note in report.notes)
    skeleton, places, _ = meant("planar_arm4")
    read = read_bvh(report.files[0], unit_mm=1000.0).positions
    tip = skeleton.names.index("link_4")
    assert np.linalg.norm(read[:100, tip] - places[:100, tip], axis=-1).max() < LEAST_MM
    body = load_body("planar_arm4")
    ends = moving_poses(body)[[99, 120]]
    share = np.linspace(0.0, 1.0, 22)[1:-1, None]
    between = joint_frames(body, (1.0 - share) * ends[0] + share * ends[1])[:, 3, :, 3]
    assert np.linalg.norm(read[100:120, tip] - between, axis=-1).max() < LEAST_MM
    kept = export_run(session, run, BVH, {"track": MADE, "lost": "keep"}, tmp_path / "kept.bvh")
    assert (
        np.linalg.norm(
            read_bvh(kept.files[0], unit_mm=1000.0).positions[:, tip] - places[:, tip], axis=-1
        ).max()
        < LEAST_MM
    )


def test_angles_do_not_jump() -> None:
    """A joint that turns on and on through every quadrant has no step larger than its turn, and the same rotations."""
    turn = np.linspace(0.0, 20.0, 800)
    rotations = Axes("m", "y").turns(
        np.stack(
            [
                np.cos(turn),
                -np.sin(turn),
                0 * turn,
                np.sin(turn),
                np.cos(turn),
                0 * turn,
                0 * turn,
                0 * turn,
                1 + 0 * turn,
            ],
            axis=-1,
        ).reshape(-1, 1, 3, 3)
    )
    angles = smooth_angles(rotations, "ZXY")
    assert np.abs(np.diff(angles, axis=0)).max() < 2.0
    assert np.abs(angles).max() > 360.0
