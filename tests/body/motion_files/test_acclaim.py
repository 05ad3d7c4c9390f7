"""ASF and AMC: tiny ones written here against scipy's rotations, broken ones, and CMU's own."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.body.motion_files.acclaim import read_acclaim
from studio.foundations.errors import StudioError

CMU_UNIT = 0.0254 / 0.45 * 1000.0
SKELETON = """# a leg of two bones
:version 1.10
:units
  length 0.5
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name thigh
     direction 0.6 -0.8 0
     length 2
     axis 10 20 30 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 2
     name shin
     direction 0 -1 0
     length 3
     axis 0 0 20 XYZ
    dof rx
    limits (-10.0 170.0)
  end
:hierarchy
  begin
    root thigh
    thigh shin
  end
"""
FRAMES = """#!OML:ASF
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 10 20 30
thigh 5 15 25
shin 40
2
root 0 0 0 0 0 0
thigh 0 0 0
shin 0
"""


def files(folder: Path, skeleton: str = SKELETON, frames: str = FRAMES) -> Path:
    (folder / "07.asf").write_text(skeleton)
    (folder / "07_01.amc").write_text(frames)
    return folder / "07_01.amc"


def fixed(*angles: float) -> Rotation:
    """About fixed x, then y, then z."""
    return Rotation.from_euler("xyz", angles, degrees=True)


def test_a_small_leg_stands_where_scipy_puts_it(tmp_path: Path) -> None:
    motion = read_acclaim(files(tmp_path))
    assert motion.names == ("root", "thigh", "shin", "shin_end")
    assert motion.fps == 120.0
    root = fixed(10, 20, 30)
    axis = fixed(10, 20, 30)
    thigh = root * axis * fixed(5, 15, 25) * axis.inv()
    hinge = fixed(0, 0, 20)
    shin = thigh * hinge * fixed(40, 0, 0) * hinge.inv()
    knee = np.array([1.0, 2.0, 3.0]) + thigh.apply([1.2, -1.6, 0.0])
    end = knee + shin.apply([0.0, -3.0, 0.0])
    for name, place in (
        ("root", (1.0, 2.0, 3.0)),
        ("thigh", (1.0, 2.0, 3.0)),
        ("shin", knee),
        ("shin_end", end),
    ):
        x, y, z = 25.4 / 0.5 * np.asarray(place)
        np.testing.assert_allclose(motion.positions[0, motion.index(name)], [z, x, y], atol=1e-9)
    np.testing.assert_allclose(motion.positions[1] - motion.positions[1, 0], motion.rest, atol=1e-9)


def test_a_bones_axis_may_be_given_in_another_order_and_without_one(tmp_path: Path) -> None:
    motion = read_acclaim(files(tmp_path, SKELETON.replace("axis 0 0 20 XYZ", "axis 0 30 20 ZYX")))
    other = read_acclaim(files(tmp_path, SKELETON.replace("axis 0 0 20 XYZ", "axis 0 30 20")))
    plain = read_acclaim(files(tmp_path, SKELETON.replace("axis 0 0 20 XYZ", "axis 0 30 20 XYZ")))
    end = motion.index("shin_end")
    np.testing.assert_array_equal(other.positions, plain.positions)
    assert np.abs(motion.positions[0, end] - plain.positions[0, end]).max() > 1.0


TREE = """:units
  mass 1
  length 2 # in inches
  angle rad
:documentation
  length 7
:root
   order TX TY TZ RX RY RZ
:bonedata
  begin
     name tip
     direction 0 0 1
     length 4
     dof
  end
  begin
     name arm
     direction 1 0 0
     length 2 mm
     axis 0.1 0.2 0.3 zyx # an order in small letters
     dof rz RX
  end
  begin
     name stiff
     direction 0 1 0
     length 0
     axis 0.4 0.5 0.6 XYZ
  end
  begin
     name leg
     direction 0 -1 0
     length 3
     dof ry
  end
:hierarchy
  begin
    arm tip leg
    stiff arm
    root stiff
  end
"""
TREE_FRAMES = """# made
  :FULLY-SPECIFIED

