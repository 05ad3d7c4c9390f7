"""The learnt automaton against counting by brute force, and the effect of its knobs."""

import itertools
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from studio.foundations.errors import BehaviourError
from studio.search.behaviour.automaton import Automaton
from studio.search.behaviour.automaton_learning import LEAST_LABEL, ContextTest, learn_automaton

TEST = ContextTest(memory=4, epsilon=0.2, least_probability=0.01)


def random_recordings(seed: int, symbols: int, count: int = 3, length: int = 150) -> list[np.ndarray]:
    """Sequences in which the next label depends on the two before it."""
    rng = np.random.default_rng(seed)
    table = rng.dirichlet(np.full(symbols, 0.4), size=(symbols, symbols))
    found = []
    for _ in range(count):
        labels = list(rng.integers(0, symbols, 2))
        while len(labels) < length:
            labels.append(int(rng.choice(symbols, p=table[labels[-2], labels[-1]])))
        found.append(np.array(labels))
    return found


def followers(recordings: list[np.ndarray], context: tuple[int, ...], symbols: int) -> np.ndarray:
    """How often each label follows the context, by scanning every place of every recording."""
    found = np.zeros(symbols)
    for labels in recordings:
        for place in range(len(context), len(labels)):
            if tuple(labels[place - len(context) : place]) == context:
                found[labels[place]] += 1
    return found


def brute_force_contexts(
    recordings: list[np.ndarray], symbols: int, test: ContextTest
) -> set[tuple[int, ...]]:
    """The contexts that pass the tests, with their suffixes, found by trying all strings."""
    total = sum(len(labels) for labels in recordings)
    kept = {()}
    for length in range(1, test.memory + 1):
        for context in itertools.product(range(symbols), repeat=length):
            here = followers(recordings, context, symbols)
            if here.sum() < max(2, test.least_probability * total):
                continue
            there = followers(recordings, context[1:], symbols)
            for label in range(symbols):
                probability, before = here[label] / here.sum(), there[label] / there.sum()
                if probability < LEAST_LABEL:
                    continue
                if probability / before >= 1 + test.epsilon or before / probability >= 1 + test.epsilon:
                    kept.update(context[start:] for start in range(length))
    return kept


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("symbols", "epsilon"), [(2, 0.05), (3, 0.2), (3, 1.0)])
def test_predictions_are_those_of_a_brute_force_count(seed: int, symbols: int, epsilon: float) -> None:
    recordings = random_recordings(seed, symbols)
    test = replace(TEST, epsilon=epsilon)
    automaton = learn_automaton(recordings, symbols, test)
    kept = brute_force_contexts(recordings, symbols, test)
    assert {c for c, keep in zip(automaton.contexts, automaton.kept, strict=True) if keep} == kept
    counts = {context: followers(recordings, context, symbols) for context in kept}
    # Histories of the training, and others that it never had.
    for labels in [*recordings, *random_recordings(seed + 50, symbols, count=1)]:
        for end in range(len(labels)):
            history = tuple(int(label) for label in labels[:end])
            longest = next(history[start:] for start in range(end + 1) if history[start:] in kept)
            wanted = counts[longest] / counts[longest].sum()
            got = automaton.probabilities[automaton.state_after(history)]
            np.testing.assert_allclose(got, wanted, atol=1e-12)


def test_states_are_deterministic_and_follow_longest_suffixes() -> None:
    automaton = learn_automaton(random_recordings(2, 3), 3, TEST)
    states = set(automaton.contexts)
    for number, context in enumerate(automaton.contexts):
        for label in range(3):
            longer = (*context, label)
            wanted = next(longer[start:] for start in range(len(longer) + 1) if longer[start:] in states)
            assert automaton.contexts[automaton.next_state[number, label]] == wanted
    np.testing.assert_allclose(automaton.probabilities.sum(axis=1), 1.0)


