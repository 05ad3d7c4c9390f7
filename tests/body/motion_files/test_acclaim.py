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
