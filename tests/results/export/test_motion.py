"""Tracks brought onto an even grid: gaps, lost frames, frame rates."""

import dataclasses

import numpy as np
import pytest
from export_runs import MADE, moving_poses, track_of

from studio.body.catalogue import load_body
from studio.foundations.errors import ExportError
from studio.foundations.knobs import changed
from studio.results.export.motion import even_motion
from studio.results.export.options import ExportOptions

ARM = load_body("planar_arm4")


def motion(
    poses: np.ndarray, frames: np.ndarray | None = None, states: tuple[str, ...] = (), **requested: object
):
    return even_motion(ARM, 60.0, track_of(poses, frames, states), changed(ExportOptions(), requested))


def test_a_track_without_gaps_stays_as_it_is() -> None:
    poses = moving_poses(ARM, 30)
    made = motion(poses)
    np.testing.assert_array_equal(made.poses, poses)
    assert made.known.all()
    assert made.gaps == ()
    assert made.notes == ()
    np.testing.assert_allclose(made.times, np.arange(30) / 60.0)


def test_missing_frames_are_gaps_and_filled_along_the_shorter_way() -> None:
    poses = np.zeros((2, 4))
    poses[0, 0], poses[1, 0] = 3.0, -3.0
    made = motion(poses, np.array([10, 14]))
    assert made.gaps == ((1, 4),)
    np.testing.assert_array_equal(made.frames, [10, 11, 12, 13, 14])
    # From 3 rad on through π to -3 + 2π: a step of 0.2832 in all.
    np.testing.assert_allclose(made.poses[:4, 0], 3.0 + (2.0 * np.pi - 6.0) * np.arange(4) / 4.0)
    assert made.poses[4, 0] == -3.0
    assert made.notes == ("3 frames have no pose of their own (not tracked, or lost).",)


def test_lost_at_both_ends_is_held() -> None:
    poses = moving_poses(ARM, 6)
    made = motion(poses, states=("lost", "no evidence", "tracked", "recovered", "lost", "lost"))
    np.testing.assert_array_equal(made.known, [False, False, True, True, False, False])
    np.testing.assert_array_equal(made.poses[[0, 1]], poses[[2, 2]])
    np.testing.assert_array_equal(made.poses[[4, 5]], poses[[3, 3]])


def test_lost_frames_can_be_kept() -> None:
    poses = moving_poses(ARM, 4)
    made = motion(poses, states=("tracked", "lost", "lost", "tracked"), lost="keep")
    assert made.known.all()
    np.testing.assert_array_equal(made.poses, poses)


def test_what_a_smoother_filled_is_known() -> None:
    poses = moving_poses(ARM, 4)
    smoothed = dataclasses.replace(
        track_of(poses, states=("tracked", "lost", "lost", "tracked")),
        made_by={"verb": "smooth", "filled": [1]},
    )
    made = even_motion(ARM, 60.0, smoothed, ExportOptions())
    np.testing.assert_array_equal(made.known, [True, True, False, True])
    np.testing.assert_array_equal(made.poses[1], poses[1])


def test_a_higher_rate_lies_between_and_a_lower_one_picks() -> None:
    poses = moving_poses(ARM, 61)
    double = motion(poses, fps=120.0)
    assert len(double.poses) == 121
    np.testing.assert_array_equal(double.poses[::2], poses)
    np.testing.assert_allclose(double.poses[1::2], (poses[1:] + poses[:-1]) / 2.0, atol=1e-12)
    half = motion(poses, fps=30.0)
    np.testing.assert_array_equal(half.poses, poses[::2])
    assert half.fps == 30.0
    odd = motion(poses, fps=25.0)
    assert len(odd.poses) == 26
    np.testing.assert_allclose(odd.times, np.arange(26) / 25.0)
    for column in range(4):
        wanted = np.interp(odd.times, np.arange(61) / 60.0, poses[:, column])
        np.testing.assert_allclose(odd.poses[:, column], wanted, atol=1e-9)


def test_between_a_known_and_a_lost_frame_nothing_is_known() -> None:
    made = motion(moving_poses(ARM, 4), states=("tracked", "lost", "tracked", "tracked"), fps=120.0)
    np.testing.assert_array_equal(made.known, [True, False, False, False, True, True, True])


def test_poses_far_apart_are_pointed_out() -> None:
    poses = np.zeros((2, 4))
    poses[1, 2] = 2.0
    made = motion(poses, np.array([0, 3]))
    assert any("2 poses in between lie amid angles more than 90 degrees apart" in note for note in made.notes)


def test_a_range_is_cut_out() -> None:
    poses = moving_poses(ARM, 30)
    made = motion(poses, first=5, last=12)
    np.testing.assert_array_equal(made.poses, poses[5:12])
    np.testing.assert_array_equal(made.frames, np.arange(5, 12))
    assert made.times[0] == 0.0


def test_no_frame_is_refused() -> None:
    with pytest.raises(ExportError, match=f"Track '{MADE}' has no frame from 40 to 49; it has 0 to 29"):
        motion(moving_poses(ARM, 30), first=40, last=50)
    with pytest.raises(ExportError, match="lost in every frame"):
        motion(moving_poses(ARM, 2), states=("lost", "lost"))
