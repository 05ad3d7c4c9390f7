"""Motion made up by a behaviour model: a walk through the automaton, and the smooth motion that suits it best.

The labels are drawn from γ alone (Caillette et al. 2007, 4.2). The motion is the most probable one for these labels:
the x_1 … x_F that maximise Σ ln N((x_t, x_t - x_{t-1}) | cluster of t), one banded system of linear equations. Eq. 3
and 4 would not do here: without pictures to weigh particles by, what Eq. 4 adds in every frame leads away for good.

Where every recording of a movement ends, the automaton knows no way on but to stay. A walk that gets there begins anew
from a start state, and so does the motion: a cut, as between two takes of a film.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from studio.behaviour.automaton import Automaton
from studio.behaviour.gaussian_mixture import GaussianMixture
from studio.behaviour.model import BehaviourModel
from studio.errors import BehaviourError

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


def generate(
    rng: np.random.Generator, model: BehaviourModel, frames: int, start: int | None = None
) -> tuple[Array, IntArray]:
    """Poses (F, D) at the model's rate, the root at rest, and the automaton's states (F,).

    start : the first state, None for one drawn from s. Raises BehaviourError for less than two frames and a state
    that is not there.
    """
    if frames < 2:
        raise BehaviourError(f"{frames} frames are no motion.", "Ask for two or more.")
    if start is not None and not 0 <= start < model.states:
        raise BehaviourError(
            f"There is no state {start}.", f"The automaton's states go from 0 to {model.states - 1}."
        )
    taken = walk(rng, model.automaton, frames, model.steps_per_frame, start)
    pieces = np.split(taken.labels, np.flatnonzero(taken.begins)[1:])
    values = np.concatenate([likeliest_motion(model.dynamics, labels) for labels in pieces])
    return model.space.poses(values), taken.states


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """states, labels : (F,). begins : (F,) bool, frames that are entered from no other: the first, and after cuts."""

    states: IntArray
    labels: IntArray
    begins: NDArray[np.bool_]


def walk(
    rng: np.random.Generator,
    automaton: Automaton,
    frames: int,
    steps_per_frame: float = 1.0,
    start: int | None = None,
) -> Walk:
    """A walk by τ and γ. A frame takes so many steps on average, 0 among them."""
    states, labels = np.empty(frames, dtype=np.int64), np.empty(frames, dtype=np.int64)
    begins = np.zeros(frames, dtype=np.bool_)
    state, label = _begun(rng, automaton, start)
    begins[0] = True
    taken = 0
    for frame in range(frames):
        while taken < int(frame * steps_per_frame + 1e-9):
            taken += 1
            if _ends(automaton, state):
                state, label = _begun(rng, automaton, None)
                begins[frame] = True
            else:
                state, label = _step(rng, automaton, state)
        states[frame], labels[frame] = state, label
    return Walk(states, labels, begins)


def _begun(rng: np.random.Generator, automaton: Automaton, start: int | None) -> tuple[int, int]:
    """A first state and its label; one that has none takes a step."""
    state = int(rng.choice(automaton.size, p=automaton.start)) if start is None else start
    label = int(automaton.last_symbols[state])
    return (state, label) if label >= 0 else _step(rng, automaton, state)


def _ends(automaton: Automaton, state: int) -> bool:
    """Whether a state leads to itself only, by its own label."""
    label = automaton.last_symbols[state]
    return bool(
        label >= 0
        and automaton.probabilities[state, label] == 1.0
        and automaton.next_state[state, label] == state
    )


def _step(rng: np.random.Generator, automaton: Automaton, state: int) -> tuple[int, int]:
    label = int(rng.choice(automaton.symbols, p=automaton.probabilities[state]))
    return int(automaton.next_state[state, label]), label


def likeliest_motion(dynamics: GaussianMixture, labels: IntArray) -> Array:
    """(F, d) the most probable x_1 … x_F for the clusters (F,) that the frames belong to.

    dynamics : Gaussians of (x, ẋ), 2 d features each. The first frame has the second's derivative; a single frame has
    none, and is its cluster's mean.
    """
    half = dynamics.means.shape[1] // 2
    if len(labels) < 2:
        return dynamics.means[labels, :half]
    precisions = dynamics.whiteners.transpose(0, 2, 1) @ dynamics.whiteners
    wanted = np.einsum("kij,kj->ki", precisions, dynamics.means)
    own = np.zeros((len(labels), half, half))
    before = np.zeros((len(labels), half, half))
    right = np.zeros((len(labels), half))
    for frame, label in enumerate(labels):
        # How (x_t, ẋ_t) comes from the later and the earlier of two frames.
        later, earlier = max(frame, 1), max(frame, 1) - 1
        of_later, of_earlier = np.eye(half), np.zeros((half, half))
        if frame == 0:
            of_later, of_earlier = of_earlier, of_later
        late = np.concatenate([of_later, np.eye(half)])
        early = np.concatenate([of_earlier, -np.eye(half)])
        own[later] += late.T @ precisions[label] @ late
        own[earlier] += early.T @ precisions[label] @ early
        before[later] += late.T @ precisions[label] @ early
        right[later] += late.T @ wanted[label]
        right[earlier] += early.T @ wanted[label]
    return _solved(own, before, right)


def _solved(own: Array, before: Array, right: Array) -> Array:
    """(F, d) the solution of a symmetric block-tridiagonal system.

    own : (F, d, d) blocks of the diagonal. before : (F, d, d), block [t, t - 1]. right : (F, d).
    """
    frames, half = right.shape
    bands = np.zeros((2 * half, frames * half))
    rows, columns = np.indices((half, half))
    for frame in range(frames):
        lower = rows >= columns
        at = frame * half + columns
        bands[(rows - columns)[lower], at[lower]] = own[frame][lower]
        if frame:
            bands[half + rows - columns, at - half] = before[frame]
    return np.asarray(solveh_banded(bands, right.ravel(), lower=True)).reshape(frames, half)
