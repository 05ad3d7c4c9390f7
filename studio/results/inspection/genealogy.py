"""Which ancestors survive: every particle's parents, and how many particles of the first set have descendants.

Layers draw with replacement, so that lines die out (the degeneracy of a particle filter's ancestry: Jacob, Murray &
Rubenthaler 2015, "Path storage in the particle filter"). A child of two (Deutscher & Reid 2005, Eq. 19) descends from
both.
"""

from collections.abc import Sequence

import numpy as np

from studio.foundations.arrays import Array, Indices, Mask
from studio.results.inspection.reading import InspectedFrame
from studio.results.inspection.tables import Row, Selection, View, ViewResult, table
from studio.search.trackers.tracker import NO_PARENT

VIEW = View(
    "genealogy",
    "Genealogy",
    "Which ancestors survive?",
    ("layer", "particle"),
    (
        table(
            "particles",
            "Particles and their parents",
            "layer",
            "particle",
            ("parent", "Parent"),
            ("second_parent", "Second parent"),
            ("ancestor", "First ancestor"),
            ("children", "Children"),
            ("survives", "Has descendants in the last layer"),
            "log_weight",
            ("weight", "Weight"),
        ),
        table(
            "ancestors",
            "Distinct ancestors by layer",
            "layer",
            ("particles", "Particles"),
            ("ancestors", "Distinct ancestors in the first set"),
            ("with_descendants", "Particles with descendants in the last set"),
            ("crossed", "Children of two"),
        ),
    ),
)


def living(parents: Sequence[Indices], sizes: Sequence[int]) -> list[Mask]:
    """For each layer (N,) which particles have descendants in the last one, themselves included.

    parents : of each layer, (2, N') particles of it that those of the next one come from; (2, 0) where none are known.
    sizes : of the layers' sets.
    """
    alive = [np.ones(sizes[-1], dtype=bool)]
    for drawn, size in zip(reversed(parents[:-1]), reversed(sizes[:-1]), strict=True):
        has = np.zeros(size, dtype=bool)
        if drawn.shape[1]:
            kept = drawn[:, alive[0][: drawn.shape[1]]]
            has[kept[kept != NO_PARENT]] = True
        alive.insert(0, has)
    return alive


def first_lines(parents: Sequence[Indices], sizes: Sequence[int]) -> list[Indices]:
    """For each layer (N,) the particle of its search's first set that the line of first parents leads to."""
    lines = [np.arange(sizes[0])]
    for drawn, size in zip(parents[:-1], sizes[1:], strict=True):
        lines.append(lines[-1][drawn[0]] if drawn.shape[1] == size else np.arange(size))
    return lines


def children_of(frame: InspectedFrame, layer: int) -> Indices:
    """(N,) of how many particles of the next layer each particle of a layer is a parent."""
    drawn = frame.layers[layer].parents
    return np.bincount(drawn[drawn != NO_PARENT], minlength=frame.size(layer))


def rows(frame: InspectedFrame, selection: Selection) -> ViewResult:
    layers, count = frame.layers, len(frame.layers)
    parents, sizes = [record.parents for record in layers], [frame.size(at) for at in range(count)]
    alive, lines = living(parents, sizes), first_lines(parents, sizes)
    known = [at > 0 and parents[at - 1].shape[1] == sizes[at] for at in range(count)]
    notes: list[str] = []
    if count > 1 and not any(known):
        notes.append(
            "The run stores no parents: it was tracked by an older studio, or its tracker draws none."
        )
    elif not all(known[1:]):
        notes.append("The frame was searched several times; lines begin again with each search.")
    particles: list[Row] = []
    summary: list[Row] = []
    for layer in range(count):
        first, second = parents[layer - 1] if known[layer] else np.full((2, sizes[layer]), NO_PARENT)
        children = children_of(frame, layer)
        log_weights, weights = spread_out(frame, layer)
        particles += [
            (
                layer,
                at,
                _parent_or_none(first[at]),
                _parent_or_none(second[at]),
                int(lines[layer][at]),
                int(children[at]),
                bool(alive[layer][at]),
                float(log_weights[at]),
                float(weights[at]),
            )
            for at in range(sizes[layer])
        ]
        began = max((at for at in range(layer + 1) if not known[at]), default=0)
        ancestors = living(parents[began : layer + 1], sizes[began : layer + 1])[0]
        summary.append(
            (
                layer,
                sizes[layer],
                int(ancestors.sum()),
                int(alive[layer].sum()),
                int((second != NO_PARENT).sum()),
            )
        )
    return ViewResult({"particles": particles, "ancestors": summary}, tuple(notes))


def spread_out(frame: InspectedFrame, layer: int) -> tuple[Array, Array]:
    """(N,) raw log weights and (N,) normalised weights of all of a layer's particles, NaN where not stored."""
    numbers, size = frame.particles(layer), frame.size(layer)
    log_weights, weights = np.full(size, np.nan), np.full(size, np.nan)
    log_weights[numbers] = frame.layers[layer].log_weights
    weights[numbers] = frame.weights(layer)
    return log_weights, weights


def _parent_or_none(parent: int) -> int | None:
    return None if parent == NO_PARENT else int(parent)
