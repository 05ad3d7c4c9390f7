"""How a swarm's frame is divided into stages, each a search of its own (Fleischmann et al. 2012, section 2.4).

A stage moves the parameters that its `freedom` leaves free and starts from the best pose of the stage before.
n1, i1, n2, i2 are the knobs (Table 1: 10 × 20 and 20 × 40); every partition weighs n1 i1 + n2 i2 poses:

- soft: the root (x1 … x6) with n1 × i1; then all, σ of the position divided, with n2 × i2.
- soft-three: the root with n1 × i1; then what is nearest to it (trunk, head, hips, shoulders) as well, and then
  all, σ of the position divided in both, with n2 × i2/2 each. The paper does not give the division: our choice.
- hard-two: the root with n1 × i1; then all but the root with n2 × i2 (Fig. 2a).
- hard-twelve: the 12 subspaces of John, Trucco & Ivekovic 2010 in the order of the tree, n1 particles each (they
  have 10 too), which share (n1 i1 + n2 i2) / n1 iterations. A body with more subspaces has its smallest
  neighbours joined, one with fewer has more iterations for each.
- global-local: the whole pose with n2 × i2; then each kind of limb alone (legs, arms; Krzeszowski, Kwolek &
  Wojciechowski 2011) with n1 particles, which share i1 iterations.
- global: the whole pose at once with n2 particles in (n1 i1 + n2 i2) / n2 iterations.

Only hard-twelve and global may round: their total is the nearest multiple of n1 or n2. Only torso edges are
used while only the root moves in the first stage of the soft and hard-two partitions (Table 1).
"""

import functools
import itertools
from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array, Mask
from studio.search.likelihood.problem import TRUNK_FIRST, WHOLE_BODY
from studio.search.trackers.swarm_settings import KINDS_OF_LIMBS, TWELVE, SwarmSettings
from studio.search.trackers.tracker import Hierarchy

