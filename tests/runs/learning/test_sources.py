"""Every kind of source on a body: known motion, read back from files and runs."""

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pytest
from moving_bodies import c3d_of, swinging, write_c3d
from store_records import record_of, result_of

from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.foundations.errors import BodyError, StudioError
from studio.results.motion_sources import expand, read_source, recipe_recording
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

BODY = load_body("human25")
FPS = 30.0


def apart(body: BodyModel, one: np.ndarray, other: np.ndarray) -> float:
    """RMS distance of the markers of two motions, each about its pelvis and heading, mm."""
    names = [entry.name for entry in body.parameters]
    clean = []
    for poses in (one, other):
        still = poses.copy()
        still[:, :6] = body.neutral[:6]
        clean.append(marker_points(body, still))
    assert names[:3] == ["pelvis_x", "pelvis_y", "pelvis_z"]
    return float(np.sqrt(((clean[0] - clean[1]) ** 2).sum(axis=2).mean()))


@pytest.mark.parametrize("size", [1.0, 1.12])
def test_angles_follow_from_points_of_a_person_of_any_size(tmp_path: Path, size: float) -> None:
    lengths = {name: size * value for name, value in BODY.dimensions.items() if not name.startswith("scale")}
    person = with_dimensions(BODY, lengths)
    poses = swinging(BODY, 161, 120.0)
    found = read_source(c3d_of(tmp_path / "wave.c3d", person, poses, 120.0, "Jane:"), BODY)
    assert (found.name, found.fps, found.frame_count) == ("wave", 30.0, 41)
    assert found.rms_mm < 6.0
    assert found.bad_frames == ()
    assert apart(BODY, found.poses, poses[::4]) < 12.0


def test_a_trc_at_another_rate_in_metres(tmp_path: Path) -> None:
    poses = swinging(BODY, 101, 100.0)
    names = tuple(marker.name for marker in BODY.markers)
    motion = MarkerMotion(names, np.arange(101) / 100.0, marker_points(BODY, poses), unit="m", rate=100.0)
    write_trc(tmp_path / "wave.trc", motion)
    steps: list[tuple[str, int, int]] = []
    found = read_source(tmp_path / "wave.trc", BODY, fps=20.0, progress=lambda *step: steps.append(step))
    assert found.frame_count == 21
    assert apart(BODY, found.poses, poses[::5]) < 12.0
    assert steps


def write_run(session: Session, body: BodyModel, poses: np.ndarray, frames: range) -> None:
    """A stored run "known" of a body along poses, at 60 frames a second."""
    record = msgspec.structs.replace(
        record_of(session, "known"),
        body=body.name,
        dimensions=dict(body.dimensions),
        parameters=tuple(entry.name for entry in body.parameters),
        sigma=(),
        last=frames.stop,
    )
    run = session.new_run(record)
    with ResultsWriter(run.folder) as writer:
        for frame in frames:
            made = result_of(frame, size=len(body.parameters))
            pose = poses[frame]
            writer.write_frame(
                dataclasses.replace(made, estimate=dataclasses.replace(made.estimate, pose=pose)), []
            )


def test_a_run_of_the_same_body_is_used_unchanged(session_on_disk: Session) -> None:
    poses = swinging(BODY, 41, 60.0)
    write_run(session_on_disk, BODY, poses, range(41))
    found = read_source("toy/known", BODY)
    np.testing.assert_allclose(found.poses, poses[::2], atol=1e-6)
    assert (found.name, found.rms_mm) == ("toy/known", 0.0)
    folder = session_on_disk.path / "runs" / "known"
    np.testing.assert_array_equal(read_source(folder, BODY).poses, found.poses)
    assert expand(folder) == (str(folder),)
    with pytest.raises(StudioError, match=r"'toy' is a session") as refusal:
        expand(session_on_disk.path)
    assert "toy/known" in refusal.value.hint


def test_a_run_of_another_body_goes_through_its_markers(session_on_disk: Session) -> None:
    other = load_body("human31")
    poses = swinging(other, 31, 60.0)
    write_run(session_on_disk, other, poses, range(31))
    found = read_source("toy/known", BODY, workspace=Workspace())
    assert found.frame_count == 16
    assert 0.0 < found.rms_mm < 60.0
    theirs = marker_points(other, poses[::2])
    names = [marker.name for marker in other.markers]
    mine = marker_points(BODY, found.poses)
    at = [marker.name for marker in BODY.markers]

    def bend(points: np.ndarray, labels: list[str]) -> np.ndarray:
        knee = points[:, labels.index("LKnee")]
        up = points[:, labels.index("LHip")] - knee
        down = points[:, labels.index("LAnkle")] - knee
        sizes = np.linalg.norm(up, axis=1) * np.linalg.norm(down, axis=1)
        return np.degrees(np.arccos((up * down).sum(axis=1) / sizes))

    assert np.abs(bend(theirs, names) - bend(mine, at)).max() < 15.0


def test_a_recipes_motion_needs_no_rendering() -> None:
    found = recipe_recording("walk", BODY, frames=60)
    assert found.frame_count == 30
    assert found.rms_mm < 30.0
    slower = recipe_recording("walk", BODY, frames=60, options={"speed_mm_s": 500.0})
    way = [np.linalg.norm(np.diff(entry.poses[:, :2], axis=0), axis=1).sum() for entry in (found, slower)]
    assert way[1] < 0.7 * way[0]
    with pytest.raises(StudioError, match="moves no person"):
        read_source("planar_arm", BODY)


