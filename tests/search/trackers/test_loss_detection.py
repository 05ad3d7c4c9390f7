"""Lost, tracked, no evidence: on numbers and on drawn silhouettes."""

import dataclasses

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras

from studio.body.catalogue import load_body
from studio.evidence.frame_evidence import FrameEvidence
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.loss_detection import (
    FEWEST,
    REMEMBERED,
    Onlooker,
    Sight,
    WeightWatch,
    anything_seen,
    is_blank,
)

BODY = load_body("human25")
CAMERAS = ring_of_cameras(3)
ONLOOKER = Onlooker(BODY, CAMERAS)
STANDING = drawn_evidence(BODY, BODY.neutral, CAMERAS)
EMPTY_SCENE = drawn_evidence(BODY, None, CAMERAS)


def moved(x: float) -> np.ndarray:
    pose = BODY.neutral.copy()
    pose[0] += x
    return pose


def in_black(evidence: FrameEvidence, level: int = 0, foreground: int = 255) -> FrameEvidence:
    """The picture of a camera without a signal: one colour, all of it foreground to a background model."""
    views = [
        dataclasses.replace(
            view, picture=np.full_like(view.picture, level), mask=np.full_like(view.mask, foreground)
        )
        for view in evidence.views
    ]
    return dataclasses.replace(evidence, views=tuple(views))


def calibrated(weighting: str = "edge-region", seed: int = 0, spread: float = 0.1) -> WeightWatch:
    """A watch that has seen forty well tracked frames."""
    rng = np.random.default_rng(seed)
    numbers = zip(rng.normal(-2.0, spread, 40), rng.normal(0.85, 0.01, 40), strict=True)
    return WeightWatch(
        WEIGHTINGS[weighting].loss, [(float(weight), float(overlap)) for weight, overlap in numbers]
    )


def test_a_pose_on_the_body_overlaps_and_one_beside_it_does_not() -> None:
    on = ONLOOKER.sight(STANDING, BODY.neutral)
    assert on.seen
    assert on.overlap > 0.9
    near, away = ONLOOKER.sight(STANDING, moved(60.0)), ONLOOKER.sight(STANDING, moved(600.0))
    assert on.overlap > near.overlap > away.overlap
    assert away.seen
    assert away.overlap < 0.4


def test_empty_scenes_and_black_pictures_are_no_evidence() -> None:
    assert not ONLOOKER.sight(EMPTY_SCENE, BODY.neutral).seen
    assert not ONLOOKER.sight(in_black(STANDING), BODY.neutral).seen
    assert not ONLOOKER.sight(in_black(STANDING, 255, 0), BODY.neutral).seen
    assert not anything_seen(EMPTY_SCENE)
    assert not anything_seen(in_black(STANDING))
    assert anything_seen(STANDING)


def test_crumbs_in_the_masks_are_no_body() -> None:
    views = []
    for view in EMPTY_SCENE.views:
        mask = view.mask.copy()
        mask[5:25, 5:25] = 255
        views.append(dataclasses.replace(view, mask=mask))
    crumbs = dataclasses.replace(EMPTY_SCENE, views=tuple(views))
    assert anything_seen(crumbs)
    assert not ONLOOKER.sight(crumbs, BODY.neutral).seen


def test_one_view_is_enough_and_blank_views_do_not_count() -> None:
    first = (STANDING.views[0], *in_black(STANDING).views[1:])
    sight = ONLOOKER.sight(dataclasses.replace(STANDING, views=first), BODY.neutral)
    assert sight.seen
    assert sight.overlap > 0.9


def test_blank_pictures() -> None:
    view = STANDING.views[0]
    assert not is_blank(view)
    noisy = np.random.default_rng(0).normal(12.0, 2.0, view.picture.shape).astype(np.uint8)
    assert is_blank(dataclasses.replace(view, picture=noisy))


def test_a_weight_far_below_its_own_run_is_lost() -> None:
    watch, sight = calibrated(), Sight(0.85, seen=True)
    assert not watch.is_lost(-2.0, sight)
    assert not watch.is_lost(-2.3, sight)
    assert watch.is_lost(-2.8, sight)
    assert not watch.is_lost(-1.0, sight)


def test_a_calm_run_is_given_the_weightings_usual_spread() -> None:
    calm, sight = calibrated(spread=1e-4), Sight(0.85, seen=True)
    limit = WEIGHTINGS["edge-region"].loss
    assert not calm.is_lost(-2.0 - 0.9 * limit.spreads * limit.spread, sight)
    assert calm.is_lost(-2.0 - 1.1 * limit.spreads * limit.spread, sight)


def test_little_overlap_is_lost_whatever_the_weight() -> None:
    assert calibrated().is_lost(-1.9, Sight(0.7, seen=True))
    assert not calibrated().is_lost(-1.9, Sight(0.78, seen=True))
    nothing_known = WeightWatch(WEIGHTINGS["edge-region"].loss)
    assert nothing_known.is_lost(-1.9, Sight(0.3, seen=True))
    assert not nothing_known.is_lost(-99.0, Sight(0.6, seen=True))
    assert not calibrated().is_lost(-2.0, Sight(float("nan"), seen=True))


def test_a_weightings_own_verdict_counts() -> None:
    assert calibrated().is_lost(-2.0, Sight(0.85, seen=True, called_lost=True))


def test_few_frames_make_no_distribution_and_old_ones_are_forgotten() -> None:
    watch = WeightWatch(WEIGHTINGS["edge-region"].loss, [(-2.0, 0.85)] * (FEWEST - 1))
    sight = Sight(0.85, seen=True)
    assert not watch.is_lost(-9.0, sight)
    watch.well_tracked(-2.0, 0.85)
    assert watch.is_lost(-9.0, sight)
    for _ in range(REMEMBERED):
        watch.well_tracked(-9.0, 0.85)
    assert not watch.is_lost(-9.0, sight)


@pytest.mark.parametrize("weighting", sorted(WEIGHTINGS))
def test_every_weighting_was_calibrated(weighting: str) -> None:
    limit = WEIGHTINGS[weighting].loss
    assert limit.spread > 0.0
    assert 4.0 <= limit.spreads <= 6.0
