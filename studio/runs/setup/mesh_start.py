"""The start pose of a body whose links have meshes, by the silhouettes and outlines of these.

Cones around a robot's links are several pixels off, and a search by them ends tens of degrees beside the truth.
The search for a start pose weighs by the area of the meshes' silhouettes (`search.likelihood.mesh_silhouettes`). That
is coarse, and misled where a piece of a mask is missing. So the ends of each chain are drawn again, longest first: the
best by area are refined on the outlines, and the one that explains most of the masks' borders closely is taken.
"""

from collections.abc import Sequence

import numpy as np

from studio.body.model import BodyModel
from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress
from studio.search.likelihood.mesh_silhouettes import MeshSilhouettes
from studio.search.trackers.agreement import Agreement
from studio.search.trackers.initialisation import Effort
from studio.search.trackers.limb_resampling import Hypothesis, SeenFrame
from studio.search.trackers.refinement import RefinementSettings, Refiner
from studio.search.trackers.start_lines import Round

EFFORT = Effort(1, (Round(8, 60, 150, 0.4), Round(5, 100, 200, 0.3), Round(3, 150, 200, 0.2)))
"""A pose takes a third of a millisecond."""
BORDER = 600
"""Border points of a view."""
ROUNDS, DRAWS, REFINED, APART = 2, 300, 5, 0.4
"""Passes over the chains' ends; poses drawn for each parameter of an end; how many of them are refined, and by how many
radians (and shares of a slide's range) they differ in some joint."""


def outlines_put_right(
    body: BodyModel,
    cameras: tuple[Camera, ...],
    evidence: FrameEvidence,
    pose: Array,
    seed: int,
    progress: Progress,
) -> Hypothesis:
    """The pose (D,) refined on the outlines, with joints drawn again, and what still disagrees."""
    refiner = Refiner(body, cameras, RefinementSettings())
    frame = SeenFrame(refiner, Agreement(body, cameras), silhouette_distances(evidence, BORDER))
    areas = MeshSilhouettes(body, cameras, evidence)
    rng = np.random.default_rng(np.random.SeedSequence((seed, 0x3E5)))
    best = refiner.refine(pose, frame.silhouettes).pose
    least = refiner.loss(best, frame.silhouettes)[0]
    ends: list[list[int] | None] = [own for _ in range(ROUNDS) for own in (*chain_ends(body), None)]
    for number, own in enumerate(ends):
        progress("checking each joint", number, len(ends))
        starts = twins(body, best) if own is None else _drawn(rng, body, best, own, areas)
        for start in starts:
            offered = refiner.refine(start, frame.silhouettes).pose
            loss = refiner.loss(offered, frame.silhouettes)[0]
            if loss < least:
                best, least = offered, loss
    return frame.hypothesis(best)


def twins(body: BodyModel, pose: Array) -> list[Array]:
    """The poses in which one joint of a chain is bent the other way and both its neighbours are turned by half a turn:
    what lies beyond stays where it is, and the outlines hardly differ. Those beyond a limit are left out.
    """
    found = list[Array]()
    for own in chain_ends(body):
        before, bent, after = (*own, -1, -1)[:3]
        if after < 0 or not body.angles[own[:3]].all():
            continue
        other = pose.copy()
        other[bent] = -pose[bent]
        for turned in (before, after):
            other[turned] += np.pi if pose[turned] < 0.5 * (body.lower + body.upper)[turned] else -np.pi
        if ((other >= body.lower) & (other <= body.upper)).all():
            found.append(other)
    return found


def _drawn(
    rng: np.random.Generator, body: BodyModel, pose: Array, own: Sequence[int], areas: MeshSilhouettes
) -> list[Array]:
    """Poses with parameters `own` drawn within their limits, the best by area."""
    drawn = np.repeat(pose[None], DRAWS * len(own), axis=0)
    lower, reach = body.lower[own], (body.upper - body.lower)[own]
    drawn[:, own] = lower + rng.random((len(drawn), len(own))) * reach
    return _best_apart(drawn, areas.log_likelihood(drawn), own, np.where(body.angles[own], 1.0, reach))


def chain_ends(body: BodyModel) -> list[list[int]]:
    """Of every limb of the body its parameters that have limits, these without the first, and so on to the last two:
    what is right near the root shows what is beyond.
    """
    bounded = np.isfinite(body.lower) & np.isfinite(body.upper)
    ends = list[list[int]]()
    for limb in dict.fromkeys(entry.limb for entry in body.parameters):
        own = [n for n, entry in enumerate(body.parameters) if entry.limb == limb and bounded[n]]
        ends += [own[first:] for first in range(max(len(own) - 1, min(1, len(own))))]
    return ends


def _best_apart(drawn: Array, weights: Array, own: Sequence[int], unit: Array) -> list[Array]:
    """The poses drawn (N, D) of most weight (N,) that differ from one another."""
    kept = list[Array]()
    for row in np.argsort(-weights, kind="stable"):
        if all((np.abs(drawn[row, own] - other[own]) / unit).max() > APART for other in kept):
            kept.append(drawn[row])
        if len(kept) == REFINED:
            break
    return kept
