"""The search space of a body."""

import numpy as np
import pytest

from studio.body.catalogue import list_bodies, load_body
from studio.runs.search_space import default_sigma, search_space


@pytest.mark.parametrize("name", list_bodies())
def test_limits_and_limbs_follow_the_parameters(name: str) -> None:
    body = load_body(name)
    space = search_space(body, default_sigma(body, 60.0))
    assert space.names == tuple(entry.name for entry in body.parameters)
    assert (space.lower < space.upper).all()
    assert (space.sigma > 0.0).all()
    # Parameters of one limb are neighbours: crossover by whole limbs cuts between numbers.
    assert set(np.diff(space.limb)) <= {0, 1}
    assert space.limb[0] == 0
    assert len(set(space.limb)) == len({entry.limb for entry in body.parameters})


def test_sigma_of_the_lee_walk_body_is_that_of_its_file_at_60_hz() -> None:
    """Half of 120 σ a second is σ in a frame: 13.73 mm for x, 0.0928 rad for the left knee (its README)."""
    body = load_body("human31")
    sigma = dict(zip((entry.name for entry in body.parameters), default_sigma(body, 60.0), strict=True))
    found = np.array(list(sigma.values()))
    assert np.isclose(found, 13.73, atol=0.01).any()
    assert np.isclose(found[9], 0.0928, atol=1e-3)