def test_every_state_determines_its_cluster() -> None:
    recordings = random_recordings(4, 4)
    automaton = learn_automaton(recordings, 4, replace(TEST, epsilon=50.0))
    for labels in recordings:
        states = automaton.states_along(labels)[1:]
        np.testing.assert_array_equal(automaton.last_symbols[states], labels)


def test_contexts_are_as_long_as_they_have_to_be() -> None:
    # 1 and 2 are always followed by 0. After a 0 the next label repeats the one before it, every other time.
    rng = np.random.default_rng(1)
    labels: list[int] = []
    for _ in range(150):
        one = int(rng.integers(1, 3))
        labels += [one, 0, one, 0]
    automaton = learn_automaton([np.array(labels)], 3, ContextTest(5, 0.2, 0.02))
    kept = [context for context, keep in zip(automaton.contexts, automaton.kept, strict=True) if keep]
    assert {context for context in kept if context and context[-1] != 0} == {(1,), (2,)}
    assert max(len(context) for context in kept if context and context[-1] == 0) == 4
    lengths = {len(context) for context in kept}
    assert lengths == {0, 1, 2, 3, 4}


def test_a_large_epsilon_collapses_to_no_memory() -> None:
    recordings = random_recordings(0, 3)
    without = learn_automaton(recordings, 3, replace(TEST, memory=0))
    assert without.contexts == ((),)
    large = learn_automaton(recordings, 3, replace(TEST, epsilon=1e6))
    assert large.kept.sum() == 1
    np.testing.assert_array_equal(large.probabilities, np.repeat(without.probabilities, large.size, axis=0))
    assert large.entropy(recordings) == pytest.approx(without.entropy(recordings))
    share = np.bincount(np.concatenate(recordings), minlength=3) / 450
    np.testing.assert_allclose(without.probabilities[0], share)
    assert without.entropy(recordings) == pytest.approx(-(share * np.log(share)).sum())


def test_longer_memory_and_smaller_epsilon_lower_the_training_entropy() -> None:
    recordings = random_recordings(7, 3, count=6, length=400)

    def entropy(**changes: float) -> float:
        test = replace(TEST, **changes)  # pyright: ignore[reportArgumentType]
        return learn_automaton(recordings, 3, test).entropy(recordings)

    by_memory = [entropy(memory=memory) for memory in (0, 1, 2, 4)]
    assert by_memory[0] > by_memory[1] > by_memory[2] > by_memory[3]
    by_epsilon = [entropy(epsilon=epsilon) for epsilon in (0.05, 0.5, 2.0, 1e6)]
    assert all(small <= large for small, large in itertools.pairwise(by_epsilon))
    assert by_epsilon[0] < by_epsilon[-1] - 0.1


def test_rare_contexts_are_not_kept() -> None:
    recordings = random_recordings(3, 3)
    few = learn_automaton(recordings, 3, replace(TEST, least_probability=0.1))
    many = learn_automaton(recordings, 3, replace(TEST, least_probability=0.0))
    assert few.size < many.size
    for context, keep in zip(few.contexts, few.kept, strict=True):
        assert not keep or followers(recordings, context, 3).sum() >= 45


def test_histories_do_not_reach_across_recordings() -> None:
    one, other = np.array([0, 0, 1] * 30), np.array([2, 2, 2] * 30)
    automaton = learn_automaton([one, other], 3, replace(TEST, least_probability=0.0))
    assert not any(1 in context and 2 in context for context in automaton.contexts)
    after_one = automaton.probabilities[automaton.state_after([0, 0, 1])]
    np.testing.assert_array_equal(after_one, [1.0, 0.0, 0.0])


def test_start_is_the_share_of_frames_in_each_state() -> None:
    recordings = random_recordings(8, 3)
    automaton = learn_automaton(recordings, 3, TEST)
    visits = Counter()
    for labels in recordings:
        visits.update(automaton.state_after(labels[:end]) for end in range(1, len(labels) + 1))
    wanted = [visits[state] / 450 for state in range(automaton.size)]
    np.testing.assert_allclose(automaton.start, wanted)


