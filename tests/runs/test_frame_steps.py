"""What a search starts from when frames between were not tracked."""

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.runs.frame_steps import LONGEST_SECONDS, carried_over, space_over, steps_between
from studio.runs.search_space import default_sigma, search_space
from studio.search.trackers.tracker import FilterState


def test_steps_are_the_frames_that_passed_up_to_a_quarter_second() -> None:
    assert steps_between(None, 40, 30.0) == 1
    assert steps_between(4, 5, 30.0) == 1
    assert steps_between(4, 7, 30.0) == 3
    assert steps_between(4, 400, 30.0) == round(30.0 * LONGEST_SECONDS)
    assert steps_between(4, 9, 2.0) == 1, "half a second a frame is longer than that by itself"


def test_noise_over_three_frames_is_that_of_footage_at_a_third_of_the_rate() -> None:
    body = load_body("human25")
    space = search_space(body, default_sigma(body, 60.0))
    assert space_over(space, 1) is space
    longer = space_over(space, 3)
    assert longer.steps == 3
    assert np.allclose(longer.sigma, default_sigma(body, 20.0))


@pytest.mark.parametrize(("steps", "before"), [(2, 1), (1, 2), (3, 3)])
def test_the_last_movement_goes_on_at_its_own_speed(steps: int, before: int) -> None:
    speed = np.array([1.0, -2.0])
    last = np.array([10.0, 20.0])
    carried = FilterState(None, last, last - before * speed)
    onwards = carried_over(carried, steps, before)
    assert np.allclose(2.0 * onwards.estimate - onwards.previous_estimate, last + steps * speed)


def test_without_a_movement_nothing_is_stretched() -> None:
    carried = FilterState(None, np.zeros(2))
    assert carried_over(carried, 3, 1) is carried