ROOT, NEAR = 0, 1


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One search. freedom : (D,) factor on σ, 0 where a parameter is fixed. looks_at : the problem's
    stage, WHOLE_BODY or TRUNK_FIRST.
    """

    freedom: Array
    particles: int
    iterations: int
    looks_at: int = WHOLE_BODY


@dataclass(frozen=True, slots=True)
class Moment:
    """Position of a layer. number : of its stage. iteration : k of Eq. 2, from 1."""

    number: int
    iteration: int


def layer_count(settings: SwarmSettings) -> int:
    """Iterations of all stages together, whatever the body."""
    if settings.partition == "hard-twelve":
        return _nearest(settings.wanted_evaluations, settings.stage1_particles)
    if settings.partition == "global":
        return _nearest(settings.wanted_evaluations, settings.stage2_particles)
    return settings.stage1_iterations + settings.stage2_iterations


def evaluations(settings: SwarmSettings) -> int:
    """Poses weighed in a frame, whatever the body."""
    if settings.partition == "hard-twelve":
        return settings.stage1_particles * layer_count(settings)
    if settings.partition == "global":
        return settings.stage2_particles * layer_count(settings)
    return settings.wanted_evaluations


def moment_of(stages: tuple[Stage, ...], layer: int) -> Moment:
    """The stage and iteration of a layer (from 0)."""
    for number, stage in enumerate(stages):
        if layer < stage.iterations:
            return Moment(number, layer + 1)
        layer -= stage.iterations
    raise IndexError(f"layer {layer} beyond the last stage")


@functools.lru_cache(maxsize=32)
def stages_of(hierarchy: Hierarchy, settings: SwarmSettings) -> tuple[Stage, ...]:
    """The stages of a frame, in the order they run."""
    return _PARTITIONS[settings.partition](hierarchy, settings)


def _soft(tree: Hierarchy, knobs: SwarmSettings) -> tuple[Stage, ...]:
    return (
        _root_stage(tree, knobs),
        Stage(_calmed(tree, knobs, _all(tree)), knobs.stage2_particles, knobs.stage2_iterations),
    )


def _soft_three(tree: Hierarchy, knobs: SwarmSettings) -> tuple[Stage, ...]:
    second, third = _shared(knobs.stage2_iterations, 2)
    return (
        _root_stage(tree, knobs),
        Stage(_calmed(tree, knobs, tree.depth <= NEAR), knobs.stage2_particles, second),
        Stage(_calmed(tree, knobs, _all(tree)), knobs.stage2_particles, third),
    )


def _hard_two(tree: Hierarchy, knobs: SwarmSettings) -> tuple[Stage, ...]:
    rest = _or_all(tree.depth != ROOT)
    return (
        _root_stage(tree, knobs),
        Stage(rest.astype(np.float64), knobs.stage2_particles, knobs.stage2_iterations),
    )


def _hard_twelve(tree: Hierarchy, knobs: SwarmSettings) -> tuple[Stage, ...]:
    masks = _joined([tree.subspace == number for number in np.unique(tree.subspace)], TWELVE)
    lengths = _shared(layer_count(knobs), len(masks))
    return tuple(
        Stage(mask.astype(np.float64), knobs.stage1_particles, length)
        for mask, length in zip(masks, lengths, strict=True)
    )


def _global_local(tree: Hierarchy, knobs: SwarmSettings) -> tuple[Stage, ...]:
    kinds = [tree.pair == number for number in range(int(tree.pair.max()) + 1)]
    masks = _joined(kinds or [_or_all(tree.depth != ROOT)], KINDS_OF_LIMBS)
    lengths = _shared(knobs.stage1_iterations, len(masks))
    whole = Stage(np.ones(len(tree.depth)), knobs.stage2_particles, knobs.stage2_iterations)
    local = [
        Stage(mask.astype(np.float64), knobs.stage1_particles, length)
        for mask, length in zip(masks, lengths, strict=True)
    ]
    return (whole, *local)


def _global(tree: Hierarchy, knobs: SwarmSettings) -> tuple[Stage, ...]:
    return (Stage(np.ones(len(tree.depth)), knobs.stage2_particles, layer_count(knobs)),)


_PARTITIONS = {
    "soft": _soft,
    "soft-three": _soft_three,
    "hard-two": _hard_two,
    "hard-twelve": _hard_twelve,
    "global-local": _global_local,
    "global": _global,
}


def _root_stage(tree: Hierarchy, knobs: SwarmSettings) -> Stage:
    root = (tree.depth == ROOT).astype(np.float64)
    return Stage(root, knobs.stage1_particles, knobs.stage1_iterations, TRUNK_FIRST)


def _all(tree: Hierarchy) -> Mask:
    return np.ones(len(tree.depth), dtype=bool)


def _or_all(mask: Mask) -> Mask:
    """The mask, or all parameters where it is empty (a body with only a root)."""
    return mask if mask.any() else np.ones_like(mask)


def _calmed(tree: Hierarchy, knobs: SwarmSettings, free: Mask) -> Array:
    """(D,) freedom of a later soft stage: 1 for free parameters, less for the position."""
    return np.where(tree.position, 1.0 / knobs.position_divisor, 1.0) * free


def _nearest(evaluations: int, particles: int) -> int:
    """Iterations whose total comes nearest; halves are rounded up, as on the page."""
    return (2 * evaluations + particles) // (2 * particles)


def _shared(iterations: int, stages: int) -> tuple[int, ...]:
    """Iterations shared out as evenly as can be, the first stages having one more."""
    each, left = divmod(iterations, stages)
    return tuple(each + (number < left) for number in range(stages))


def _joined(masks: list[Mask], most: int) -> list[Mask]:
    """At most `most` masks: the neighbours with the fewest parameters together are joined."""
    masks = list(masks)
    while len(masks) > most:
        sizes = [int(one.sum() + other.sum()) for one, other in itertools.pairwise(masks)]
        at = int(np.argmin(sizes))
        masks[at : at + 2] = [masks[at] | masks[at + 1]]
    return masks
