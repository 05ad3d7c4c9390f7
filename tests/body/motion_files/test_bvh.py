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
