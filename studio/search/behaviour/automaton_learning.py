"""Learning the automaton: contexts of variable length by the ε test (Ron, Singer & Tishby 1996).

A context s = σ s' is worth keeping if it is not rare and predicts differently from its suffix s': some label k that it
makes probable enough has γ(k | s) / γ(k | s') >= 1 + ε or <= 1 / (1 + ε). Longer contexts are tested even below one
that fails; one that passes keeps all its suffixes. The kept strings are the prediction suffix tree; the
automaton that walks it label by label has all their prefixes as states too (then the longest suffix of state and label
is the longest suffix of the whole history), and every label alone, so that a state determines its cluster (5.1).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.errors import BehaviourError
from studio.search.behaviour.automaton import ROOT, Automaton, Context

IntArray = NDArray[np.int64]

# A label counts in the ε test if the context gives it at least this probability: the γ_min of Ron et al.
LEAST_LABEL = 0.001


@dataclass(frozen=True, slots=True)
class ContextTest:
    """Conditions for keeping a context.

    memory : its greatest length. epsilon : ε. least_probability : share of all training labels that must follow it;
    at least two must.
    """

    memory: int
    epsilon: float
    least_probability: float


def learn_automaton(
    recordings: Sequence[IntArray],
    symbols: int,
    test: ContextTest,
    smoothing: float = 0.0,
    back_off: float = 0.0,
) -> Automaton:
    """The automaton of recordings of labels 0 … symbols - 1; histories do not reach across recordings.

    Raises BehaviourError where there are no labels, or one that is not there.
    """
    text = _Text(recordings, symbols)
    counts = _kept_contexts(text, symbols, test)
    contexts = _closed(counts, text.seen if test.memory > 0 else ())
    place = {context: number for number, context in enumerate(contexts)}
    probabilities = np.empty((len(contexts), symbols))
    for context, number in place.items():
        row = counts[_longest_suffix(context, counts)]
        probabilities[number] = row / row.sum()
    next_state = np.array(
        [
            [place[_longest_suffix((*context, label), place)] for label in range(symbols)]
            for context in contexts
        ],
        dtype=np.int64,
    )
    automaton = Automaton(
        contexts=contexts,
        kept=np.array([context in counts for context in contexts]),
        next_state=next_state,
        probabilities=probabilities,
        start=np.zeros(len(contexts)),
        smoothing=smoothing,
        back_off=back_off,
    )
    automaton.start[:] = _visits(automaton, recordings)
    return automaton


class _Text:
    """All labels one after the other. first : (n,) where the recording of each label begins."""

    def __init__(self, recordings: Sequence[IntArray], symbols: int) -> None:
        lengths = [len(labels) for labels in recordings]
        if not sum(lengths):
            raise BehaviourError(
                "There are no labels to learn an automaton from.", "Give at least one recording."
            )
        self.labels = np.concatenate([np.asarray(labels, dtype=np.int64) for labels in recordings])
        if self.labels.min() < 0 or self.labels.max() >= symbols:
            raise BehaviourError(
                f"A label is outside 0 to {symbols - 1}.", "Give labels of the model's own clusters."
            )
        begins = np.concatenate([[0], np.cumsum(lengths)[:-1]])
        self.first = np.repeat(begins, lengths)
        self.seen = tuple((int(label),) for label in np.unique(self.labels))


def _kept_contexts(text: _Text, symbols: int, test: ContextTest) -> dict[Context, Array]:
    """The prediction suffix tree: kept contexts with the counts (K,) of the labels that follow."""
    everything = np.arange(len(text.labels))
    least = max(2.0, test.least_probability * len(everything))
    counts: dict[Context, Array] = {(): _following(text, everything, symbols)}
    kept: set[Context] = {()}
    level: list[tuple[Context, IntArray]] = [((), everything)]
    for length in range(1, test.memory + 1):
        longer: list[tuple[Context, IntArray]] = []
        for context, places in level:
            for label, those in _extensions(text, places, length):
                if len(those) < least:
                    continue
                wider = (label, *context)
                counts[wider] = _following(text, those, symbols)
                longer.append((wider, those))
                if _differs(counts[wider], counts[context], test.epsilon):
                    kept.update(wider[start:] for start in range(len(wider)))
        level = longer
    return {context: counts[context] for context in sorted(kept, key=lambda entry: (len(entry), entry))}


def _extensions(text: _Text, places: IntArray, length: int) -> list[tuple[int, IntArray]]:
    """The places (n,) of a context, split by the label `length` before them; starts of recordings are left out."""
    inside = places[places - length >= text.first[places]]
    if not len(inside):
        return []
    before = text.labels[inside - length]
    order = np.argsort(before, kind="stable")
    found, starts = np.unique(before[order], return_index=True)
    return list(zip((int(label) for label in found), np.split(inside[order], starts[1:]), strict=True))


def _following(text: _Text, places: IntArray, symbols: int) -> Array:
    """(K,) counts of each label at the places."""
    return np.bincount(text.labels[places], minlength=symbols).astype(np.float64)


def _differs(counts: Array, suffix_counts: Array, epsilon: float) -> bool:
    """The ε test: whether some label is 1 + ε times more, or less, probable than after the suffix."""
    here, there = counts / counts.sum(), suffix_counts / suffix_counts.sum()
    matters = here >= LEAST_LABEL
    ratio = here[matters] / there[matters]
    return bool(((ratio >= 1.0 + epsilon) | (ratio * (1.0 + epsilon) <= 1.0)).any())


def _closed(kept: dict[Context, Array], singles: Sequence[Context]) -> tuple[Context, ...]:
    """The kept contexts with all their prefixes and the single labels, the empty one first."""
    found: set[Context] = {(), *singles}
    for context in kept:
        found.update(context[:end] for end in range(len(context) + 1))
    return tuple(sorted(found, key=lambda entry: (len(entry), entry)))


def _longest_suffix(string: Context, among: dict[Context, Array] | dict[Context, int]) -> Context:
    """The longest suffix of a string among the contexts, which include the empty one."""
    for start in range(len(string)):
        if string[start:] in among:
            return string[start:]
    return ()


def _visits(automaton: Automaton, recordings: Sequence[IntArray]) -> Array:
    """(Q,) the share of the labels that lead into each state."""
    entered = np.zeros(automaton.size)
    for labels in recordings:
        np.add.at(entered, automaton.states_along(labels)[1:], 1.0)
    return entered / entered.sum() if entered.sum() else np.eye(automaton.size)[ROOT]
