"""An attempt weighed by blobs: the cache provides pictures, and learnt blobs are passed from frame to frame."""

from pathlib import Path

import numpy as np
import pytest

from studio.evidence.settings import EvidenceSettings
from studio.results.comparison.footage_cache import NO_PICTURE, FootageCache
from studio.results.comparison.tracked import TrackingTrial, track

SAMPLES = Path(__file__).parents[3] / "sample_sessions"
CHANGES = {"layers": 5, "particles": 60, "hull_depth": 6}


@pytest.mark.slow
def test_the_walk_is_followed_by_blobs() -> None:
    cache = FootageCache(SAMPLES)
    fields = {"seed": 3, "last": 12, "body": "human25"}
    found = track(TrackingTrial("walk", "annealed", "blobs", changes=CHANGES, **fields), cache)
    again = track(TrackingTrial("walk", "annealed", "blobs", changes=CHANGES, **fields), cache)
    cache.close()
    assert found.per_frame_mm == again.per_frame_mm
    # Twelve frames of walking carry a body that is not followed some 170 mm away.
    assert found.mean_mm < 60.0
    assert found.worst_mm < 90.0


def test_pictures_are_kept_only_for_weightings_that_read_them() -> None:
    cache = FootageCache(SAMPLES)
    session = cache.session("walk")
    cameras = session.cameras()
    seen = [
        cache.evidence(session, cameras, 0, EvidenceSettings(), "none", pictures)
        for pictures in (False, True)
    ]
    assert seen[0].views[0].picture is NO_PICTURE
    assert seen[1].views[0].picture.shape == (480, 640, 3)
    np.testing.assert_array_equal(seen[0].views[0].mask, seen[1].views[0].mask)
    assert cache.evidence(session, cameras, 0, EvidenceSettings(), "none", True) is seen[1]
    cache.close()
