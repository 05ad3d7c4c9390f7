"""The prior of body sizes against densities written out and finite differences."""

import numpy as np
import pytest
from scipy.stats import cauchy, multivariate_normal

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.shape_space import ShapeSpace, shape_space
from studio.body.subject import Subject, fit_subject
from studio.search.trackers.shape_prior import ShapePrior, ShapeSpreads

SPREADS = ShapeSpreads(length=0.06, radius=0.15, size=0.05, height=15.0)


@pytest.fixture(scope="module")
def space() -> ShapeSpace:
    body, _ = fit_subject(load_body("human31"), Subject(height_mm=1750.0))
    return shape_space(body)


def test_the_density_is_that_of_scipy(space: ShapeSpace) -> None:
    rng = np.random.default_rng(1)
    shapes = 0.05 * rng.normal(size=(6, len(space.groups)))
    long = np.array([group.kind == "length" for group in space.groups])
    spread = np.diag(np.where(long, 0.06, 0.15) ** 2) + 0.05**2 * np.outer(long, long)
    prior = ShapePrior(space, SPREADS, 1740.0)
    heights = [prior.height(shape) for shape in shapes]
    wanted = multivariate_normal.logpdf(shapes, np.zeros(len(long)), spread)  # pyright: ignore[reportArgumentType]
    wanted = wanted + 0.5 * (cauchy.logpdf(heights, 1740.0, 15.0) - cauchy.logpdf(1740.0, 1740.0, 15.0))
    found = prior.log(shapes)
    np.testing.assert_allclose(found - found[0], wanted - wanted[0], atol=1e-9)


def test_the_height_is_the_standing_bodys(space: ShapeSpace) -> None:
    shape = np.full(len(space.groups), 0.01)
    body = space.body_of(shape)
    there = limb_ends(body, body.neutral)[0, ..., 2].max()
    assert ShapePrior(space, SPREADS, None).height(shape) == pytest.approx(there, abs=0.5)


def test_equations_are_the_density_and_its_slope(space: ShapeSpace) -> None:
    shape = 0.05 * np.random.default_rng(2).normal(size=len(space.groups))
    for height in (None, 1700.0):
        prior = ShapePrior(space, SPREADS, height)
        loss, gradient, matrix = prior.equations(shape)
        assert loss == pytest.approx(-2.0 * prior.log(shape[None])[0])
        nudged = np.concatenate([shape + 1e-5 * np.eye(len(shape)), shape - 1e-5 * np.eye(len(shape))])
        ups, downs = np.split(-prior.log(nudged), 2)
        np.testing.assert_allclose(gradient, (ups - downs) / 2e-5, rtol=1e-4, atol=1e-4)
        assert (np.linalg.eigvalsh(matrix) > 0.0).all()


def test_a_wrong_reported_height_is_overruled(space: ShapeSpace) -> None:
    """Near the reported height a centimetre costs much, eight centimetres away little."""
    prior, bare = ShapePrior(space, SPREADS, 1750.0), ShapePrior(space, SPREADS, None)
    long = np.array([group.kind == "length" for group in space.groups], dtype=float)
    scale = (1750.0 - 1740.0) / (prior.height(long) - prior.height(0.0 * long))
    away = np.outer([0.0, 1.0, 8.0, 9.0], scale * long)
    cost = bare.log(away) - prior.log(away)
    assert cost[0] < 0.05
    assert cost[3] - cost[2] < 0.7 * (cost[1] - cost[0])


def test_flesh_off_the_bone_meets_a_wall_three_spreads_away() -> None:
    space = shape_space(load_body("human35"), lengths=False, radii=False, flesh=True)
    prior = ShapePrior(space, SPREADS, None)
    for name in ("head_forward", "pelvis_forward"):
        along = (np.array(space.names) == name).astype(float)
        costs = -2.0 * prior.log(np.outer([2.0, 3.0, -3.0, 3.2, -4.0], prior.sigma * along))
        np.testing.assert_allclose(costs, [4.0, 9.0, 9.0, 3.2**2 + 25.0 * 0.04, 16.0 + 25.0])
        beyond = -3.5 * prior.sigma * along
        loss, gradient, matrix = prior.equations(beyond)
        assert loss == pytest.approx(-2.0 * prior.log(beyond[None])[0])
        step = 1e-6 * along
        slope = float(np.diff(-prior.log(np.stack([beyond - step, beyond + step])))[0]) / 2e-6
        assert gradient @ along == pytest.approx(slope, rel=1e-5)
        assert along @ matrix @ along == pytest.approx(26.0 / (prior.sigma @ along) ** 2)
    # Ratios, such as a head's breadth, have none.
    ratio = np.array([group.kind == "ratio" for group in space.groups]) / np.sqrt(3.0)
    assert -2.0 * prior.log((4.0 * prior.sigma * ratio)[None])[0] == pytest.approx(16.0)
