"""The particles that no behaviour model moves, and how many of them there are.

Beyond the paper, which leaves open what to do with movements that are not in the training data (Caillette et al.
2007, 7.5): a share of every first set is spread by σ0 about the carried poses, whatever the model expects. After the
first weighing both kinds are compared, and where the model's own weigh less the share grows.

Comparing: weights are taken to the power with which a tenth of the set survives, so that the best of each kind count
(the raw ones of most likelihoods are nearly flat, or so peaked that one particle has everything). w̄ is the mean weight
of a kind, and b = w̄_free / (w̄_free + w̄_guided) is the probability that the model is beaten, were both as likely
before. b is smoothed over frames; the share is the knob's value while b <= 1/2 and grows with b, to `LARGEST` where b
reaches 3/4, so that both kinds can always be compared.
"""

import numpy as np

from studio.foundations.arrays import Array, Mask
from studio.search.trackers.annealing import anneal
from studio.search.trackers.tracker import Arrays

FREE, BEATEN = "model_free", "model_beaten"
"""Arrays of a set: (N,) bool, whether a particle was moved without the model; (1,) b, smoothed."""

LARGEST = 0.9
SURVIVING = 0.1
# Weight of the current frame in the smoothing: half of a lasting change takes effect within three frames.
NEWEST = 0.25


def share_of(least: float, grows: bool, extra: Arrays) -> float:
    """Model-free share of the next set. least : the knob's value. extra : arrays of the last frame's final set."""
    if not grows or BEATEN not in extra or least <= 0.0:
        return least
    beaten = float(np.clip(4.0 * extra[BEATEN][0] - 2.0, 0.0, 1.0))
    return least + max(LARGEST - least, 0.0) * beaten


def chosen_free(rng: np.random.Generator, count: int, share: float) -> Mask:
    """(count,) which particles are moved without the model: any of them, at least one unless the share is zero.

    Always uses as many random numbers, so that what is drawn afterwards does not depend on the share.
    """
    free = np.zeros(count, dtype=bool)
    order = rng.permutation(count)
    if share > 0.0:
        free[order[: max(1, round(share * count))]] = True
    return free


def compare_kinds(extra: Arrays, log_weights: Array) -> Arrays:
    """A weighed first set's arrays with b brought up to date by both kinds' weights. log_weights : (N,) log w, -inf
    where rejected.

    Unchanged where the set is all of one kind.
    """
    free = extra.get(FREE)
    if free is None or free.all() or not free.any():
        return extra
    weights = np.exp(anneal(log_weights, SURVIVING).log_weights)
    of_free, of_guided = float(weights[free].mean()), float(weights[~free].mean())
    now = of_free / (of_free + of_guided)
    before = float(extra[BEATEN][0]) if BEATEN in extra else 0.0
    return extra | {BEATEN: np.array([(1.0 - NEWEST) * before + NEWEST * now])}


def share_in(extra: Arrays) -> float:
    """Model-free share of a set, for its record; NaN where no model guides it."""
    return float(extra[FREE].mean()) if FREE in extra else float("nan")
