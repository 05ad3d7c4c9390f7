"""The automaton's entropy (Eq. 2) by hand, and its paths."""

import math
from dataclasses import replace

import numpy as np
import pytest

from studio.search.behaviour.automaton import Automaton


@pytest.fixture
def automaton() -> Automaton:
    """Over labels 0 and 1: states (), 0, 1 and 01; 2 was never seen."""
    return Automaton(
        contexts=((), (0,), (1,), (0, 1)),
        kept=np.array([True, True, True, False]),
        next_state=np.array([[1, 2, 0], [1, 3, 0], [1, 2, 0], [1, 2, 0]]),
        probabilities=np.array([[0.5, 0.5, 0.0], [0.25, 0.75, 0.0], [1.0, 0.0, 0.0], [0.2, 0.8, 0.0]]),
        start=np.array([0.0, 0.5, 0.25, 0.25]),
        smoothing=0.0,
    )


def smoothed(automaton: Automaton, share: float) -> Automaton:
    return Automaton(
        automaton.contexts,
        automaton.kept,
        automaton.next_state,
        automaton.probabilities,
        automaton.start,
        share,
    )


def test_entropy_by_hand(automaton: Automaton) -> None:
    # () -0-> 0 (1/2), 0 -0-> 0 (1/4), 0 -1-> 01 (3/4), 01 -1-> 1 (4/5), 1 -0-> 0 (1)
    length = -math.log(0.5 * 0.25 * 0.75 * 0.8 * 1.0)
    assert automaton.entropy([np.array([0, 0, 1, 1, 0])]) == pytest.approx(length / 5)
    # Every recording starts again: () -1-> 1 (1/2).
    both = automaton.entropy([np.array([0, 0, 1, 1, 0]), np.array([1])])
    assert both == pytest.approx((length + math.log(2.0)) / 6)


def test_entropy_of_nothing_is_not_a_number(automaton: Automaton) -> None:
    assert math.isnan(automaton.entropy([]))
    assert math.isnan(automaton.entropy([np.zeros(0, dtype=np.int64)]))


def test_unseen_labels_have_a_finite_code_length_with_smoothing(automaton: Automaton) -> None:
    unseen = [np.array([1, 1, 2])]
    assert automaton.entropy(unseen) == math.inf
    soft = smoothed(automaton, 0.03)
    wanted = [0.97 * 0.5 + 0.01, 0.01, 0.01]
    np.testing.assert_allclose(soft.code_lengths(unseen[0]), -np.log(wanted))
    totals = [sum(math.exp(-soft.code_lengths([0, 1, label])[-1]) for label in range(3))]
    assert totals == pytest.approx([1.0])


def test_walk(automaton: Automaton) -> None:
    labels = [0, 1, 1, 0, 2, 1]
    np.testing.assert_array_equal(automaton.states_along(labels), [0, 1, 3, 2, 1, 0, 2])
    assert automaton.state_after(labels) == 2
    assert automaton.state_after([1], start=1) == 3
    np.testing.assert_array_equal(automaton.last_symbols, [-1, 0, 1, 1])
    assert (automaton.size, automaton.symbols, automaton.memory) == (4, 3, 2)


def test_predictions_back_off_to_shorter_contexts(automaton: Automaton) -> None:
    np.testing.assert_array_equal(automaton.predictions, automaton.probabilities)
    soft = replace(automaton, back_off=0.1)
    wanted = automaton.probabilities.copy()
    # 01 has 1 as its suffix; 0 and 1 are single labels and keep theirs.
    wanted[3] = 0.9 * wanted[3] + 0.1 * wanted[2]
    np.testing.assert_allclose(soft.predictions, wanted)
    np.testing.assert_array_equal(soft.probabilities, automaton.probabilities)
    # Where a label leads to itself alone, anything may follow.
    ending = replace(
        soft, probabilities=np.array([[0.5, 0.5, 0], [0, 1, 0], [0, 1, 0], [0, 1, 0]], dtype=float)
    )
    np.testing.assert_allclose(ending.predictions[2], [0.05, 0.95, 0.0])
    np.testing.assert_allclose(ending.predictions[3], 0.9 * np.array([0, 1, 0]) + 0.1 * ending.predictions[2])
    np.testing.assert_array_equal(ending.predictions[1], [0.0, 1.0, 0.0])


def test_arcs_are_the_transitions_above_zero(automaton: Automaton) -> None:
    arcs = automaton.arcs
    assert arcs.first.tolist() == [0, 2, 4, 5, 7]
    for state in range(automaton.size):
        own = slice(arcs.first[state], arcs.first[state + 1])
        np.testing.assert_array_equal(arcs.symbols[own], np.flatnonzero(automaton.probabilities[state]))
        chosen = automaton.probabilities[state, arcs.symbols[own]]
        np.testing.assert_allclose(np.exp(arcs.log_probabilities[own]), chosen)
