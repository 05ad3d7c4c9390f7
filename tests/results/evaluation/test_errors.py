"""The error measure on poses whose distance from the truth is known by construction."""

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import MarkerMotion
from studio.foundations.errors import TruthError
from studio.results.evaluation.errors import (
    evaluate,
    limb_of_drawn,
    limb_of_markers,
    meant_axes,
    rows_of_frames,
)
from studio.results.evaluation.report import in_words

FRAMES = 6


def moving(frames: int = FRAMES) -> tuple[np.ndarray, MarkerMotion]:
    """Poses of human31 that walk off and bend, and their exact markers at 60 Hz."""
    body = load_body("human31")
    poses = np.tile(body.neutral, (frames, 1))
    poses[:, 3] += 30.0 * np.arange(frames)
    poses[:, 7] += 0.05 * np.arange(frames)
    names = tuple(marker.name for marker in body.markers)
    return poses, MarkerMotion(names, np.arange(frames) / 60.0, marker_points(body, poses))


def changed(truth: MarkerMotion, **changes: object) -> MarkerMotion:
    values = {"names": truth.names, "times": truth.times, "positions": truth.positions} | changes
    return MarkerMotion(**values)  # type: ignore[arg-type]


def test_the_truth_itself_has_no_error() -> None:
    poses, truth = moving()
    found = evaluate(poses, np.arange(FRAMES), load_body("human31"), truth, 60.0)
    assert found.mean_mm == pytest.approx(0.0, abs=1e-9)
    assert found.root_aligned_mm == pytest.approx(0.0, abs=1e-9)
    assert found.procrustes_mm == pytest.approx(0.0, abs=1e-9)
    assert found.lost_frames == 0
    assert found.unmatched_markers == ()
    assert found.frames == tuple(range(FRAMES))


def test_a_shifted_body_is_off_by_the_shift_and_not_when_aligned() -> None:
    poses, truth = moving()
    poses[:, 3:6] += np.array([30.0, 40.0, 0.0])
    found = evaluate(poses, np.arange(FRAMES), load_body("human31"), truth, 60.0)
    assert found.mean_mm == pytest.approx(50.0)
    assert found.worst_mm == pytest.approx(50.0)
    assert found.std_mm == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(list(found.per_marker_mm.values()), 50.0)
    assert found.root_aligned_mm == pytest.approx(0.0, abs=1e-9)
    assert found.procrustes_mm == pytest.approx(0.0, abs=1e-8)
    assert found.common_offset_mm == pytest.approx(50.0)
    assert found.without_offsets_mm == pytest.approx(0.0, abs=1e-9)


def test_constant_offsets_are_separated_from_changes() -> None:
    poses, truth = moving()
    moved = truth.positions.copy()
    wrist = truth.names.index("LWrist")
    moved[:, wrist] += np.array([0.0, 60.0, 0.0])
    moved[::2, wrist, 2] += 10.0
    found = evaluate(poses, np.arange(FRAMES), load_body("human31"), changed(truth, positions=moved), 60.0)
    count, high = len(truth.names), len(range(0, FRAMES, 2))
    drift = 2.0 * 10.0 * high * (FRAMES - high) / FRAMES**2
    assert found.offsets_mm["LWrist"] == pytest.approx(np.hypot(60.0, 10.0 * high / FRAMES))
    assert found.without_offsets_mm == pytest.approx(drift / count)


def test_one_marker_off_counts_by_its_share_and_loses_its_limb() -> None:
    poses, truth = moving()
    moved = truth.positions.copy()
    wrist, knee = truth.names.index("LWrist"), truth.names.index("RKnee")
    moved[2, wrist, 2] += 150.5
    moved[4, wrist, 1] -= 300.0
    moved[3, knee, 0] += 149.5
    found = evaluate(poses, np.arange(FRAMES), load_body("human31"), changed(truth, positions=moved), 60.0)
    np.testing.assert_allclose(found.per_frame_mm, np.array([0, 0, 150.5, 149.5, 300.0, 0]) / 15.0, atol=1e-9)
    assert found.worst_mm == pytest.approx(20.0)
    assert found.mean_mm == pytest.approx(600.0 / 15.0 / FRAMES)
    assert found.std_mm == pytest.approx(np.std(np.array([0, 0, 150.5, 149.5, 300.0, 0]) / 15.0))
    assert found.per_marker_mm["LWrist"] == pytest.approx(450.5 / FRAMES)
    assert found.lost_frame_numbers == (2, 4)
    assert found.lost_frames == 2
    assert found.lost_limbs == ("left arm",)


def test_rows_are_matched_by_their_times() -> None:
    poses, truth = moving()
    late = changed(truth, times=truth.times + 3.5)
    assert rows_of_frames(late, 60.0) == {210 + frame: frame for frame in range(FRAMES)}
    found = evaluate(poses[3:5], np.array([213, 214]), load_body("human31"), late, 60.0)
    assert found.mean_mm == pytest.approx(0.0, abs=1e-9)
    assert found.frames == (213, 214)
    with pytest.raises(TruthError, match="rows are frames 210 to 215"):
        evaluate(poses[3:5], np.array([3, 4]), load_body("human31"), late, 60.0)