def test_a_folder_is_its_motion_files(tmp_path: Path) -> None:
    for name in ("b.c3d", "a.BVH", "notes.txt", "05.asf"):
        (tmp_path / name).write_text("")
    assert [Path(name).name for name in expand(tmp_path)] == ["a.BVH", "b.c3d"]
    (tmp_path / "none").mkdir()
    with pytest.raises(StudioError, match="holds no motion"):
        expand(tmp_path / "none")
    assert expand("toy/known") == ("toy/known",)


def test_unreadable_sources_are_named(tmp_path: Path, session_on_disk: Session) -> None:
    points = marker_points(BODY, swinging(BODY, 20, 120.0))
    labels = [marker.name for marker in BODY.markers]
    cases = {
        "short.c3d": "5 frames at 30",
        "labels.c3d": r"no points for RHip.*\*0, \*1",
        "broken.c3d": "not a C3D file",
        "words.txt": "not a motion that can be read",
        "lonely_01.amc": "'lonely.asf', is missing",
        "empty.bvh": "has no MOTION",
    }
    write_c3d(tmp_path / "short.c3d", labels, points, 120.0)
    write_c3d(tmp_path / "labels.c3d", [f"*{number}" for number in range(15)], points, 30.0)
    (tmp_path / "broken.c3d").write_bytes(b"\x02\x50" + b"x" * 600)
    (tmp_path / "words.txt").write_text("walk")
    (tmp_path / "lonely_01.amc").write_text("1\n")
    (tmp_path / "empty.bvh").write_text("HIERARCHY\n")
    for name, words in cases.items():
        with pytest.raises(StudioError, match=words) as refusal:
            read_source(tmp_path / name, BODY)
        assert refusal.value.hint
    for name in ("toy/none", "nowhere", "nothing/none", str(tmp_path / "gone.amc")):
        with pytest.raises(StudioError, match=Path(name).name):
            read_source(name, BODY)
    write_c3d(tmp_path / "fine.c3d", labels, points, 30.0)
    with pytest.raises(BodyError, match="'dog' has no marker"):
        read_source(tmp_path / "fine.c3d", load_body("dog"))


@pytest.mark.slow
@pytest.mark.real_data
def test_a_dance_clip_on_several_bodies(real_data: Path) -> None:
    path = real_data / "cmu-motion" / "05_03.amc"
    for name, most in (("human25", 30.0), ("human31", 22.0)):
        body = load_body(name)
        found = read_source(path, body)
        assert found.frame_count == 109
        assert found.rms_mm < most
        angles = np.array([entry.kind == "angle" for entry in body.parameters])
        assert np.degrees(np.abs(np.diff(found.poses[:, angles], axis=0)).max()) < 75.0


def test_a_skeleton_with_unknown_names_is_fitted_by_its_joints(tmp_path: Path) -> None:
    """A BVH as exported from a game character: no finger or toe joints, its own unit."""
    tree = """HIERARCHY
ROOT mixamorig:Hips
{
OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
"""
    for side, sign in (("Left", 1), ("Right", -1)):
        tree += f"JOINT mixamorig:{side}UpLeg\n{{\nOFFSET {9 * sign} 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        tree += f"JOINT mixamorig:{side}Leg\n{{\nOFFSET 0 -43 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        tree += f"JOINT mixamorig:{side}Foot\n{{\nOFFSET 0 -43 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        tree += "End Site\n{\nOFFSET 0 0 10\n}\n}\n}\n}\n"
    for side, sign in (("Left", 1), ("Right", -1)):
        tree += f"JOINT mixamorig:{side}Arm\n{{\nOFFSET {20 * sign} 50 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        tree += (
            f"JOINT mixamorig:{side}ForeArm\n{{\nOFFSET 0 -32 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        )
        tree += f"JOINT mixamorig:{side}Hand\n{{\nOFFSET 0 -25 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        tree += "End Site\n{\nOFFSET 0 -10 0\n}\n}\n}\n}\n"
    count = 40
    lines = []
    for frame in range(count):
        bend = 40.0 + 30.0 * np.sin(0.2 * frame)
        row = np.zeros(6 + 12 * 3)
        row[1] = 90.0
        row[6 + 1], row[9 + 1] = -0.5 * bend, bend
        lines.append(" ".join(f"{value:.4f}" for value in row))
    text = f"{tree}}}\nMOTION\nFrames: {count}\nFrame Time: 0.0333333\n" + "\n".join(lines) + "\n"
    path = tmp_path / "character.bvh"
    path.write_text(text)
    found = read_source(path, BODY)
    assert found.frame_count == count
    assert found.rms_mm < 15.0
    names = [entry.name for entry in BODY.parameters]
    wanted = 40.0 + 30.0 * np.sin(0.2 * np.arange(count))
    knees = np.degrees(found.poses[:, [names.index("left_knee"), names.index("right_knee")]])
    np.testing.assert_allclose(knees[:, 0], wanted, atol=6.0)
    assert np.abs(knees[:, 1]).max() < 8.0
