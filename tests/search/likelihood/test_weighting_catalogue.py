"""The contract of every weighting in the catalogue."""

import dataclasses

import numpy as np
import pytest
from weighting_scene import scattered

from studio.evidence.frame_evidence import EDGE_KINDS
from studio.evidence.settings import EvidenceSettings
from studio.foundations.knobs import knobs_of
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.problem import TRUNK_FIRST

STAGED = ("edge-silhouette", "edge-region-silhouette", "blobs")
FACTORS = {
    **{"edge_weight": 0.5, "region_weight": 1.2, "silhouette_weight": 1.9},
    **{"score_edge_weight": 0.5, "score_inside_weight": 1.2, "fitness_scale": 0.5},
}


def test_the_names():
    assert list(WEIGHTINGS) == [
        "edge-region",
        "edge-silhouette",
        "edge-region-silhouette",
        "bodytrack",
        "template",
        "blobs",
    ]
    assert all(name == entry.name for name, entry in WEIGHTINGS.items())


@pytest.mark.parametrize("name", WEIGHTINGS)
def test_every_weighting_keeps_the_contract(name, human, ring, smooth):
    weighting = WEIGHTINGS[name]
    assert weighting.edge_kind in EDGE_KINDS
    problem = weighting.prepare(human, ring, weighting.settings_type()).problem(smooth)
    poses = scattered(human, 33)
    before = poses.copy()
    weights = problem.log_likelihood(poses)
    assert weights.shape == (33,)
    assert weights.dtype == np.float64
    assert np.isfinite(weights).all()
    assert len(np.unique(weights)) > 25
    trunk_first = problem.log_likelihood(poses, stage=TRUNK_FIRST)
    assert np.isfinite(trunk_first).all()
    assert np.array_equal(trunk_first, weights) == (name not in STAGED)
    fitness = problem.fitness(poses)
    assert fitness.shape == (33,)
    assert np.isfinite(fitness).all()
    np.testing.assert_array_equal(np.argsort(fitness), np.argsort(weights))
    np.testing.assert_array_equal(poses, before)
    assert problem.feasible(poses).shape == (33,)
    assert problem.log_likelihood(np.zeros((0, 31))).shape == (0,)


@pytest.mark.parametrize("name", WEIGHTINGS)
def test_shares_of_cameras_and_terms_add_up_to_the_log_weights(name, human, ring, smooth):
    weighting = WEIGHTINGS[name]
    own = {entry.name for entry in knobs_of(weighting.settings_type)}
    settings = weighting.settings_type(**{knob: value for knob, value in FACTORS.items() if knob in own})
    problem, poses = weighting.prepare(human, ring, settings).problem(smooth), scattered(human, 18)
    shares = problem.shares(poses)
    assert shares.values.shape == (18, len(shares.cameras), len(shares.terms))
    np.testing.assert_allclose(shares.values.sum(axis=(1, 2)), problem.log_likelihood(poses), rtol=1e-9)
    whole = name in ("bodytrack", "blobs")
    assert shares.cameras == (("all cameras",) if whole else tuple(camera.name for camera in ring))
    if name == "edge-silhouette":
        silhouette, edge = problem.terms(poses)
        np.testing.assert_allclose(shares.values, 0.5 / 4 * np.stack([edge, silhouette], axis=2))
    elif name == "edge-region":
        edge, region = problem.terms(poses)
        np.testing.assert_allclose(shares.values, -np.stack([0.5 * edge, 1.2 * region], axis=2))
    elif name == "edge-region-silhouette":
        wanted = np.stack(problem.terms(poses), axis=2) - 1.0
        np.testing.assert_allclose(shares.values, wanted * [0.5, 1.2, 1.9])
    elif name == "bodytrack":
        edge, inside, _ = problem.terms(poses)
        np.testing.assert_allclose(shares.values[:, 0], -np.stack([0.5 * edge, 1.2 * inside], axis=1))
    elif name == "template":
        np.testing.assert_allclose(shares.values[..., 0], -problem.differences(poses))
    else:
        assert shares.terms == ("likelihood",)


def test_settings_are_frozen_hashable_and_have_flat_names_of_their_own():
    evidence = [entry.name for entry in knobs_of(EvidenceSettings)]
    for weighting in WEIGHTINGS.values():
        settings = weighting.settings_type()
        assert hash(settings) == hash(weighting.settings_type())
        assert dataclasses.is_dataclass(settings)
        with pytest.raises((dataclasses.FrozenInstanceError, TypeError)):
            settings.anything = 1
        names = evidence + [entry.name for entry in knobs_of(weighting.settings_type)]
        assert len(names) == len(set(names)), "within a run a name means one knob"
