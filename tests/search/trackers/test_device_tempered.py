"""Tempered sequential Monte Carlo whose particles stay on a card: in Numba's simulator against the processor's, layer
by layer and particle by particle.
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simulated_tempered as made
from compiled_card import FLAG, GENERATIONS, LONG, compiled, kernels_of, needs_compilers, of_type
from scipy.special import ndtr, ndtri
from simulated_card import found_simulated
from simulated_weighing import scene_of

from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.trackers import device_tempered_kernels
from studio.search.trackers.device_tempered_kernels import normal_at, share_below
from studio.search.trackers.frame_prior import FramePrior
from studio.search.trackers.settings import TemperedSettings
from studio.search.trackers.tempered import (
    BEFORE,
    BEFORE_ELIGIBLE,
    BEFORE_PRIOR,
    BEFORE_RAW,
    EXCHANGE,
    KIND,
    ONE_LIMB,
    PARTNER,
    WHOLE,
    TemperedFilter,
)
from studio.search.trackers.tracker import FilterState, LayerRecord


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a process gives whose device is simulated."""
    return found_simulated(Path(made.__file__), tmp_path_factory)


def assert_alike(there: list[LayerRecord], here: list[LayerRecord]) -> None:
    """All that records say, but for the rounding of poses in single precision: no move is taken on one side alone."""
    assert len(there) == len(here)
    for one, other in zip(there, here, strict=True):
        assert one.layer == other.layer
        np.testing.assert_allclose(one.poses, other.poses, atol=2e-5)
        np.testing.assert_allclose(one.log_weights, other.log_weights, atol=1e-3)
        np.testing.assert_array_equal(one.parents, other.parents)
        for name in ("beta", "alpha_reached", "temper", "log_evidence", "best_log_weight"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-3, atol=1e-4)
        for name in ("alpha_wanted", "acceptance"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        for name in ("variance_weighed", "variance_resampled", "variance_diffused", "best", "mean"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-3, atol=2e-5)


@pytest.mark.parametrize("name", made.SCENARIOS)
def test_frames_are_the_processors_but_for_rounding(simulated: dict[str, Any], name: str) -> None:
    """The same seed is the same search: what is drawn, proposed, taken and refused, and how far the ladder goes."""
    found, expected = simulated["scenarios"][name], made.tracked(made.SCENARIOS[name], there=False)
    assert_alike(found["records"], expected["records"])
    ours, theirs = (one["carried"].particles for one in (found, expected))
    np.testing.assert_allclose(np.exp(ours.log_weights), np.exp(theirs.log_weights), rtol=1e-3)
    assert ours.extra == theirs.extra == {}
    first = found["records"][: made.LAYERS]
    assert all((record.poses == record.poses.astype(np.float32)).all() for record in first), "the card's"
    assert np.isnan(first[0].acceptance)
    assert all(0.0 < record.acceptance < 1.0 for record in first[1:])
    if name == "the ladder ends before the layers":
        assert first[-2].temper == first[-1].temper == 2.0
    if name == "the last layer takes the rest":
        assert first[-1].temper + first[-1].beta == pytest.approx(60.0)
        assert first[-1].beta > 1.0
    if name == "without limits":
        assert not made.ValuedProblem().feasible(first[-1].poses).all()
    else:
        assert all(made.ValuedProblem().feasible(record.poses).all() for record in first)


def test_a_search_from_nowhere_is_the_processors(simulated: dict[str, Any]) -> None:
    bounded = dataclasses.replace(made.SPACE, lower=np.full(made.SIZE, -1.0), upper=np.full(made.SIZE, 4.0))
    expected = made.tracked((made.SETTINGS,), there=False, space=bounded, start=FilterState(None), repeats=2)
    assert_alike(simulated["uniform"]["records"], expected["records"])


@pytest.mark.parametrize("name", ["knobs moved", "resumed", "in turns"])
def test_a_frame_whose_knobs_move_and_that_goes_on_elsewhere_is_the_processors(
    simulated: dict[str, Any], name: str
) -> None:
    """Whatever layer was launched ahead: the set that each layer leaves, of the processor's kind, and its record."""
    found, expected = simulated[name], made.layer_by_layer((False,) * made.LAYERS, resumed=False)
    assert_alike(found["records"], expected["records"])
    assert any(record.beta > 0.0 for record in expected["records"][3:])
    kinds = set[int]()
    for ours, theirs in zip(found["sets"][:-1], expected["sets"][:-1], strict=True):
        assert set(ours.extra) == set(theirs.extra)
        np.testing.assert_allclose(ours.poses, theirs.poses, atol=2e-5)
        for key, values in theirs.extra.items():
            assert ours.extra[key].dtype.kind == values.dtype.kind
            np.testing.assert_allclose(ours.extra[key], values, rtol=1e-3, atol=1e-3, err_msg=key)
        kinds |= set(ours.extra[KIND].tolist())
    assert kinds == {WHOLE, ONE_LIMB, EXCHANGE}


def test_a_set_says_what_its_moves_lead_from(simulated: dict[str, Any]) -> None:
    """By the likelihood and the prior themselves; who exchanges limbs does so with one who does with them."""
    for one in simulated["resumed"]["sets"][:4]:
        extra = one.extra
        prior = FramePrior.of_arrays(extra, made.SPACE, bounded=True)
        np.testing.assert_allclose(extra[BEFORE_PRIOR], prior.log_density(extra[BEFORE]), atol=1e-4)
        np.testing.assert_allclose(extra[BEFORE_RAW], made.values_of(extra[BEFORE]), atol=1e-9)
        np.testing.assert_array_equal(extra[BEFORE_ELIGIBLE], extra[BEFORE_RAW])
        pairs = extra[KIND] == EXCHANGE
        assert pairs.sum() == 2 * int(0.4 * made.COUNT / 2)
        partner = extra[PARTNER]
        np.testing.assert_array_equal(partner[partner], np.arange(made.COUNT))
        np.testing.assert_array_equal(partner != np.arange(made.COUNT), pairs)


def test_runs_side_by_side_are_those_of_the_runs_alone(simulated: dict[str, Any]) -> None:
    """Bit for bit."""
    beside, alone = simulated["together"]
    for run in range(2):
        assert len(beside[run]) == 2 * made.LAYERS
        for one, other in zip(beside[run], alone[run], strict=True):
            for field in dataclasses.fields(LayerRecord):
                if field.name != "milliseconds":
                    np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))
    assert not np.array_equal(beside[0][0].poses, beside[1][0].poses)


