"""A variable-length Markov model as a probabilistic finite-state automaton (Caillette et al. 2007, section 4.2).

M = (Q, K, τ, γ, s): states are strings of labels ("contexts") of variable length, τ gives the state after a state
and a label, γ the probability of a label, s the distribution of the states. Learning: automaton_learning.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array

IntArray = NDArray[np.int64]
Context = tuple[int, ...]

ROOT = 0


@dataclass(frozen=True, slots=True, eq=False)
class Arcs:
    """The transitions that particles may take, state after state.

    first : (Q + 1,) state q owns first[q]:first[q + 1]. symbols : (T,) labels. log_probabilities : (T,) ln γ.
    """

    first: IntArray
    symbols: IntArray
    log_probabilities: Array


@dataclass(frozen=True, eq=False)
class Automaton:
    """The automaton over K labels with Q states; state 0 is the empty context, without history.

    contexts : Q strings of labels, oldest first. kept : (Q,) bool, contexts that passed the ε test; the others
    make the automaton deterministic, and predict as their longest kept suffix does. next_state : (Q, K) τ.
    probabilities : (Q, K) γ, rows sum to 1. start : (Q,) s, the share of the training frames that each state was
    entered in. smoothing : share of probability spread evenly over all labels in code lengths, and only there.
    back_off : share that `predictions` take from shorter contexts.
    """

    contexts: tuple[Context, ...]
    kept: NDArray[np.bool_]
    next_state: IntArray
    probabilities: Array
    start: Array
    smoothing: float
    back_off: float = 0.0

    @property
    def size(self) -> int:
        """Q, the number of states."""
        return len(self.contexts)

    @property
    def symbols(self) -> int:
        """K, the number of labels."""
        return self.next_state.shape[1]

    @cached_property
    def memory(self) -> int:
        """Length of the longest context."""
        return max(len(context) for context in self.contexts)

    @cached_property
    def last_symbols(self) -> IntArray:
        """(Q,) the label that a state was entered with, its cluster; -1 for the empty context."""
        return np.array([context[-1] if context else -1 for context in self.contexts], dtype=np.int64)

    @cached_property
    def predictions(self) -> Array:
        """(Q, K) γ for particles: the share `back_off` of each is the longest suffix's, down to single labels.

        A long context that was seen a few times excludes nearly all labels; those seen after its suffixes stay
        possible. Where all recordings end, a label leads only to itself; there the share is spread by the labels'
        frequencies.
        """
        found = self.probabilities.copy()
        place = {context: number for number, context in enumerate(self.contexts)}
        for context, number in sorted(place.items(), key=lambda entry: len(entry[0])):
            shorter = next((context[at:] for at in range(1, len(context)) if context[at:] in place), ())
            ends = len(context) == 1 and found[number, context[0]] == 1.0
            if shorter or ends:
                found[number] += self.back_off * (found[place[shorter]] - found[number])
        return found

    @cached_property
    def arcs(self) -> Arcs:
        """The transitions that `predictions` allow, for kernels."""
        states, symbols = np.nonzero(self.predictions)
        first = np.searchsorted(states, np.arange(self.size + 1)).astype(np.int64)
        return Arcs(first, symbols.astype(np.int64), np.log(self.predictions[states, symbols]))

    def state_after(self, labels: Sequence[int] | IntArray, start: int = ROOT) -> int:
        """The state after a history of labels, oldest first, from `start`."""
        state = start
        for label in labels:
            state = int(self.next_state[state, label])
        return state

    def states_along(self, labels: Sequence[int] | IntArray) -> IntArray:
        """(n + 1,) the states of a recording: before its first label, and after each."""
        found = np.empty(len(labels) + 1, dtype=np.int64)
        found[0] = state = ROOT
        for place, label in enumerate(labels):
            found[place + 1] = state = int(self.next_state[state, label])
        return found

    def code_lengths(self, labels: Sequence[int] | IntArray) -> Array:
        """(n,) -ln P(k_i | q_i) of a recording's labels, in nats, with `smoothing`; inf where that is 0 and a label was
        never seen after its state.
        """
        states = self.states_along(labels)[:-1]
        plain = self.probabilities[states, np.asarray(labels, dtype=np.int64)]
        with np.errstate(divide="ignore"):
            return -np.log((1.0 - self.smoothing) * plain + self.smoothing / self.symbols)

    def entropy(self, recordings: Sequence[IntArray]) -> float:
        """Ĥ of Eq. 2, the mean code length of a label in nats (divide by ln 2 for bits), over all recordings.

        Each recording starts in the empty context. NaN for no labels at all.
        """
        lengths = [self.code_lengths(labels) for labels in recordings if len(labels)]
        return float(np.concatenate(lengths).mean()) if lengths else math.nan