@pytest.mark.parametrize(("turn", "unit"), [((2, 0, 1), 1.0), ((1, 2, 0), 1.0), ((0, 1, 2), 0.001)])
def test_a_truth_of_other_axes_or_units_is_told_from_a_bad_run(turn: tuple[int, ...], unit: float) -> None:
    poses, truth = moving()
    other = changed(truth, positions=truth.positions[:, :, turn] * unit)
    words = meant_axes(poses, np.arange(FRAMES), load_body("human31"), other, 60.0)
    assert "differ from the session's" in words
    assert "0.0 mm" in words
    assert ("--align similarity" if unit != 1.0 else "--align rigid") in words
    assert not meant_axes(poses, np.arange(FRAMES), load_body("human31"), truth, 60.0)
    twice = rows_of_frames(changed(truth, times=truth.times / 2.0), 60.0)
    assert [twice[frame] for frame in (0, 1, 2)] == [0, 2, 4]
    half = rows_of_frames(changed(truth, times=truth.times * 2.0), 60.0)
    assert half == {0: 0, 2: 1, 4: 2, 6: 3, 8: 4, 10: 5}


def test_frames_without_truth_are_not_measured() -> None:
    poses, truth = moving()
    found = evaluate(poses[[1, 2]], np.array([1, 40]), load_body("human31"), truth, 60.0)
    assert found.frames == (1,)


def test_missing_markers_are_left_out_and_named() -> None:
    poses, truth = moving()
    gaps = truth.positions.copy()
    gaps[1, truth.names.index("Head")] = np.nan
    gaps[5] = np.nan
    gaps[:, truth.names.index("LKnee")] += 45.0
    names = tuple("Crown" if name == "Neck" else name for name in truth.names)
    motion = changed(truth, positions=gaps, names=names)
    found = evaluate(poses, np.arange(FRAMES), load_body("human31"), motion, 60.0)
    assert found.frames == (0, 1, 2, 3, 4)
    assert found.unmatched_markers == ("Crown", "Neck")
    assert "Neck" not in found.per_marker_mm
    off = 45.0 * np.sqrt(3.0)
    np.testing.assert_allclose(
        found.per_frame_mm, np.array([off / 14, off / 13, off / 14, off / 14, off / 14])
    )


def test_nothing_in_common_is_an_error() -> None:
    poses, truth = moving()
    body = load_body("human31")
    other = changed(truth, names=tuple(f"Marker{index}" for index in range(15)))
    with pytest.raises(TruthError, match="Marker0"):
        evaluate(poses, np.arange(FRAMES), body, other, 60.0)
    with pytest.raises(TruthError, match="no finished frame"):
        evaluate(poses[:0], np.arange(0), body, truth, 60.0)
    with pytest.raises(TruthError, match="frames 0 to 5"):
        evaluate(poses, np.arange(100, 100 + FRAMES), body, truth, 60.0)


@pytest.mark.parametrize("name", ["human31", "human29", "human34", "human25"])
def test_a_person_has_five_limbs(name: str) -> None:
    limbs = limb_of_markers(load_body(name))
    assert len(set(limbs.values())) == 5
    for marker in ("RHip", "RKnee", "RAnkle"):
        assert limbs[marker] == limbs["RKnee"]
    for marker in ("LShoulder", "LElbow", "LWrist"):
        assert limbs[marker] == limbs["LElbow"]
    assert limbs["Hip"] == limbs["Neck"] == limbs["Head"]


def test_a_bent_knee_is_off_by_its_angle_and_no_other_joint_is() -> None:
    poses, truth = moving()
    body = load_body("human31")
    at = next(number for number, entry in enumerate(body.parameters) if entry.name == "left_knee_ry")
    straight, bent = poses.copy(), poses.copy()
    straight[:, at], bent[:, at] = np.radians(20.0), np.radians(30.0)
    truth = changed(truth, positions=marker_points(body, straight))
    found = evaluate(bent, np.arange(FRAMES), body, truth, 60.0)
    assert found.angles_deg["LKnee"] == pytest.approx(10.0, abs=0.5)
    assert found.directions_deg["LKnee_LAnkle"] == pytest.approx(10.0, abs=1e-6)
    assert [name for name, value in found.angles_deg.items() if value > 1e-6] == ["LKnee"]
    assert found.mean_angle_deg == pytest.approx(np.mean(list(found.angles_deg.values())))
    assert "LKnee" in in_words(found).split("angles between limbs")[1]


def test_a_turned_body_has_limbs_of_other_directions_and_the_same_angles() -> None:
    poses, truth = moving()
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = evaluate(
        poses,
        np.arange(FRAMES),
        load_body("human31"),
        changed(truth, positions=truth.positions @ turn.T),
        60.0,
    )
    assert found.mean_angle_deg == pytest.approx(0.0, abs=1e-4)
    assert found.mean_direction_deg is not None
    assert found.mean_direction_deg > 10.0


def test_a_marker_that_is_missing_takes_its_joints_out_of_that_frame_only() -> None:
    poses, truth = moving()
    positions = truth.positions.copy()
    positions[0, truth.names.index("LKnee")] = np.nan
    found = evaluate(
        poses, np.arange(FRAMES), load_body("human31"), changed(truth, positions=positions), 60.0
    )
    assert found.angles_deg["LKnee"] == pytest.approx(0.0, abs=1e-4)
    alone = MarkerMotion(("LKnee",), truth.times, truth.positions[:, [truth.names.index("LKnee")]])
    none = evaluate(poses, np.arange(FRAMES), load_body("human31"), alone, 60.0)
    assert (none.angles_deg, none.mean_angle_deg, none.directions_deg) == ({}, None, {})


@pytest.mark.parametrize(
    ("body", "limbs"),
    [
        ("planar_arm4", {"arm"}),
        ("hand25", {"index", "little", "middle", "ring", "thumb", "wrist"}),
        ("human31", {"head and trunk", "left arm", "left leg", "right arm", "right leg"}),
    ],
)
def test_only_a_body_with_sides_has_a_head_and_trunk(body: str, limbs: set[str]) -> None:
    made = load_body(body)
    assert set(limb_of_markers(made).values()) == limbs
    assert set(limb_of_drawn(made).values()) == limbs
