"""How evaluations are parted, what a layer is planned to do, and what a search counts."""

import numpy as np
import pytest
from toy_problems import Bowl, toy_space

from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.condensation import SCALES, Condensation
from studio.search.trackers.diffusion import planned_sigma
from studio.search.trackers.frame_loop import FrameSearch
from studio.search.trackers.particle_swarm import ParticleSwarm, acceleration, constriction
from studio.search.trackers.settings import AnnealedSettings, CondensationSettings
from studio.search.trackers.swarm_settings import SwarmSettings
from studio.search.trackers.tracker import FilterState, LayerRecord, ParticleSet


def test_evaluations_are_parted_into_layers_and_particles() -> None:
    annealed, swarm = AnnealedParticleFilter(), ParticleSwarm()
    assert annealed.evaluation_knobs(100, 1) == {"layers": 1, "particles": 100}
    assert annealed.evaluation_knobs(100, 0) == {"layers": 0, "particles": 100}
    assert annealed.evaluation_knobs(1000, 10) == {"layers": 10, "particles": 100}
    assert annealed.least_evaluations(7) == 14
    assert Condensation().evaluation_knobs(300, 5) == {"particles": 300}
    assert Condensation().least_evaluations(5) == 2
    assert swarm.least_evaluations(3) == 2 * 60
    for wanted in range(120, 3000, 20):
        knobs = swarm.evaluation_knobs(wanted, 1)
        assert (knobs["stage1_iterations"], knobs["stage2_iterations"]) == (20, 40)
        assert 20 * knobs["stage1_particles"] + 40 * knobs["stage2_particles"] == wanted
        assert knobs["stage1_particles"] >= 2
        assert abs(knobs["stage2_particles"] - 2 * knobs["stage1_particles"]) <= 4
    assert swarm.evaluation_knobs(1000, 1)["stage1_particles"] == 10


def test_an_annealed_layers_plan_is_its_share_its_children_and_its_noise() -> None:
    tracker, space = AnnealedParticleFilter(), toy_space(6)
    knobs = AnnealedSettings(layers=3, crossover=0.3)
    for layer in range(3):
        plan = tracker.plan_layer(layer, space, knobs, {})
        assert plan.crossed == 0.3
        assert np.isnan(plan.beta)
        assert (plan.noise is None) == (layer == 2)
    shrunk = tracker.plan_layer(
        0, space, AnnealedSettings(layers=3, diffusion_fraction=0.6, diffusion_form="shrink"), {}
    ).noise
    assert (shrunk.sigma, shrunk.scale, shrunk.kept) == (None, 0.6, pytest.approx(0.8))
    knobs = AnnealedSettings(layers=3, diffusion_form="paper", diffusion_constant=0.25)
    wide = tracker.plan_layer(0, space, knobs, {}).noise
    assert (wide.sigma, wide.scale, wide.kept) == (None, 0.5, 1.0)
    planned = AnnealedSettings(layers=3, adaptive_diffusion=False, diffusion_scale=2.0)
    from_plan = tracker.plan_layer(1, space, planned, {})
    rates = [tracker.plan_layer(layer, space, planned, {}).survival for layer in range(3)]
    np.testing.assert_allclose(
        from_plan.noise.sigma, planned_sigma(2.0 * space.sigma, rates, planned.diffusion_decay)
    )
    assert (from_plan.noise.scale, from_plan.noise.kept, from_plan.noise.correlated) == (1.0, 1.0, False)


def test_condensation_chooses_its_scale_as_often_as_the_settings_say_and_uses_their_mean() -> None:
    tracker, knobs, space = (
        Condensation(),
        CondensationSettings(scale_frames=2, scale_survival=0.3),
        toy_space(6),
    )
    record = LayerRecord(
        layer=0, beta=4.0, variance_weighed=np.zeros(6), variance_resampled=np.zeros(6), variance_diffused=np.zeros(6),
        best=np.zeros(6), best_log_weight=0.0, mean=np.zeros(6), poses=np.zeros((1, 6)), log_weights=np.zeros(1),
    )  # fmt: skip
    for scales, kept in (([], [np.log(4.0)]), ([0.5], [0.5, np.log(4.0)]), ([0.5, 1.5], [0.5, 1.5])):
        extra = {SCALES: np.array(scales)}
        plan = tracker.plan_layer(0, space, knobs, extra)
        assert plan.noise is None
        if len(scales) < 2:
            assert plan.survival == 0.3
            assert np.isnan(plan.beta)
        else:
            assert plan.beta == pytest.approx(np.exp(1.0))
            assert np.isnan(plan.survival)
        np.testing.assert_allclose(tracker.kept_of_layer(extra, record, knobs)[SCALES], kept)
    assert tracker.plan_layer(0, space, knobs, {}).survival == 0.3


def test_a_swarms_numbers_are_those_of_equations_2_and_3() -> None:
    assert [acceleration(k, 12, 2.05, 2.15) for k in (2, 7, 12)] == pytest.approx([2.05, 2.1, 2.15])
    for c in (2.05, 2.15, 3.0):
        phi = 2.0 * c
        # χ is such that a particle's slowest mode is damped: χ² (φ - 2) = … by Eq. 3 itself, solved the other way.
        chi = constriction(c)
        assert chi * (phi - 2.0 + np.sqrt(phi * (phi - 4.0))) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("rules", "apart", "fits"),
    [
        ("ignore", True, True),
        ("clamp", False, True),
        ("redraw", False, True),
        ("clamp", True, False),
        ("reject", False, False),
    ],
)
def test_a_card_does_what_only_limits_constrain(rules: str, apart: bool, fits: bool) -> None:
    knobs = SwarmSettings(constraints=rules, limbs_apart=apart)
    assert ParticleSwarm().fits_device(0, toy_space(6), knobs, {}) == fits
    filters = AnnealedSettings(layers=2, constraints=rules, limbs_apart=apart)
    expected = not apart and rules in ("clamp", "ignore")
    assert AnnealedParticleFilter().fits_device(0, toy_space(6), filters, {}) == expected


def test_a_search_expects_its_set_then_the_pose_moved_on_and_the_last_one() -> None:
    space, particles = toy_space(6), ParticleSet(np.full((5, 6), 0.3), np.zeros(5))
    last, before = np.full(6, 1.0), np.full(6, 0.75)
    for previous, places in (
        (FilterState(particles), [0.3]),
        (FilterState(particles, last), [0.3, 1.0]),
        (FilterState(particles, last, before), [0.3, 1.25, 1.0]),
    ):
        search = FrameSearch(AnnealedParticleFilter(), previous, space, seed=0, frame=0)
        found = search._expected(particles, AnnealedSettings())
        np.testing.assert_allclose(found, np.array(places)[:, None] * np.ones(6))


def test_evaluations_and_times_add_up_over_layers() -> None:
    search = FrameSearch(AnnealedParticleFilter(), FilterState(None), toy_space(6), seed=0, frame=4)
    knobs = AnnealedSettings(layers=3, particles=20)
    records = [search.step(Bowl(np.zeros(6)), 7, knobs) for _ in range(3)]
    assert search.state.evaluations == 60
    assert search.state.milliseconds == pytest.approx(sum(record.milliseconds for record in records))
    assert all(record.milliseconds > 0.0 for record in records)
    assert [(record.frame, record.layer, record.settings_version) for record in records] == [
        (4, n, 7) for n in range(3)
    ]
    result = search.result()
    assert (result.layers, result.evaluations, result.settings_version) == (3, 60, 7)