def test_only_seen_transitions_are_possible() -> None:
    recordings = random_recordings(9, 5)
    automaton: Automaton = learn_automaton(recordings, 5, TEST)
    seen = {pair for labels in recordings for pair in itertools.pairwise(labels.tolist())}
    for state, label in zip(*np.nonzero(automaton.probabilities), strict=True):
        context = automaton.contexts[state]
        if automaton.kept[state] and context:
            assert (context[-1], label) in seen


def kept_contexts(recordings: list[np.ndarray], symbols: int, test: ContextTest) -> set[tuple[int, ...]]:
    automaton = learn_automaton(recordings, symbols, test)
    return {context for context, keep in zip(automaton.contexts, automaton.kept, strict=True) if keep}


def pairs(counts: list[list[int]]) -> list[np.ndarray]:
    """Recordings of two labels each, as many of each pair as counted."""
    return [
        np.array([one, other])
        for one, row in enumerate(counts)
        for other, count in enumerate(row)
        for _ in range(count)
    ]


def test_a_label_that_is_1_plus_epsilon_times_as_probable_to_the_last_digit_keeps_a_context() -> None:
    # 0 is a quarter of all labels, and three eighths of those after a 0; 1 is less probable there by 5/6.
    more = pairs([[3, 5], [1, 15]])
    assert (0,) in kept_contexts(more, 2, ContextTest(1, 0.5, 0.0))
    assert (0,) not in kept_contexts(more, 2, ContextTest(1, 0.51, 0.0))
    # Both labels are as frequent; after each there is three times as often the same again.
    less = pairs([[3, 1], [1, 3]])
    assert kept_contexts(less, 2, ContextTest(1, 1.0, 0.0)) == {(), (0,), (1,)}
    assert kept_contexts(less, 2, ContextTest(1, 1.01, 0.0)) == {()}


def test_a_context_is_tried_where_it_has_two_followers_or_the_least_share_of_all_labels() -> None:
    once = [np.array([0] * 30 + [1, 2]), np.array([0] * 10)]
    twice = [np.array([0] * 30 + [1, 2]), np.array([0] * 10 + [1, 2])]
    assert (1,) not in kept_contexts(once, 3, ContextTest(1, 0.5, 0.0))
    assert (1,) in kept_contexts(twice, 3, ContextTest(1, 0.5, 0.0))
    # Two followers of 44 labels.
    assert (1,) in kept_contexts(twice, 3, ContextTest(1, 0.5, 2 / 44))
    assert (1,) not in kept_contexts(twice, 3, ContextTest(1, 0.5, 2.1 / 44))


def test_a_label_that_a_context_hardly_gives_does_not_count() -> None:
    # After a 0, 3 follows once in a thousand and one times, and nowhere else: many times as often as after anything.
    counts = np.array([[400, 300, 300, 0], [400, 300, 300, 0], [400, 300, 300, 0]])
    counts[0, 3] = 1
    rare, frequent = counts.tolist(), counts.tolist()
    frequent[0][0] -= 1
    assert (0,) not in kept_contexts(pairs(rare), 4, ContextTest(1, 1.0, 0.0))
    assert (0,) in kept_contexts(pairs(frequent), 4, ContextTest(1, 1.0, 0.0))


def test_smoothing_and_back_off_are_passed_on() -> None:
    automaton = learn_automaton(random_recordings(1, 3), 3, TEST, smoothing=0.02, back_off=0.3)
    assert (automaton.smoothing, automaton.back_off) == (0.02, 0.3)


@pytest.mark.parametrize(
    ("recordings", "words"),
    [
        ([], "no labels to learn"),
        ([np.zeros(0, dtype=int)], "no labels to learn"),
        ([np.array([0, 3])], "outside 0 to 2"),
        ([np.array([0, -1])], "outside 0 to 2"),
    ],
)
def test_bad_labels_are_refused(recordings: list[np.ndarray], words: str) -> None:
    with pytest.raises(BehaviourError, match=words):
        learn_automaton(recordings, 3, TEST)
