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
