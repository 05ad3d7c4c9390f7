"""A tracker on a footage, in memory: measured, reproducible, and as plain values."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.evidence.settings import EvidenceSettings
from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.progress import heard_by
from studio.results.comparison import tracked
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.tracked import (
    Changed,
    TrackingTrial,
    measure_seeds,
    seeds_at_once,
    track,
    track_seeds,
)
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING

SAMPLES = Path(__file__).parents[3] / "sample_sessions"
SMALL = {"layers": 3, "particles": 20}


@pytest.fixture(scope="module")
def cache():
    """The bundled sessions."""
    found = FootageCache(SAMPLES)
    yield found
    found.close()


def attempt(**wanted) -> TrackingTrial:
    """A few frames of the walk."""
    fields = {"seed": 3, "changes": SMALL, "last": 4, **wanted}
    return TrackingTrial("walk", "annealed", "edge-region", **fields)


def same(one, other) -> bool:
    """All fields but the time."""
    return {**asdict(one), "seconds": 0} == {**asdict(other), "seconds": 0}


def test_an_attempt_is_measured_and_gives_the_same_again(cache) -> None:
    first = track(attempt(), cache)
    assert first.frames == [0, 1, 2, 3]
    assert first.evaluations == 60
    assert 0.0 < first.mean_mm < 150.0
    assert first.worst_mm == max(first.per_frame_mm)
    assert same(first, track(attempt(), cache))
    assert not same(first, track(attempt(seed=4), cache))


def test_the_bundled_walk_is_tracked_by_the_default_as_well_as_ever(cache) -> None:
    """9.9 mm over 60 frames; pulled out of the floor by feet that cannot bend it was at 24.9."""
    wanted = {"last": 24, "shape_frames": 24, "changes": {"refine_frames": True}}
    found = track(replace(attempt(**wanted), tracker=DEFAULT_TRACKER, weighting=DEFAULT_WEIGHTING), cache)
    assert found.mean_mm < 13.0
    assert found.worst_mm < 18.0


@pytest.mark.parametrize("changes", [{}, {"refine_frames": True, "occlusion_aware": True}])
def test_seeds_tracked_side_by_side_are_those_tracked_alone(cache, changes) -> None:
    trial = attempt(changes={**SMALL, **changes})
    together = track_seeds(trial, (3, 4, 9), cache)
    for seed, one in zip((3, 4, 9), together, strict=True):
        assert same(one, track(attempt(seed=seed, changes={**SMALL, **changes}), cache))


def test_seeds_that_fail_together_are_tracked_one_by_one(cache, monkeypatch) -> None:
    trials = [attempt(seed=seed, last=2) for seed in (3, 4)]
    expected = [track(trial, cache) for trial in trials]
    whole, asked = tracked.track_seeds, []

    def too_much(trial, seeds, *given, **words):
        asked.append(len(seeds))
        if len(seeds) > 1:
            raise MemoryError
        return whole(trial, seeds, *given, **words)

    monkeypatch.setattr(tracked, "track_seeds", too_much)
    found = measure_seeds({"trials": [trial.plain() for trial in trials]}, cache)["measured"]
    assert asked == [2, 1, 1]
    assert [{**one, "seconds": 0} for one in found] == [{**asdict(one), "seconds": 0} for one in expected]


@pytest.mark.parametrize(
    ("changes", "most"),
    [
        ({}, 1),
        ({"device": "gpu"}, 64),
        ({"device": "auto", "particles": 10_000}, 20),
        ({"device": "gpu", "particles": 200_000}, 1),
        ({"device": "gpu", "refine_frames": True}, 7),
    ],
)
def test_a_card_searches_so_many_seeds_as_it_holds(changes, most) -> None:
    """Those whose frames the processor refines are shared among its processes."""
    assert seeds_at_once(attempt(changes=changes), 100, 16) == most


def test_attempts_and_results_survive_json(cache) -> None:
    kept = attempt(cameras=("cam1", "cam3"))
    assert TrackingTrial.of_plain(json.loads(json.dumps(kept.plain()))) == kept
    json.dumps(asdict(track(attempt(last=1), cache)), allow_nan=False)


def test_a_later_first_frame_starts_near_the_truth_and_steps_skip_frames(cache) -> None:
    found = track(attempt(first=60, last=70, every=3, changes={"particles": 60}), cache)
    assert found.frames == [60, 63, 66, 69]
    assert found.per_frame_mm[0] < 40.0


def test_damage_changes_the_trackers_input_and_nothing_stored(cache) -> None:
    def blind(evidence: FrameEvidence) -> FrameEvidence:
        views = [
            ViewEvidence(view.camera, view.picture, np.zeros_like(view.mask), np.zeros_like(view.edges))
            for view in evidence.views
        ]
        return FrameEvidence(evidence.frame, tuple(views))

    seen = track(attempt(), cache)
    assert not same(track(attempt(), cache, spoilt=Changed(evidence=blind)), seen)
    assert same(track(attempt(), cache), seen)


def test_layers_and_frames_are_reported(cache) -> None:
    layers, frames = [], []
    with heard_by(lambda step, done, total: frames.append((step, done, total))):
        track(attempt(last=2), cache, on_layer=layers.append)
    assert frames == [("tracking", 1, 2), ("tracking", 2, 2)]
    assert [record.frame for record in layers] == [0] * 6 + [1] * 3


def test_unknown_footage_and_camera_are_named(cache) -> None:
    with pytest.raises(SessionError, match="no-such-walk"):
        track(TrackingTrial("no-such-walk", "annealed", "edge-region", 0), cache)
    with pytest.raises(NotFoundError, match="cam9"):
        track(attempt(cameras=("cam9",)), cache)
    count = cache.session("walk").manifest.frame_count
    with pytest.raises(NotFoundError, match=f"no frame {count}"):
        track(attempt(last=count + 1), cache)


def test_the_cache_drops_the_oldest_evidence_first() -> None:
    cache = FootageCache(SAMPLES, most_bytes=4_000_000)
    session = cache.session("walk")
    cameras = session.cameras()
    try:
        made = [cache.evidence(session, cameras, frame, EvidenceSettings(), "proximity") for frame in (0, 1)]
        assert cache.evidence(session, cameras, 1, EvidenceSettings(), "proximity") is made[1]
        again = cache.evidence(session, cameras, 0, EvidenceSettings(), "proximity")
        assert again is not made[0]
        for one, other in zip(again.views, made[0].views, strict=True):
            np.testing.assert_array_equal(one.mask, other.mask)
            np.testing.assert_array_equal(one.edges, other.edges)
            assert one.picture.size == 0
    finally:
        cache.close()


def test_the_parts_of_an_error_add_up_and_leave_the_poses_as_they_are(cache) -> None:
    usual, split = track(attempt(), cache), track(attempt(split_frames=4), cache)
    assert (split.per_frame_mm, usual.parts_mm) == (usual.per_frame_mm, {})
    assert sum(split.parts_mm.values()) == pytest.approx(split.mean_mm, abs=0.01)
    assert split.parts_mm == track(attempt(split_frames=4), cache).parts_mm


def test_too_few_particles_are_the_searchs_fault_and_wrong_bones_the_bodys(cache) -> None:
    """With the silhouettes' areas, as without them poses far off may outweigh the truth; unrefined, as a refinement
    takes the search's place.
    """
    changes = {"layers": 1, "particles": 3, "refine_frames": False}
    few = track(
        replace(
            attempt(changes=changes, last=2, sigma_scale=3.0, split_frames=1),
            weighting="edge-region-silhouette",
        ),
        cache,
    )
    assert max(few.parts_mm, key=few.parts_mm.get) == "search"
    bones = track(attempt(larger=0.15, last=2, split_frames=1), cache)
    assert bones.parts_mm["body"] > 20.0
    assert track(attempt(last=2, split_frames=1), cache).parts_mm["body"] < 1.0


@pytest.mark.parametrize(
    ("count", "expected"), [(0, []), (1, [15]), (2, [13, 17]), (9, [11, 13, 15, 17, 19])]
)
def test_frames_in_the_middle_of_even_stretches(count, expected) -> None:
    assert tracked.middles(range(11, 21, 2), count) == expected
