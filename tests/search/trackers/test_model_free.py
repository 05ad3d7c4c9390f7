"""The share of model-free particles, and when it grows."""

import numpy as np
import pytest

from studio.search.trackers.model_free import (
    BEATEN,
    FREE,
    LARGEST,
    NEWEST,
    chosen_free,
    compare_kinds,
    share_in,
    share_of,
)


@pytest.mark.parametrize(
    ("count", "share", "wanted"), [(100, 0.2, 20), (10, 0.01, 1), (10, 0.0, 0), (7, 1.0, 7)]
)
def test_a_share_of_the_particles(count: int, share: float, wanted: int) -> None:
    rng = np.random.default_rng(0)
    free = chosen_free(rng, count, share)
    assert free.sum() == wanted
    # What is drawn afterwards does not depend on the share.
    other = np.random.default_rng(0)
    chosen_free(other, count, 0.5)
    assert rng.random() == other.random()


def half_free(better: float) -> tuple[dict, np.ndarray]:
    """Twenty particles, the second half free and better by so many nats."""
    free = np.arange(20) >= 10
    return {FREE: free}, np.where(free, better, 0.0) + 0.1 * np.sin(np.arange(20))


def test_the_heavier_kind_moves_the_verdict() -> None:
    for better, low, high in ((50.0, 0.95, 1.0), (-50.0, 0.0, 0.05)):
        extra, weights = half_free(better)
        for _ in range(30):
            extra = compare_kinds(extra, weights)
        assert low <= extra[BEATEN][0] <= high


def test_the_verdict_is_smoothed_over_frames() -> None:
    extra, weights = half_free(50.0)
    first = compare_kinds(extra, weights)[BEATEN][0]
    assert first == pytest.approx(NEWEST, rel=0.05)


def test_sets_of_one_kind_and_rejected_particles_do_not_mislead() -> None:
    everyone = {FREE: np.ones(5, dtype=bool), BEATEN: np.array([0.3])}
    assert compare_kinds(everyone, np.zeros(5)) is everyone
    assert compare_kinds({}, np.zeros(5)) == {}
    extra, weights = half_free(0.0)
    rejected = np.where(extra[FREE], -np.inf, weights)
    assert compare_kinds(extra, rejected)[BEATEN][0] == 0.0


def test_the_share_grows_only_while_the_model_is_beaten() -> None:
    assert share_of(0.1, True, {}) == 0.1
    assert share_of(0.1, True, {BEATEN: np.array([0.5])}) == 0.1
    assert share_of(0.1, True, {BEATEN: np.array([0.625])}) == pytest.approx(0.1 + 0.5 * (LARGEST - 0.1))
    assert share_of(0.1, True, {BEATEN: np.array([1.0])}) == pytest.approx(LARGEST)
    assert share_of(0.1, False, {BEATEN: np.array([1.0])}) == 0.1
    assert share_of(0.0, True, {BEATEN: np.array([1.0])}) == 0.0
    assert share_of(1.0, True, {BEATEN: np.array([1.0])}) == 1.0


def test_the_record_has_the_share() -> None:
    assert share_in({FREE: np.array([True, False, False, False])}) == 0.25
    assert np.isnan(share_in({}))
