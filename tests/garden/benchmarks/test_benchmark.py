"""The benchmark measures the right quantities; speeds are printed by `studio bench`, never asserted in a test."""

import importlib
import json
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from scipy.ndimage import label
from simulated_card import run_simulated

from studio.body.catalogue import load_body
from studio.garden.benchmarks.devices import run_device_benchmark
from studio.garden.benchmarks.kernels import (
    LIMIT_PASSES,
    limit_contest,
    made_evidence,
    ring_of_cameras,
    run_benchmark,
    spans_contest,
)
from studio.garden.benchmarks.results_table import in_lines, rows_of
from studio.search.likelihood.devices import DEVICE_MODULE
from studio.search.likelihood.edge_region import EdgeRegionLikelihood, EdgeRegionSettings
from studio.search.likelihood.silhouette_areas import FULL, silhouettes_of
from studio.search.trackers.particle_swarm import ParticleSwarm
from studio.search.trackers.tempered import TemperedFilter


@pytest.fixture(scope="module")
def result():
    steps = []
    threads = numba.get_num_threads()
    found = run_benchmark(repeats=2, progress=lambda *step: steps.append(step))
    assert numba.get_num_threads() == threads
    assert steps[-1] == ("Weighing", 2, 2)
    return json.loads(json.dumps(found))


def test_the_report(result):
    edge_region = result["edge_region"]
    assert list(edge_region)[:4] == [
        "evaluations_per_second",
        "samples",
        "load_limit_per_second",
        "fraction_of_load_limit",
    ]
    assert ("two_threads" in edge_region) == (numba.get_num_threads() > 1)
    assert result["fractions"]["bodytrack"] > 0.0
    assert edge_region["samples"] == 3200
    ratio = edge_region["evaluations_per_second"] / edge_region["load_limit_per_second"]
    assert edge_region["fraction_of_load_limit"] == pytest.approx(ratio, abs=0.001)
    others = result["others_evaluations_per_second"]
    silhouettes = {
        f"{name}_{resolution}"
        for name in ("edge_silhouette", "edge_region_silhouette")
        for resolution in ("half", "full")
    }
    assert {"edge_region_occlusion_aware", "bodytrack", "template"} | silhouettes <= set(others)
    assert all(rate > 0 for rate in others.values())


def test_the_scene_is_a_person_in_four_pictures():
    body = load_body("human31")
    cameras = ring_of_cameras(body)
    for view in made_evidence(body, cameras, np.random.default_rng(0))["proximity"].views:
        _, pieces = label(view.mask)
        rows = np.flatnonzero(view.mask.any(axis=1))
        assert pieces == 1
        assert 150 < rows[-1] - rows[0] < 300
        assert 0.005 < (view.edges > 128).mean() < 0.2


def test_the_limit_reads_the_weightings_entries():
    """The loads alone add up to the weighting's own terms."""
    body = load_body("human31")
    cameras = ring_of_cameras(body)
    rng = np.random.default_rng(0)
    likelihood = EdgeRegionLikelihood(body, cameras, EdgeRegionSettings())
    problem = likelihood.problem(made_evidence(body, cameras, rng)["proximity"])
    step = np.array([entry.max_step for entry in body.parameters]) / 60.0
    poses = body.neutral + step * rng.normal(size=(32, 31))
    contest = limit_contest(problem, poses)
    assert contest.evaluations == 32 * LIMIT_PASSES
    edge, region = problem.terms(poses)
    sums = contest.run() / LIMIT_PASSES
    assert sums.shape == (2, 4, 16, 2)
    np.testing.assert_allclose(sums[..., 0].transpose(0, 2, 1).reshape(32, 4) / (255 * 320), edge)
    np.testing.assert_allclose(sums[..., 1].transpose(0, 2, 1).reshape(32, 4) / (255 * 480), region)


def test_every_kernel_has_its_limit(result):
    """Rows give figure, limit of the same run, their ratio and the aim."""
    others, limits = result["others_evaluations_per_second"], result["limits_per_second"]
    assert set(limits) == set(others) - {"edge_region_two_threads"}
    rows = rows_of(result)
    with_limits = [row for row in rows if row["limit"] is not None]
    assert len(with_limits) == 1 + len(limits)
    for row in with_limits:
        assert row["of_limit"] == pytest.approx(row["value"] / row["limit"], rel=0.02, abs=0.001)
        if row["aim_of_limit"]:
            assert row["reached"] == pytest.approx(min(row["of_limit"] / row["aim"], 1.0), abs=0.002)
    lines = in_lines(rows)
    assert sum("of limit" in line for line in lines) == 1 + sum(bool(row["aim_of_limit"]) for row in rows)


