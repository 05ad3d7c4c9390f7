"""BVH: a tiny file against scipy's rotations, broken ones, and CMU's jumps."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.body.motion_files.bvh import read_bvh, read_bvh_file
from studio.foundations.errors import StudioError

TEXT = """HIERARCHY
ROOT Hips
{
  OFFSET 0 1 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT Leg
  {
    OFFSET 1 0 0
    CHANNELS 3 Yrotation Zrotation Xrotation
    End Site
    {
      OFFSET 0 -2 0
    }
  }
}
MOTION
Frames: 2
Frame Time: .0083333
1 2 3 30 20 10 50 60 70
0 0 0 0 0 0 0 0 0
"""


def written(folder: Path, text: str = TEXT) -> Path:
    path = folder / "tiny.bvh"
    path.write_text(text)
    return path


def test_a_small_tree_stands_where_scipy_puts_it(tmp_path: Path) -> None:
    motion = read_bvh(written(tmp_path), unit_mm=10.0)
    assert motion.names == ("Hips", "Leg", "Leg_end")
    assert motion.fps == 120.0
    hips = Rotation.from_euler("ZYX", [30, 20, 10], degrees=True)
    leg = hips * Rotation.from_euler("YZX", [50, 60, 70], degrees=True)
    root = np.array([1.0, 3.0, 3.0])
    knee = root + hips.apply([1.0, 0.0, 0.0])
    end = knee + leg.apply([0.0, -2.0, 0.0])
    for joint, (x, y, z) in enumerate((root, knee, end)):
        np.testing.assert_allclose(motion.positions[0, joint], [10 * z, 10 * x, 10 * y], atol=1e-9)
    np.testing.assert_allclose(motion.positions[1] - motion.positions[1, 0], motion.rest, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("OFFSET 1 0 0", "OFFSET 1 0", "line 8"),
        ("OFFSET 1 0 0", "OFFSET 1 0 x", "line 8: 'x' is not a number"),
        ("    OFFSET 1 0 0\n", "", "joint 'Leg' has no OFFSET"),
        ("CHANNELS 3 Yrotation", "CHANNELS 3 Wrotation", "line 9"),
        (
            "CHANNELS 3 Yrotation Zrotation",
            "CHANNELS 3 Yposition Zrotation",
            "position channels of joint 'Leg' move it by up to 25",
        ),
        ("JOINT Leg", "JOINT Hips", "second joint 'Hips'"),
        ("Frames: 2", "Frames: 30", "30 frames are announced, 2 follow"),
        ("Frame Time: .0083333", "Frame Time: 0", "line 18"),
        ("50 60 70", "50 60", "line 19: a frame has 8 numbers, the hierarchy 9 channels"),
        ("MOTION\n", "", "line 16"),
        ("HIERARCHY", "HIERARCH", "line 1"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in TEXT
    with pytest.raises(StudioError) as caught:
        read_bvh(written(tmp_path, TEXT.replace(old, new, 1)))
    assert words in caught.value.message
    assert "'tiny.bvh'" in caught.value.message
    assert caught.value.hint


@pytest.mark.parametrize(("last", "line"), [("MOTION\n", 17), ("Frames: 2\n", 18)])
def test_a_file_that_breaks_off_before_its_frames_says_where(tmp_path: Path, last: str, line: int) -> None:
    end = TEXT.index(last) + len(last)
    with pytest.raises(StudioError, match=f"line {line}"):
        read_bvh(written(tmp_path, TEXT[:end]))


@pytest.mark.parametrize(
    ("announced", "followed", "is_cut"), [(3, 2, False), (4, 2, True), (300, 297, False), (300, 296, True)]
)
def test_a_file_may_announce_a_frame_or_a_hundredth_more(
    tmp_path: Path, announced: int, followed: int, is_cut: bool
) -> None:
    head, rows = TEXT[: TEXT.index("1 2 3 30")], "1 2 3 30 20 10 50 60 70\n"
    path = written(tmp_path, head.replace("Frames: 2", f"Frames: {announced}") + followed * rows)
    if is_cut:
        with pytest.raises(StudioError, match=f"{announced} frames are announced, {followed} follow"):
            read_bvh_file(path)
    else:
        assert f"{followed} follow" in read_bvh_file(path).notes[0]


def test_a_file_lists_its_moving_joints_and_keeps_its_own_axes(tmp_path: Path) -> None:
    text = TEXT.replace(
        "CHANNELS 3 Yrotation Zrotation Xrotation", "CHANNELS 3 Xposition Yposition Zposition"
    )
    found = read_bvh_file(written(tmp_path, text))
    assert found.names == ("Hips", "Leg", "Leg_end")
    assert found.is_end.tolist() == [False, False, True]
    assert found.moved.all(axis=1).tolist() == [True, True, False]
    places, turns = found.followed()
    assert places.shape == (2, 2, 3)
    hips = Rotation.from_euler("ZYX", [30, 20, 10], degrees=True)
    # Where there are position channels, they stand in the offset's place.
    np.testing.assert_allclose(places[0, 0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(places[0, 1], places[0, 0] + hips.apply([50.0, 60.0, 70.0]), atol=1e-9)
    np.testing.assert_allclose(turns[0, 1], hips.as_matrix(), atol=1e-12)


ROW = "0 0 0 0 0 0 0 0 0\n"
HAND = """HIERARCHY
ROOT Hand
{ OFFSET 0 0 0
 CHANNELS 3 Xrotation Yrotation Zrotation
 JOINT One { OFFSET 1 2 3
  CHANNELS 0
  End Site { OFFSET 0 1 0 }
  End Site { OFFSET 0 2 0 } End Site { OFFSET 0 3 0 }
 }
 JOINT Two { OFFSET 4 5 6
  CHANNELS 2 yPOSITION Zrotation
  End tip { OFFSET 0 0 1 }
 }
}
MOTION
Frames:3
Frame Time: {step}
0 0 0 {a} 90
0 0 0 {b} 0
0 0 0 {c} 0
"""


def hand(folder: Path, step: str = "0.04", moves: tuple[float, float, float] = (9.0, 9.0, 9.0)) -> Path:
    text = HAND.replace("{step}", step)
    for letter, move in zip("abc", moves, strict=True):
        text = text.replace(f"{{{letter}}}", f"{move}")
    return written(folder, text)


def test_joints_beside_each_other_hang_on_the_one_they_stand_in(tmp_path: Path) -> None:
    found = read_bvh_file(hand(tmp_path))
    assert found.names == ("Hand", "One", "One_end", "One_end_2", "One_end_3", "Two", "Two_end")
    assert found.parents == (-1, 0, 1, 1, 1, 0, 5)
    assert found.is_end.tolist() == [False, False, True, True, True, False, True]
    assert found.moved.nonzero()[0].tolist() == [5]
    assert found.moves[:, 5, 1].tolist() == [9.0, 9.0, 9.0]
    assert found.offsets[:, 2].tolist() == [0, 3, 0, 0, 0, 6, 1]
    np.testing.assert_allclose(
        found.turns[0, 5], Rotation.from_euler("z", 90, degrees=True).as_matrix(), atol=1e-12
    )
    np.testing.assert_array_equal(found.turns[1, 5], np.eye(3))
    assert (found.fps, found.notes) == (25.0, ())
    places, _ = found.followed()
    assert places[0].tolist() == [[0, 0, 0], [1, 2, 3], [4, 9, 6]]


@pytest.mark.parametrize(
    ("moves", "rest"),
    [
        ((9.0, 9.05, 8.95), 9.0),
        ((9.0, 9.0, 9.07), None),
        ((9.0, 9.0, 8.93), None),
        ((0.0, 0.0, 0.0), 5.0),
        ((0.05, 0.05, 0.05), 5.0),
        ((0.07, 0.07, 0.07), 0.07),
    ],
)
def test_a_bone_may_change_by_a_hundredth_of_the_longest(
    tmp_path: Path, moves: tuple[float, float, float], rest: float | None
) -> None:
    """Of 6 here. Where the channels hold next to nothing, they are added to the offset."""
    path = hand(tmp_path, moves=moves)
    if rest is None:
        with pytest.raises(StudioError, match=r"joint 'Two' move it by up to 0\.07"):
            read_bvh(path)
        return
    # (x, y, z) of the file are (y, z, x) of a recording.
    np.testing.assert_allclose(read_bvh(path, unit_mm=2.0).rest[5], [12.0, 8.0, 2.0 * rest])


@pytest.mark.parametrize(("move", "is_read"), [(0.009, True), (0.011, False)])
def test_bones_in_metres_may_change_by_a_hundredth_of_one(tmp_path: Path, move: float, is_read: bool) -> None:
    text = TEXT.replace("OFFSET 0 1 0", "OFFSET 0 0 0").replace("OFFSET 1 0 0", "OFFSET .1 0 0")
    text = text.replace("OFFSET 0 -2 0", "OFFSET 0 .1 0").replace(
        "CHANNELS 3 Yrotation", "CHANNELS 3 Xposition"
    )
    path = written(tmp_path, text.replace("50 60 70", f"{move} 0 0").replace(ROW, 2 * ROW))
    if is_read:
        read_bvh(path)
    else:
        with pytest.raises(StudioError, match="bone stretches"):
            read_bvh(path)


@pytest.mark.parametrize(
    ("step", "fps"),
    [("0.0083333", 120.0), ("0.0333333", 30.0), ("0.0166667", 60.0), ("1", 1.0), ("0.0001", 10000.0),
     (repr(1 / 120.011), 120.0), (repr(1 / 119.989), 120.0), (repr(1 / 120.013), 120.013), ("0.08", 12.5)],
)  # fmt: skip
def test_a_rounded_frame_time_is_that_of_a_whole_rate(tmp_path: Path, step: str, fps: float) -> None:
    assert read_bvh_file(hand(tmp_path, step)).fps == pytest.approx(fps, rel=1e-9)


@pytest.mark.parametrize("step", ["1.01", "0.00009", "-1"])
def test_a_frame_time_that_cannot_be_is_refused(tmp_path: Path, step: str) -> None:
    with pytest.raises(StudioError, match="line 17: a frame time"):
        read_bvh_file(hand(tmp_path, step))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("ROOT Hips", "JOINT Hips", "line 2: 'JOINT Hips' does not belong here"),
        ("ROOT Hips", "ROOT", "line 2: 'ROOT' does not belong here"),
        ("JOINT Leg", "ROOT Leg", "line 6: 'ROOT Leg' does not belong here"),
        ("JOINT Leg", "JOINT", "line 6: 'JOINT' does not belong here"),
        ("ROOT Hips\n", "", "line 2: '{' is not understood"),
        ("}\nMOTION", "}\n}\nMOTION", "line 16: '}' is not understood"),
        ("}\nMOTION", "MOTION", "line 15: the hierarchy is not complete"),
        ("      OFFSET 0 -2 0\n", "", "joint 'Leg_end' has no OFFSET"),
        ("  OFFSET 0 1 0\n", "", "joint 'Hips' has no OFFSET"),
        ("OFFSET 0 1 0", "OFFSET 0 1 0 0", "line 4: 'OFFSET 0 1 0 0' is not understood"),
        ("{\n  OFFSET 0 1 0", "OFFSET 0 1 0\n{", "line 3: 'OFFSET 0 1 0' is not understood"),
        ("ROOT Hips\n", "CHANNELS 0\nROOT Hips\n", "line 2: 'CHANNELS 0' is not understood"),
        ("CHANNELS 3", "CHANNELS 4", "line 9: the channels do not match"),
        ("CHANNELS 3 Yrotation Zrotation Xrotation", "CHANNELS", "line 9: the channels do not match"),
        ("Frames: 2", "Frames: two", "line 17: 'Frames:'"),
        ("Frames: 2", "Frames: 2 3", "line 17: 'Frames:'"),
        ("Frames: 2", "Count: 2", "line 17: 'Frames:'"),
        ("Frame Time: .0083333", "Frame: .0083333", "line 18: 'Frame Time:'"),
        ("Frame Time: .0083333", "Frame Rate: .0083333", "line 18: 'Frame Time:'"),
        ("Frame Time: .0083333", "Frame Time: x", "line 18: 'x' is not a number"),
        ("0 0 0 0 0 0 0 0 0\n", "0 0 0 0 0 0 0 0\n", "line 20: a frame has 8 numbers"),
        ("0 0 0 0 0 0 0 0 0\n", "0 0 0 0 0 0 0 0 x\n", "line 20: 'x' is not a number"),
        (
            TEXT[TEXT.index("Frames: 2") :],
            "Frames: 0\nFrame Time: .01\n",
            "line 17: 0 frames are announced, 0 follow",
        ),
        (TEXT[TEXT.index("MOTION") :], "", "has no MOTION"),
        (TEXT[: TEXT.index("MOTION")], "HIERARCHY\n", "line 2: the hierarchy is not complete"),
    ],
)
def test_what_stands_in_a_wrong_place_is_named_with_its_line(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    assert old in TEXT
    with pytest.raises(StudioError) as caught:
        read_bvh_file(written(tmp_path, TEXT.replace(old, new, 1)))
    assert words in caught.value.message


def test_more_frames_than_announced_are_taken(tmp_path: Path) -> None:
    found = read_bvh(written(tmp_path, TEXT.replace("Frames: 2", "\nFRAMES:\t1\n")))
    assert len(found.positions) == 2
    assert "1 frames are announced, 2 follow" in found.notes[0]
    assert found.source == "tiny.bvh"


@pytest.mark.real_data
def test_cmus_jumps_have_constant_bones_and_leave_the_floor(real_data: Path) -> None:
    motion = read_bvh(real_data / "cmu-motion" / "CMU_01_01.bvh")
    assert len(motion.positions) == 2752
    assert motion.seconds == pytest.approx(22.9, abs=0.1)
    for joint, parent in enumerate(motion.parents):
        if parent >= 0:
            bone = np.linalg.norm(motion.positions[:, joint] - motion.positions[:, parent], axis=1)
            np.testing.assert_allclose(
                bone, np.linalg.norm(motion.rest[joint] - motion.rest[parent]), atol=1e-8
            )
    lowest = motion.positions[:, :, 2].min(axis=1)
    assert lowest.max() - np.quantile(lowest, 0.1) > 200.0
    # It starts in a T pose: the wrists as high as the shoulders and an arm's length apart from them.
    for side in ("Left", "Right"):
        arm = (
            motion.positions[0, motion.index(f"{side}Hand")] - motion.positions[0, motion.index(f"{side}Arm")]
        )
        assert abs(arm[2]) < 60.0
        assert np.linalg.norm(arm[:2]) > 400.0
