"""The benchmark's score on a card: in Numba's simulator against the processor, as PTX, and where there is no card."""

import importlib
from pathlib import Path

import numba
import numpy as np
import pytest
import simulated_score as made
from compiled_card import GENERATIONS, LONG, SINGLE, compiled, kernels_of, needs_compilers, of_type
from simulated_card import found_simulated
from weighting_scene import four_cameras

from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera_table import camera_table, outward_limit
from studio.search.likelihood import device_score_kernels, devices


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """What a card's kernels give, in a process whose card is simulated."""
    return found_simulated(Path(made.__file__), tmp_path_factory)


def test_a_cards_score_is_the_processors(simulated):
    """But for samples whose place is rounded into the next pixel; as many samples count."""
    problem, poses = made.problem_of("cpu")
    expected = problem.log_likelihood(poses)
    np.testing.assert_allclose(simulated["weights"], expected, atol=1e-3)
    assert np.ptp(expected[:-1]) > 0.02
    assert simulated["weights"][-1] == -(0.7 + 1.3), "no camera sees it"
    edge, inside, counted = (terms[:-1] for terms in problem.terms(poses))
    errors, on_edges, empty, within = simulated["sums"].sum(axis=1)[:-1, :4].T
    np.testing.assert_allclose(np.stack([on_edges, within], axis=1), counted, atol=2)
    assert counted[2, 1] < 0.9 * counted[0, 1], "some samples are beyond the pictures"
    np.testing.assert_allclose(errors / (255.0 * 255.0 * on_edges), edge, atol=1e-3)
    np.testing.assert_allclose(empty / within, inside, atol=5e-3)
    assert not simulated["sums"][..., 4:].any()


def test_weights_are_pooled_over_views_and_worst_where_nothing_is_seen():
    """Of sums by hand: samples count alike, whichever view they are of."""
    sums = np.zeros((3, 2, 6), np.float32)
    sums[0, :, :4] = [65025.0, 4.0, 3.0, 4.0], [65025.0 * 5.0, 8.0, 1.0, 12.0]
    sums[1, 1, :4] = [0.0, 2.0, 0.0, 0.0]
    found = np.zeros((2, 3))
    weigh_one_by_one(sums, np.array([2.0, 3.0, 0.0]), found)
    np.testing.assert_allclose(found, [[-(2.0 * 0.5 + 3.0 * 0.25), -3.0, -5.0]] * 2, rtol=1e-12)


def weigh_one_by_one(sums, factors, found):
    """`weigh_scores` as plain Python, a pose at a time."""
    kernel = device_score_kernels.weigh_scores
    for pose in range(len(sums)):
        grid = type("Cuda", (), {"grid": staticmethod(lambda dimensions, pose=pose: pose)})
        names = {**kernel.__globals__, "cuda": grid}
        type(kernel)(kernel.__code__, names)(sums, factors, found)


@needs_compilers
@pytest.mark.parametrize("capability", GENERATIONS)
def test_every_kernel_compiles_for_a_card(monkeypatch, capability):
    table = numba.typeof(camera_table(four_cameras(), outward_limit, np.float32))
    f4, f4s, f8, numbers = of_type("f4", 2), of_type("f4", 3), of_type("f8", 2), of_type("i4")
    maps = of_type("u2"), of_type("u4")
    kernels = {
        "add_scores": (
            device_score_kernels.score_kernel(10).py_func,
            (f4, numbers, f4, numbers, table, of_type("i4", 3), *maps, LONG, SINGLE, f4s),
        ),
        "weigh_scores": (device_score_kernels.weigh_scores, (f4s, of_type("f8"), f8)),
    }
    assert kernels_of(device_score_kernels) == {"weigh_scores"}
    assert "div.s64" not in compiled(monkeypatch, capability, kernels)["add_scores"]


def test_a_card_that_is_not_there_or_fails_leaves_the_score_to_the_processor(monkeypatch):
    problem, poses = made.problem_of("cpu")
    expected = problem.log_likelihood(poses)
    device = importlib.import_module(devices.DEVICE_MODULE)
    monkeypatch.setattr(device, "missing", lambda: "no card here")
    with pytest.raises(StudioError, match="no card here"):
        made.problem_of("gpu")
    without, _ = made.problem_of("auto")
    assert "no card here" in without.notes[0]
    assert without.on_device() is None
    np.testing.assert_array_equal(without.log_likelihood(poses), expected)

    class Failing:
        def __init__(self, *_):
            pass

        def frame(self, maps):
            return "a frame"

        def weights(self, *_):
            raise RuntimeError("unspecified launch failure")

    monkeypatch.setattr(device, "missing", lambda: "")
    monkeypatch.setattr(
        importlib.import_module("studio.search.likelihood.device_score"), "ScoreDevice", Failing
    )
    failing, _ = made.problem_of("auto")
    there = failing.on_device()
    assert (there.frame, there.factors, there.trunk) == ("a frame", (0.7, 1.3, 0.0), None)
    np.testing.assert_array_equal(failing.log_likelihood(poses), expected)
    assert "unspecified launch failure" in failing.notes[0]
    assert failing.on_device() is None
    asked_for, _ = made.problem_of("gpu")
    with pytest.raises(StudioError, match="unspecified launch failure"):
        asked_for.log_likelihood(poses)