def test_the_limit_of_areas_counts_the_bodys_spans():
    """The lengths of the spans add up to the areas of the limbs, overlaps counted for each."""
    body = load_body("human31")
    cameras = ring_of_cameras(body)
    evidence = made_evidence(body, cameras, np.random.default_rng(0))["proximity"]
    likelihood = EdgeRegionLikelihood(body, cameras, EdgeRegionSettings())
    poses = np.repeat(body.neutral[None], 16, axis=0)
    contest = spans_contest(likelihood.problem(evidence), evidence, poses, FULL)
    assert contest.evaluations == 16 * LIMIT_PASSES
    sums = contest.run() / LIMIT_PASSES
    areas = silhouettes_of(evidence, FULL).areas(likelihood.projector.blocks(poses), 16)
    # Where limbs overlap spans count again, and so do the full words of the window that are counted.
    bare = areas.projected.T[None]
    assert (sums > bare).all()
    assert (sums < 20 * bare).all()


def test_without_a_card_the_bench_says_so(monkeypatch):
    monkeypatch.setattr(importlib.import_module(DEVICE_MODULE), "missing", lambda: "no card here")
    found = run_device_benchmark()
    assert list(found) == ["none"]
    assert "no card here" in str(found["none"])
    assert rows_of({"gpu": found}) == []


@pytest.mark.slow
def test_frames_of_a_simulated_card_are_measured(tmp_path):
    """A swarm's and a tempered filter's, and those of seeds side by side, which are the ones alone."""
    script = Path(__file__).parents[2] / "search" / "trackers" / "simulated_frames.py"
    found = json.loads(run_simulated(script, tmp_path / "found.json").read_text())
    assert found["swarm"]["evaluations"] == 12
    assert found["seeds"]["same_as_alone"]
    assert found["tempered"]["evaluations"] == 4
    assert min(found["swarm"]["frame"], found["tempered"]["frame"], found["seeds"]["times_one"]) > 0.0
    measures = importlib.import_module("studio.garden.benchmarks.card_measures")
    whole = measures.swarm_of(10_000)
    assert ParticleSwarm().evaluations(whole) == 10_000
    assert abs(TemperedFilter().evaluations(measures.tempered_of(10_000)) - 10_000) < 100
    assert ParticleSwarm().fits_device(0, SimpleNamespace(behaviour=None), whole, {})


def test_a_cards_figures_are_rows_beside_their_limits(monkeypatch):
    """The processor in the card's place, and what only a card has left out."""
    measures = importlib.import_module("studio.garden.benchmarks.card_measures")
    limits = {"loads_allow_M_per_s": 60.0, "launches_take_ms": 2.0}
    alone = {"card_limits": limits, "resident_rates": {"three_M_per_s": 41.0}, "frame_time": {"frame": 70.0}}
    alone |= {"swarm_time": {"frame": 30.0}, "tempered_time": {"frame": 80.0}}
    absent = (
        "card_limits",
        "resident_rates",
        "frame_time",
        "many_runs",
        "seeds_together",
        "swarm_time",
        "tempered_time",
        "copy_times",
    )
    for name in absent:
        monkeypatch.setattr(measures, name, lambda *_, name=name: alone.get(name, {}))
    monkeypatch.setattr("studio.garden.benchmarks.devices.GPU", "cpu")
    found = json.loads(json.dumps(run_device_benchmark((16, 100_000), particles=(10_000,), repeats=1)))
    assert list(found["called"]) == list(found["resident"]) == ["16", "100000"]
    assert found["agreement"]["largest"] == found["agreement"]["again"] == 0.0
    rows = {row["name"]: row for row in rows_of({"gpu": found})}
    three = rows["card: three terms, 100 000 poses there"]
    assert (three["value"], three["limit"], three["reached"]) == (41.0, 60.0, 1.0)
    assert rows["card: annealed 10 × 10 000, a frame"]["reached"] == pytest.approx(15.0 / 70.0, abs=1e-3)
    assert rows["card: swarm of 10 000 evaluations, a frame"]["value"] == 30.0
    assert rows["card: tempered of 10 000 evaluations, a frame"]["reached"] == 0.5
    assert rows["card: largest difference of a log-weight"]["reached"] == 1.0
    assert rows["card: three terms, 100 000 poses here"]["value"] > 0.0
    assert rows["card: the benchmark's score, 100 000 poses here"]["value"] > 0.0
    assert rows["card: largest difference of a benchmark's score"]["value"] == 0.0