@pytest.mark.parametrize("name", made.WITHOUT_ROOM)
def test_a_parameter_without_room_keeps_its_value_and_stops_no_move(
    simulated: dict[str, Any], name: str
) -> None:
    """As near as a card has it; what goes on elsewhere has the value itself."""
    found = simulated["without room"][name]
    for record in found["records"]:
        np.testing.assert_array_equal(record.poses[:, 3], np.float32(0.1))
    np.testing.assert_array_equal(found["carried"].particles.poses[:, 3], 0.1)
    if name == "tempered":
        assert min(record.acceptance for record in found["records"][1:]) > 0.1


def test_a_frame_is_weighed_by_the_devices_kernels(simulated: dict[str, Any]) -> None:
    body, cameras, evidence, _ = scene_of("planar_arm4")
    one_view = type(evidence)(evidence.frame, evidence.views[:1])
    settings = EdgeRegionSilhouetteSettings(edge_samples=16, region_samples=16)
    here = EdgeRegionSilhouetteLikelihood(body, cameras[:1], settings).problem(one_view)
    found = simulated["weighed there"]
    assert [record.layer for record in found["records"]] == [0, 1, 2]
    for record in found["records"]:
        np.testing.assert_allclose(record.log_weights, here.log_likelihood(record.poses), atol=1e-3)
    np.testing.assert_allclose(found["estimate"], found["records"][-1].mean, atol=1e-6)


def test_shares_of_normal_numbers_and_back() -> None:
    shares = np.concatenate([np.linspace(1e-9, 1.0 - 1e-9, 400), 10.0 ** -np.linspace(1, 290, 60)])
    np.testing.assert_allclose([normal_at(share) for share in shares], ndtri(shares), rtol=1e-13, atol=1e-15)
    places = np.linspace(-30.0, 8.0, 200)
    np.testing.assert_allclose([share_below(place) for place in places], ndtr(places), rtol=1e-12)
    assert np.isfinite([normal_at(0.0), normal_at(1.0)]).all(), "the limits are set on these"
    assert share_below(-np.inf) == 0.0
    assert share_below(np.inf) == 1.0


@pytest.mark.parametrize(
    ("knobs", "extra", "fits"),
    [
        ({}, {}, True),
        ({"constraints": "ignore"}, {}, True),
        ({}, {BEFORE_ELIGIBLE: np.zeros(3)}, True),
        ({"limbs_apart": True}, {}, False),
        ({}, {BEFORE_ELIGIBLE: np.array([0.0, -np.inf, 0.0])}, False),
    ],
)
def test_what_is_kept_there(knobs: dict[str, Any], extra: dict[str, np.ndarray], fits: bool) -> None:
    """Joint limits; a set in which limbs were kept apart before goes on by the processor."""
    assert TemperedFilter().fits_device(0, made.SPACE, TemperedSettings(**knobs), extra) == fits


@needs_compilers
@pytest.mark.parametrize("capability", GENERATIONS)
def test_every_kernel_compiles_for_a_card(
    monkeypatch: pytest.MonkeyPatch, capability: tuple[int, int]
) -> None:
    f4, f8, u8, parents = (of_type(kind, 2) for kind in ("f4", "f8", "u8", "i4"))
    moments = of_type("f8", 3)
    logs, lots, numbers, place = (of_type(kind) for kind in ("f8", "u4", "i4", "i8"))
    signatures = {
        "share_centres": (f4, LONG, logs, f8, f8, logs),
        "draw_prior": (f4, LONG, logs, f8, f8, f8, u8, LONG, f4),
        "find_densities": (f4, f4, LONG, logs, f8, f8, LONG, logs),
        "take_moves": (
            *(f4, f4, f8, logs, logs, logs, numbers, numbers, logs, f8, u8, LONG),
            *(f4, f8, logs, numbers),
        ),
        "adapt_steps": (numbers, numbers, LONG, FLAG, logs, f8, f8, f8),
        "climb": (f8, f8, LONG, f8),
        "draw_sample": (f4, f8, logs, logs, f8, u8, LONG, FLAG, f4, logs, logs, parents, lots),
        "find_weighted_correlations": (f4, logs, LONG, moments, moments),
        "rank_lots": (lots, logs, LONG, numbers, numbers),
        "propose_moves": (
            *(f4, moments, moments, f8, logs, u8, place, numbers, numbers, LONG),
            *(f4, numbers, numbers, logs),
        ),
    }
    assert kernels_of(device_tempered_kernels) == set(signatures)
    kernels = {name: (getattr(device_tempered_kernels, name), types) for name, types in signatures.items()}
    assert set(compiled(monkeypatch, capability, kernels)) == set(signatures)
