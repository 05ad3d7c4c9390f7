"""Another frame rate: closed forms, gaps, limits."""

import numpy as np

from studio.body.catalogue import load_body
from studio.runs.learning.resampling import frame_times, points_at, poses_at


def test_times_of_frames() -> None:
    np.testing.assert_allclose(frame_times(1.0, 30.0), np.arange(31) / 30.0)
    assert len(frame_times(433 / 120, 30.0)) == 109


def test_points_lie_on_the_curve_and_gaps_stay_gaps() -> None:
    times = np.arange(241) / 120.0
    curve = np.stack([np.sin(3.0 * times), np.cos(2.0 * times), times**2], axis=1)[:, None] * 100.0
    curve = np.repeat(curve, 2, axis=1)
    broken = curve.copy()
    broken[60:70, 0] = np.nan  # 0.08 s: bridged
    broken[120:200, 1] = np.nan  # 0.67 s: stays
    wanted = frame_times(2.0, 30.0)
    found = points_at(times, broken, wanted)
    truth = np.stack([np.sin(3.0 * wanted), np.cos(2.0 * wanted), wanted**2], axis=1) * 100.0
    np.testing.assert_allclose(found[:, 0], truth, atol=0.05)
    missing = (wanted > 119 / 120 + 1e-6) & (wanted < 200 / 120 - 1e-6)
    assert np.isnan(found[missing, 1]).all()
    np.testing.assert_allclose(found[~missing, 1], truth[~missing], atol=0.05)
    nothing = points_at(times, np.full_like(curve, np.nan), wanted)
    assert np.isnan(nothing).all()


def test_headings_are_unwound_and_limits_kept() -> None:
    body = load_body("human25")
    names = [entry.name for entry in body.parameters]
    times = np.arange(60) / 20.0
    poses = np.tile(body.neutral, (60, 1))
    turn = 3.0 * times
    poses[:, names.index("heading")] = np.mod(turn + np.pi, 2.0 * np.pi) - np.pi
    knee = names.index("left_knee")
    poses[:, knee] = np.where(np.arange(60) % 7 == 0, body.parameters[knee].upper, 0.3)
    wanted = frame_times(59 / 20.0, 90.0)
    found = poses_at(body, times, poses, wanted)
    np.testing.assert_allclose(found[:, names.index("heading")], 3.0 * wanted, atol=1e-6)
    assert found[:, knee].max() <= body.parameters[knee].upper
    assert found[:, knee].min() >= body.parameters[knee].lower
