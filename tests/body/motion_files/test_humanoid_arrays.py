"""The AMP humanoid's arrays: tiny ones against scipy, broken ones, and the run."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.body.motion_files.humanoid_arrays import read_humanoid_arrays
from studio.foundations.errors import StudioError

FRAMES = 9


def arrays(**changes: Any) -> dict[str, Any]:  # noqa: ANN401 - arrays of any kind, wrong ones too
    turns = (
        Rotation.random(FRAMES * 3, rng=np.random.default_rng(4))
        .as_quat()
        .reshape(FRAMES, 3, 4)
        .astype(np.float32)
    )
    return {
        "rotation_local_xyzw": turns,
        "root_translation_m": np.arange(FRAMES * 3, dtype=np.float32).reshape(FRAMES, 3) / 10.0,
        "local_translation_m": np.array([[0.0, 0.0, 1.0], [0.1, 0.2, 0.3], [0.0, 0.0, -0.4]], np.float32),
        "parent_indices": np.array([-1, 0, 1]),
        "node_names": np.array(["pelvis", "thigh", "shin"]),
        "fps": np.int32(60),
    } | changes


def written(folder: Path, entries: dict[str, Any]) -> Path:
    path = folder / "tiny.npz"
    np.savez(path, **entries)
    return path


def test_a_small_tree_stands_where_scipy_puts_it(tmp_path: Path) -> None:
    entries = arrays()
    motion = read_humanoid_arrays(written(tmp_path, entries))
    quaternions = entries["rotation_local_xyzw"].astype(float)
    for frame in (0, 5):
        pelvis, thigh, _ = (Rotation.from_quat(quaternion) for quaternion in quaternions[frame])
        root = 1000.0 * entries["root_translation_m"][frame]
        hip = root + pelvis.apply([100.0, 200.0, 300.0])
        knee = hip + (pelvis * thigh).apply([0.0, 0.0, -400.0])
        np.testing.assert_allclose(motion.positions[frame], [root, hip, knee], atol=1e-3)
    np.testing.assert_allclose(motion.rest, [[0, 0, 0], [100, 200, 300], [100, 200, -100]], atol=1e-3)
    assert motion.fps == 60.0


MOVING = ("rotation_local_xyzw", "root_translation_m")


@pytest.mark.parametrize("times", [2, 3, 4])
def test_frames_held_several_times_count_once(tmp_path: Path, times: int) -> None:
    once = arrays()
    held = {name: np.repeat(once[name], times, axis=0) for name in MOVING}
    motion = read_humanoid_arrays(written(tmp_path, once | held))
    assert motion.fps == 60.0 / times
    assert len(motion.positions) == FRAMES
    single = read_humanoid_arrays(written(tmp_path, once))
    np.testing.assert_array_equal(motion.positions, single.positions)


@pytest.mark.parametrize(("frames", "kept"), [(4, 4), (5, 3), (6, 3), (7, 4)])
def test_few_frames_that_are_alike_were_held_still(tmp_path: Path, frames: int, kept: int) -> None:
    once = arrays()
    held = {name: np.repeat(once[name], 2, axis=0)[:frames] for name in MOVING}
    assert len(read_humanoid_arrays(written(tmp_path, once | held)).positions) == kept


def test_a_held_root_alone_is_no_repetition(tmp_path: Path) -> None:
    once = arrays()
    for name in MOVING:
        still = {name: np.repeat(once[name][:1], FRAMES, axis=0)}
        motion = read_humanoid_arrays(written(tmp_path, once | still))
        assert (len(motion.positions), motion.fps, motion.source) == (FRAMES, 60.0, "tiny.npz")


@pytest.mark.parametrize(
    "change",
    [
        {"fps": np.float64(1.0)},
        {"fps": np.float64(1000.0)},
        {"rotation_local_xyzw": 1.0009 * np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 3, 1))},
        {"rotation_local_xyzw": 0.9991 * np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 3, 1))},
    ],
)
def test_what_is_just_right_is_read(tmp_path: Path, change: dict[str, Any]) -> None:
    assert read_humanoid_arrays(written(tmp_path, arrays(**change))).names == ("pelvis", "thigh", "shin")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rotation_local_xyzw": np.zeros((FRAMES, 3, 4))}, "not of length 1"),
        ({"rotation_local_xyzw": np.ones((FRAMES, 2, 4))}, "shape (9, 2, 4), not (9, 3, 4)"),
        ({"root_translation_m": np.ones((4, 3))}, "entry 'root_translation_m' has shape (4, 3)"),
        ({"root_translation_m": np.full((FRAMES, 3), np.nan)}, "no number"),
        ({"root_translation_m": np.where(np.eye(FRAMES, 3), np.nan, 0.0)}, "no number"),
        ({"local_translation_m": np.where(np.eye(3), np.inf, 0.0)}, "no number"),
        ({"parent_indices": np.array([-1, 2, 0])}, "earlier joints"),
        ({"parent_indices": np.array([-1, -1, 0])}, "earlier joints"),
        ({"fps": np.int32(0)}, "entry 'fps'"),
        ({"fps": np.int32(1001)}, "entry 'fps'"),
        ({"fps": np.array([60.0])}, "entry 'fps'"),
        ({"rotation_local_xyzw": 1.0011 * np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 3, 1))}, "not of length 1"),
        ({"rotation_local_xyzw": 0.9989 * np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 3, 1))}, "not of length 1"),
        ({"rotation_local_xyzw": np.full((FRAMES, 3, 4), np.nan)}, "not of length 1"),
        (
            {
                name: np.zeros((0, *size))
                for name, size in (("rotation_local_xyzw", (3, 4)), ("root_translation_m", (3,)))
            },
            "entry 'rotation_local_xyzw' has shape (0, 3, 4)",
        ),
        (
            {"local_translation_m": np.ones((2, 3))},
            "entry 'local_translation_m' has shape (2, 3), not (3, 3)",
        ),
        ({"parent_indices": np.array([-1, 0])}, "entry 'parent_indices' has shape (2,), not (3,)"),
        ({"parent_indices": np.array([0, 0, 1])}, "earlier joints"),
        ({"parent_indices": np.array([-1, 1, 0])}, "earlier joints"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    with pytest.raises(StudioError) as caught:
        read_humanoid_arrays(written(tmp_path, arrays(**change)))
    assert words in caught.value.message
    assert caught.value.hint


def test_other_files_are_refused(tmp_path: Path) -> None:
    missing = arrays()
    del missing["fps"]
    with pytest.raises(StudioError, match="'fps' is missing"):
        read_humanoid_arrays(written(tmp_path, missing))
    (tmp_path / "text.npz").write_text("no archive")
    with pytest.raises(StudioError, match=r"not an \.npz"):
        read_humanoid_arrays(tmp_path / "text.npz")
    np.savez(tmp_path / "pickle.npz", **arrays(node_names=np.array(["a", None, "b"], dtype=object)))
    with pytest.raises(StudioError, match=r"not an \.npz"):
        read_humanoid_arrays(tmp_path / "pickle.npz")


@pytest.mark.real_data
def test_the_run_goes_forward_on_bones_of_the_files_own_lengths(real_data: Path) -> None:
    path = real_data / "cmu-motion" / "amp_humanoid_run.npz"
    motion = read_humanoid_arrays(path)
    with np.load(path) as entries:
        offsets = 1000.0 * np.linalg.norm(entries["local_translation_m"], axis=1)
    for joint, parent in enumerate(motion.parents):
        if parent >= 0:
            bone = np.linalg.norm(motion.positions[:, joint] - motion.positions[:, parent], axis=1)
            np.testing.assert_allclose(bone, offsets[joint], rtol=1e-5)
    assert motion.fps == 30.0
    speed = (motion.positions[-1, 0, 0] - motion.positions[0, 0, 0]) / motion.seconds
    assert 3000.0 < speed < 4000.0
    # Whoever runs forwards bends the knees backwards.
    for side in ("left", "right"):
        shin, thigh = (motion.rotations[:, motion.index(f"{side}_{part}")] for part in ("shin", "thigh"))
        bend = np.swapaxes(thigh, 1, 2) @ shin
        assert np.degrees(np.arctan2(bend[:, 0, 2], bend[:, 2, 2])).max() > 90.0
