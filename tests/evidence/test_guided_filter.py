"""The guided filter against its definition: one ridge regression a window."""

import numpy as np
import pytest

from studio.evidence.guided_filter import GUIDED_SIDE, GUIDED_SMOOTHNESS, guided


def plainly(picture: np.ndarray, share: np.ndarray, radius: int) -> np.ndarray:
    """Eqs. 13 to 15, window by window; NaN where a window leaves the picture."""
    colours, (height, width), side = picture / 255.0, share.shape, 2 * radius + 1
    planes = np.full((height, width, 4), np.nan)
    for y in range(radius, height - radius):
        for x in range(radius, width - radius):
            around = np.s_[y - radius : y + radius + 1, x - radius : x + radius + 1]
            seen, wanted = colours[around].reshape(-1, 3), share[around].ravel()
            covariance = np.cov(seen.T, bias=True) + GUIDED_SMOOTHNESS * np.eye(3)
            across = (seen * wanted[:, None]).mean(axis=0) - seen.mean(axis=0) * wanted.mean()
            slope = np.linalg.solve(covariance, across)
            planes[y, x] = *slope, wanted.mean() - slope @ seen.mean(axis=0)
    windows = np.lib.stride_tricks.sliding_window_view(planes, (side, side), axis=(0, 1)).mean(axis=(3, 4))
    means = np.full_like(planes, np.nan)
    means[radius:-radius, radius:-radius] = windows
    return (means[..., :3] * colours).sum(axis=2) + means[..., 3]


@pytest.mark.parametrize("radius", [1, 3])
def test_it_is_the_regression_of_the_share_on_colours_of_each_window(radius: int) -> None:
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 256, (24, 30, 3), dtype=np.uint8)
    share = rng.random((24, 30), np.float32)
    wanted = plainly(picture, share, radius)
    inside = np.isfinite(wanted)
    assert inside.sum() == (24 - 4 * radius) * (30 - 4 * radius)
    np.testing.assert_allclose(guided(picture, share, radius)[inside], wanted[inside], atol=2e-3)


@pytest.mark.parametrize("side", [96, 2 * GUIDED_SIDE])
def test_a_coarse_share_ends_where_the_colour_does(side: int) -> None:
    picture = np.full((side, side, 3), 60, np.uint8)
    picture[:, side // 2 :] = (40, 90, 200)
    share = np.zeros((side, side), np.float32)
    share[:, side // 2 - side // 24 :] = 1.0
    sharp = guided(picture, share, side / 8)
    rows = np.s_[side // 4 : -side // 4]
    assert sharp[rows, side // 2 + 2 : side // 2 + side // 12].min() > 0.9
    assert sharp[rows, side // 2 - side // 12 : side // 2 - 3].max() < 0.5
