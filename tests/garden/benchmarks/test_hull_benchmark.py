"""The hull's benchmark measures whole hulls of a person, and compares with the paper's table."""

import json

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.evidence.volume.reconstruction import reconstruct
from studio.evidence.volume.tracking_space import box_of
from studio.garden.benchmarks.hulls import (
    DEPTHS,
    VIEWS,
    hull_evidence,
    ring_of_small_cameras,
    run_hull_benchmark,
)


@pytest.mark.slow
def test_the_report() -> None:
    steps = []
    result = json.loads(json.dumps(run_hull_benchmark(repeats=1, progress=lambda *step: steps.append(step))))
    assert steps[-1] == ("Carving hulls", 1, 1)
    rows = result["reconstruction"]
    assert [(row["views"], row["depth"]) for row in rows] == [
        (views, depth) for views in VIEWS for depth in DEPTHS
    ]
    assert [row["paper_ms"] for row in rows] == [11.0, 24.1, 73.5, 11.1, 22.8, 66.0, 12.8, 28.1, 78.6]
    assert all(row["pixels_ms"] > 0 and row["masks_ms"] > 0 for row in rows)
    assert result["pictures"] == "320x240"


@pytest.mark.slow
def test_the_scene_is_a_person() -> None:
    body, cameras = load_body("human25"), ring_of_small_cameras(5)
    evidence = hull_evidence(body, cameras, np.random.default_rng(0))
    for seen in evidence.values():
        hull = reconstruct(seen, cameras, box_of(cameras))
        assert 60e6 < hull.volume() < 180e6
        assert 1650 < hull.top() < 1850
