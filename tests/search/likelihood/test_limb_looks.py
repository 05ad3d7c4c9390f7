"""The look of limbs: strips of pictures whose grey levels are known functions of place."""

import numpy as np
import pytest

from studio.evidence.look_maps import SMOOTHING, look_maps
from studio.foundations.arrays import Array, Bytes
from studio.search.likelihood.limb_looks import FLAT, UNSEEN, kept_looks, look_scores

HEIGHT, WIDTH = 120, 160


def striped(shift: float = 0.0, gain: float = 1.0, base: float = 100.0) -> Bytes:
    """A level limb about y = 60 + shift: brighter than its ground, with a pattern along it."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    limb = np.exp(-0.5 * ((y - 60.0 - shift) / 6.0) ** 2) * (1.0 + 0.3 * np.sin(x / 9.0))
    level = np.clip(base + gain * 60.0 * limb, 0, 255).astype(np.uint8)
    return np.repeat(level[..., None], 3, axis=2)


def lying_at(*heights: float) -> Array:
    """(N, 1, 4, 2) a limb 80 pixels long and 12 wide, its middle at these heights."""
    quad = np.array([[40.0, 6.0], [120.0, 6.0], [120.0, -6.0], [40.0, -6.0]])
    return np.stack([quad + np.array([0.0, height]) for height in heights])[:, None]


def test_a_limb_scores_most_where_it_went() -> None:
    looks = kept_looks(look_maps(striped()), lying_at(60.0)[0])
    heights = np.arange(60.0, 85.0)
    scores = look_scores(look_maps(striped(shift=11.0)), lying_at(*heights), [looks])[:, 0]
    assert heights[np.argmax(scores)] == 71.0


def test_brightness_and_contrast_count_little_for_the_likeness_their_sign_counts() -> None:
    looks = kept_looks(look_maps(striped()), lying_at(60.0)[0])
    same, dimmer, inverted = (
        look_scores(look_maps(picture), lying_at(60.0), [looks])[0, 0]
        for picture in (striped(), striped(gain=0.5, base=40.0), striped(gain=-1.0, base=180.0))
    )
    assert dimmer == pytest.approx(same, abs=0.1)
    assert same - inverted == pytest.approx(2.0, abs=0.05)  # correlations of 1 and -1, equally steep sides


def test_a_strip_of_no_contrast_is_like_nothing() -> None:
    flat = look_maps(np.full((HEIGHT, WIDTH, 3), 90, np.uint8))
    looks = kept_looks(look_maps(striped()), lying_at(60.0)[0])
    assert look_scores(flat, lying_at(60.0), [looks])[0, 0] == pytest.approx(0.0, abs=1e-6)
    assert np.abs(kept_looks(flat, lying_at(60.0)[0])).max() < 1e-6


def test_a_kept_strip_has_no_mean_and_length_one_but_for_the_contrast_below_which_all_is_noise() -> None:
    looks = kept_looks(look_maps(striped()), lying_at(60.0)[0])[0].astype(float)
    out = np.linspace(-2.2, 2.2, 12)
    weights = np.exp(-0.5 * (out / 1.2) ** 2) / (14 * np.exp(-0.5 * (out / 1.2) ** 2).sum())
    along = 40.0 + 80.0 * (1.3 * (np.arange(14) + 0.5) / 14 - 0.15)
    wide = np.hypot(6.0, SMOOTHING)
    level = (
        60.0
        * 6.0
        / wide
        * np.exp(-0.5 * (6.0 * out / wide) ** 2)
        * (1.0 + 0.3 * np.sin(along[:, None] / 9.0))
    )
    variance = float((weights * (level - (weights * level).sum()) ** 2).sum())
    assert float((weights * looks).sum()) == pytest.approx(0.0, abs=1e-6)
    assert float((weights * looks**2).sum()) == pytest.approx(variance / (variance + FLAT**2), abs=5e-4)


def test_the_best_of_several_kept_looks_counts() -> None:
    right = kept_looks(look_maps(striped()), lying_at(60.0)[0])
    wrong = -right
    scores = [
        look_scores(look_maps(striped()), lying_at(60.0), looks)[0, 0]
        for looks in ([right], [wrong, right], [wrong])
    ]
    assert scores[0] == pytest.approx(scores[1])
    assert scores[0] - scores[2] == pytest.approx(2.0, abs=0.03)


def test_a_limb_that_is_not_seen_scores_worst_and_keeps_no_look() -> None:
    unseen = np.full((1, 1, 4, 2), np.nan)
    looks = kept_looks(look_maps(striped()), unseen[0])
    assert (looks == 0.0).all()
    assert look_scores(look_maps(striped()), unseen, [looks])[0, 0] == UNSEEN