1
root 1 2 3 0.1 0.2 0.3 # the first
arm 0.4 0.5

leg 0.6
2
leg -0.6
arm 0.1 0.2
root 0 0 0 0 0 0
"""


def test_a_tree_of_turning_and_stiff_bones_in_radians_in_any_order(tmp_path: Path) -> None:
    motion = read_acclaim(files(tmp_path, TREE, TREE_FRAMES))
    assert motion.names == ("root", "stiff", "arm", "tip", "leg", "tip_end", "leg_end")
    assert motion.parents == (-1, 0, 1, 2, 2, 3, 4)
    assert motion.source == "07_01.amc"
    root = Rotation.from_euler("xyz", [0.1, 0.2, 0.3])
    axis = Rotation.from_euler("zyx", [0.1, 0.2, 0.3])
    arm = root * axis * Rotation.from_euler("zx", [0.4, 0.5]) * axis.inv()
    leg = arm * Rotation.from_euler("y", 0.6)
    elbow = np.array([1.0, 2.0, 3.0]) + arm.apply([2.0, 0.0, 0.0])
    turned = np.array([(0, 0, 1), (1, 0, 0), (0, 1, 0)])
    for name, place, turn in (
        ("root", (1.0, 2.0, 3.0), root),
        ("stiff", (1.0, 2.0, 3.0), root),
        ("arm", (1.0, 2.0, 3.0), arm),
        ("tip", elbow, arm),
        ("leg", elbow, leg),
        ("tip_end", elbow + arm.apply([0.0, 0.0, 4.0]), None),
        ("leg_end", elbow + leg.apply([0.0, -3.0, 0.0]), None),
    ):
        at = motion.index(name)
        np.testing.assert_allclose(motion.positions[0, at], 12.7 * turned @ place, atol=1e-9, err_msg=name)
        if turn is not None:
            wanted = turned @ turn.as_matrix() @ turned.T
            np.testing.assert_allclose(motion.rotations[0, at], wanted, atol=1e-9, err_msg=name)
    assert motion.seconds == pytest.approx(1 / 120)


def test_files_may_be_written_differently_and_mean_the_same(tmp_path: Path) -> None:
    plain = read_acclaim(files(tmp_path))
    other = SKELETON.replace("length 0.5", "length 0.50 in").replace("name thigh", "name thigh left")
    other = other.replace("    dof rx\n", "    dof Rx\n").replace("order TX", "order tx")
    np.testing.assert_array_equal(read_acclaim(files(tmp_path, other)).positions, plain.positions)


@pytest.mark.parametrize("name", ["08.asf", "08_WALK.ASF", "08.ASF"])
def test_the_skeleton_beside_a_motion_is_the_subjects_or_its_own(tmp_path: Path, name: str) -> None:
    motion = files(tmp_path).rename(tmp_path / "08_walk.amc")
    (tmp_path / "07.asf").rename(tmp_path / name)
    (tmp_path / "09.asf").write_text("another's")
    assert len(read_acclaim(motion).positions) == 2


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("asf", "length 3", "length three", "'07.asf', line 27: 'three' is not a number"),
        ("asf", "dof rx\n", "dof rx l\n", "degree of freedom 'l' of bone 'shin'"),
        ("asf", "direction 0 -1 0", "direction 0 -1", "line 26: 2 numbers where 3 belong"),
        ("asf", "thigh shin", "thigh shine", "no bone 'shine'"),
        ("asf", "    thigh shin\n", "", "'shin' is in only one"),
        ("asf", "order TX TY TZ RX RY RZ", "order RX RY RZ TX TY TZ", "order"),
        ("asf", "position 0 0 0", "position 0 1 0", "the root's position is not 0 0 0"),
        ("asf", "orientation 0 0 0", "orientation 0 0 9", "the root's orientation is not 0 0 0"),
        ("asf", "   axis XYZ\n   position", "   axis ZYX\n   position", "the root's axis is zyx"),
        ("asf", "axis 0 0 20 XYZ", "axis 0 0 20 XXZ", "'XXZ' is no order of axes"),
        ("asf", "length 0.5", "length 0", "line 4"),
        ("asf", "length 0.5", "length", "line 4"),
        ("asf", "length 0.5", "length -1", "line 4: a unit of length of -1 is not above 0"),
        ("asf", "     name shin\n", "", "line 30: bone '' lacks"),
        ("asf", "     length 3\n", "", "line 30: bone 'shin' lacks"),
        ("asf", "     length 3\n", "     length\n", "line 31: bone 'shin' lacks"),
        ("asf", "     length 3\n", "     length -0.5\n", "line 31: bone 'shin' lacks"),
        ("asf", "     direction 0 -1 0\n", "", "line 30: bone 'shin' lacks"),
        ("asf", "axis 0 0 20 XYZ", "axis 0 0", "line 28: 2 numbers where 3 belong"),
        ("asf", "root thigh\n    thigh shin", "shin thigh\n    thigh shin", "does not hang on the root"),
        ("asf", SKELETON[SKELETON.index(":bonedata") :], ":hierarchy", "no bones"),
        ("amc", "shin 0\n", "", "line 10: frame 2 lacks bone 'shin'"),
        ("amc", FRAMES[FRAMES.index("1\n") :], "", "has no frames"),
        ("amc", "shin 40", "shin 40 1", "'07_01.amc', line 7: bone 'shin' has 2 numbers, not 1"),
        ("amc", "shin 40\n", "", "frame 1 lacks bone 'shin'"),
        ("amc", "shin 40", "tail 40", "no turning bone 'tail'"),
        ("amc", "thigh 5 15 25", "thigh 5 15 nan", "line 6: 'nan'"),
        ("amc", "1\nroot 1", "root 1", "before the first frame"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(
    tmp_path: Path, file: str, old: str, new: str, words: str
) -> None:
    assert old in (SKELETON if file == "asf" else FRAMES)
    changed = {"asf": SKELETON, "amc": FRAMES}
    changed[file] = changed[file].replace(old, new, 1)
    with pytest.raises(StudioError) as caught:
        read_acclaim(files(tmp_path, changed["asf"], changed["amc"]))
    assert words in caught.value.message
    assert caught.value.hint


def test_a_missing_skeleton_is_requested(tmp_path: Path) -> None:
    motion = files(tmp_path)
    (tmp_path / "07.asf").rename(tmp_path / "elsewhere.asf")
    with pytest.raises(StudioError, match=r"07\.asf"):
        read_acclaim(motion)
    assert len(read_acclaim(motion, tmp_path / "elsewhere.asf").positions) == 2


@pytest.mark.real_data
def test_cmus_walker_is_of_the_known_size_and_walks(real_data: Path) -> None:
    motion = read_acclaim(real_data / "cmu-motion" / "05_01.amc")
    assert motion.positions.shape[0] == 598
    tall = np.ptp(motion.positions[:, :, 2], axis=1).max() / CMU_UNIT
    assert 26.5 < tall < 28.5
    for joint, parent in enumerate(motion.parents):
        if parent >= 0:
            bone = np.linalg.norm(motion.positions[:, joint] - motion.positions[:, parent], axis=1)
            np.testing.assert_allclose(
                bone, np.linalg.norm(motion.rest[joint] - motion.rest[parent]), atol=1e-8
            )
    knee = motion.positions[:, motion.index("lfoot")] - motion.positions[:, motion.index("ltibia")]
    np.testing.assert_allclose(np.linalg.norm(knee, axis=1), 7.94618 * CMU_UNIT, rtol=1e-6)
    unit = np.swapaxes(motion.rotations, 2, 3) @ motion.rotations
    np.testing.assert_allclose(unit, np.broadcast_to(np.eye(3), unit.shape), atol=1e-9)
    went = motion.positions[-1, 0] - motion.positions[0, 0]
    # Five seconds at a walker's pace, towards where the person faces, on the floor.
    assert 3500.0 < went[0] < 6000.0
    assert np.abs(motion.positions[:, :, 2].min(axis=1)).max() < 60.0
