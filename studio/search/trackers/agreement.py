"""How well a pose explains all views, per limb and in both directions: model outside the silhouettes, and silhouette
that no limb covers.

A limb that lies on another one covers nothing wrong; only the silhouette that it leaves uncovered shows the error. So
both are counted in every view, beyond a distance that allows for clothes and rough masks, and assigned to the nearest
limb. Silhouette that no limb can reach (`reach`) is none of the body's: a hand's forearm, an arm's gripper, a shadow.
Everything is in mm² at a body of a person's size (`mm_at`), so that cameras, rates and the body's size do not matter.
"""

import functools
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, moving_joint
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, Indices, Mask
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.trackers.agreement_kernels import (
    FIELDS,
    add_limb_counts,
    far_points,
    nearest_limbs,
    view_counts,
)
from studio.search.trackers.limb_reach import limb_reach_of
from studio.search.trackers.mesh_agreement import MeshAgreement
from studio.search.trackers.reach import reach_of
from studio.search.trackers.refinement import Distances, mm_at

FAR_MM = 45.0
"""mm: larger than what clothes, hair and rough masks make."""
LEAST_AREA = 1000.0
"""mm²: a limb with less area than this is seen by no view."""
GRID_MM = 14.0
"""mm, about: spacing of the points that are counted; at least a pixel."""
COARSE_GRID_MM = 25.0
"""mm: the same where many positions of a limb are compared."""
SOME_BARE = 0.01
"""Share of a limb's area: where no limb leaves so much bare, it is not asked what limbs can reach."""
MOST_BARE = 0.02
"""Share of the body's area beyond which a bare place is the nearest limb's alone. Without it *hard*, whose cameras
moved, goes from 33 to 72 and 58 mm (two seeds)."""


@dataclass(frozen=True, slots=True, eq=False)
class Disagreement:
    """Of V views and L drawn limbs, mm² at the body. area : (V, L) that a limb covers. outside : (V, L) of it farther
    than FAR_MM from the silhouette. bare : (V, L) silhouette farther than FAR_MM from every limb and within some limb's
    reach, given to the nearest. limbs : (L,) name of the limb that each drawn one belongs to, from the body's
    parameters. corners : (V, L, 4, 2) pixels of the pose's outlines. mm : (V,) size of a pixel at the body. covered :
    of a body with meshes, for a view and a number of pixels, whether a link lies on the middle of a cell of that size
    (H, W). within : by limb of several parts, what is bare no farther from where it begins than it is long; empty where
    hardly anything is bare.
    """

    area: Array
    outside: Array
    bare: Array
    limbs: tuple[str, ...]
    corners: Array
    mm: Sequence[float]
    covered: Callable[[int, int], Mask] | None = None
    within: Mapping[str, float] = field(default_factory=dict[str, float])

    def shares(self) -> dict[str, float]:
        """Disagreeing area by limb (named as in the body's parameters), as a share of the limb's area."""
        off = (self.outside + self.bare).sum(axis=0)
        return {limb: float(off[own].sum()) / area for limb, own, area in self._limbs()}

    def shares_in_reach(self) -> dict[str, float]:
        """The same with all that is bare in a limb's reach: an arm that lies before the trunk disagrees with nothing,
        and what it leaves bare may be nearest to a leg. Not where much is bare: masks that show more than the body do
        not say which limb is off.
        """
        if self.bare.sum() > MOST_BARE * self.area.sum():
            return self.shares()
        outside = self.outside.sum(axis=0)
        return {
            limb: max(share, (float(outside[own].sum()) + self.within.get(limb, 0.0)) / area)
            for (limb, own, area), share in zip(self._limbs(), self.shares().values(), strict=True)
        }

    def _limbs(self) -> Iterator[tuple[str, Mask, float]]:
        """Of each limb its name, which of the drawn ones (L,) it has, and its area, mm²."""
        area, groups = np.maximum(self.area.sum(axis=0), LEAST_AREA), np.array(self.limbs)
        for limb in dict.fromkeys(self.limbs):
            own = groups == limb
            yield limb, own, float(area[own].sum())


class Agreement:
    """Compares poses of a body with silhouettes in some cameras."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...]) -> None:
        self.body, self.cameras = body, cameras
        self._limbs = limb_names(body)
        self._projector = OutlineProjector.of_body(body, cameras)
        self._meshes = MeshAgreement(body, cameras) if body.meshes else None
        scale, self._reaches = scale_of(body), dict[str, tuple[int, float]]()
        """By limb of several parts the first of the drawn ones, and its length, mm at a person's size."""
        for name in dict.fromkeys(self._limbs):
            own = [number for number, limb in enumerate(self._limbs) if limb == name]
            if len(own) > 1:
                self._reaches[name] = own[0], sum(abs(body.drawn[number].length) for number in own) / scale

    def corners(self, pose: Array) -> Array:
        """(V, L, 4, 2) pixels of the outlines of a pose (D,)."""
        return self._projector.corners(pose[None])[0][0]

    def mm_per_pixel(self, pose: Array) -> list[float]:
        """Size of a pixel of each view at the body, mm at a person's size (`mm_at`)."""
        return mm_at(self.body, self.cameras, pose)

    def of(self, pose: Array, silhouettes: Sequence[Distances]) -> Disagreement:
        """Where a pose (D,) and a frame's silhouettes, one a camera, disagree."""
        corners, sizes = self.corners(pose), self.mm_per_pixel(pose)
        steps, far = _grid(sizes)
        bare, covered, within = None, None, dict[str, float]()
        if self._meshes is not None:
            counts, bare = self._meshes.counts(pose, silhouettes, steps, far)
            covered = functools.partial(self._meshes.covered, pose)
        else:
            counts: Array = np.zeros((*corners.shape[:2], FIELDS))
            for own, quads, view, step, reach in zip(counts, corners, silhouettes, steps, far, strict=True):
                view_counts(quads, view.signed, view.corner, view.size, step, reach, own)
        for own, step, mm in zip(counts, steps, sizes, strict=True):
            own *= (step * mm) ** 2
        if (
            counts[..., 2].sum(axis=0) > SOME_BARE * np.maximum(counts[..., 0].sum(axis=0), LEAST_AREA)
        ).any():
            bare = bare or _bare_points(corners, silhouettes, steps, far)
            points = [places for places, _ in bare]
            away = reach_of(self.body).beyond(pose, self.cameras, silhouettes, points, sizes, FAR_MM)
            for own, (_, limbs), beyond, step, mm in zip(counts, bare, away, steps, sizes, strict=True):
                np.subtract.at(own[:, 2], limbs[beyond], (step * mm) ** 2)
            reached = [own[~beyond] for own, beyond in zip(points, away, strict=True)]
            within = self._within(pose, reached, steps, sizes)
        return Disagreement(
            counts[..., 0], counts[..., 1], counts[..., 2], self._limbs, corners, sizes, covered, within
        )

    def confirmed(self, off: Disagreement, pose: Array, silhouettes: Sequence[Distances]) -> Disagreement:
        """The disagreement of a pose (D,) with only what is bare where the limb that it was given to can be, and where
        the other views agree (`limb_reach`); of the root's where any limb can.
        """
        reach = limb_reach_of(self.body, self._limbs)
        if not reach.moves.any() or not off.bare.any():
            return off
        steps, far = _grid(off.mm)
        if self._meshes is not None:
            bare = self._meshes.counts(pose, silhouettes, steps, far)[1]
        else:
            bare = _bare_points(off.corners, silhouettes, steps, far)
        there = reach.limbs_there(pose, self.cameras, silhouettes, [own for own, _ in bare], off.mm)
        groups = np.array([reach.limbs.index(limb) for limb in self._limbs])
        bare_there = np.zeros(off.bare.shape)
        for own, (_, limbs), allowed, step, mm in zip(bare_there, bare, there, steps, off.mm, strict=True):
            np.add.at(own, limbs[allowed[np.arange(len(limbs)), groups[limbs]]], (step * mm) ** 2)
        return replace(off, bare=np.minimum(off.bare, bare_there))

    def _within(
        self, pose: Array, bare: Sequence[Array], steps: Sequence[int], sizes: Sequence[float]
    ) -> dict[str, float]:
        """mm² of the bare points of each view (K, 2) within the length of limbs of several parts from their roots."""
        roots = limb_ends(self.body, pose[None])[0, :, 0]
        found = dict.fromkeys(self._reaches, 0.0)
        for camera, points, step, mm in zip(self.cameras, bare, steps, sizes, strict=True):
            places = project(camera, roots)[0]
            for limb, (first, length) in self._reaches.items():
                away = np.linalg.norm(points - places[first], axis=1)
                found[limb] += float(np.count_nonzero(away * mm <= length)) * (step * mm) ** 2
        return found

    def of_places(self, poses: Array, silhouettes: Sequence[Distances], without: str | None = None) -> Array:
        """(N,) mm² by which poses (N, D) that differ in a limb or two disagree with a frame's silhouettes there, on a
        coarse grid: what these limbs cover outside, and silhouette far from all limbs. without : a limb to leave
        out, if the body has no meshes.
        """
        if self._meshes is not None:
            return self._meshes.of_places(poses, silhouettes, self.mm_per_pixel(poses[0]))
        corners, _ = self._projector.corners(poses)
        corners[:, :, [limb == without for limb in self._limbs]] = np.nan
        moving = (corners != corners[:1]).any(axis=(0, 1, 3, 4))
        found = np.zeros(len(poses))
        for number, (view, mm) in enumerate(zip(silhouettes, self.mm_per_pixel(poses[0]), strict=True)):
            step, counts = max(1, round(COARSE_GRID_MM / mm)), np.zeros(len(poses))
            others, own = corners[0, number, ~moving], np.ascontiguousarray(corners[:, number, moving])
            points = far_points(others, view.signed, view.corner, step, FAR_MM / mm)
            add_limb_counts(own, points, view.signed, view.corner, view.size, step, FAR_MM / mm, counts)
            found += counts * (step * mm) ** 2
        return found


def without_bare(off: Disagreement, limbs: Collection[str] | None = None) -> Disagreement:
    """The disagreement where none of some limbs is missed: what lies bare beside them is something else. limbs : None
    for all.
    """
    kept = np.array([limbs is not None and limb not in limbs for limb in off.limbs])
    return replace(off, bare=np.where(kept, off.bare, 0.0), within={})


def _grid(sizes: Sequence[float]) -> tuple[list[int], list[float]]:
    """Pixels between the points that are counted, and FAR_MM in pixels, by view. sizes : mm of a pixel of each."""
    return [max(1, round(GRID_MM / mm)) for mm in sizes], [FAR_MM / mm for mm in sizes]


def _bare_points(
    corners: Array, silhouettes: Sequence[Distances], steps: Sequence[int], far: Sequence[float]
) -> list[tuple[Array, Indices]]:
    """Of every view the grid's points (K, 2) that are farther than `far` pixels from every limb of corners
    (V, L, 4, 2), with the nearest limb (K,).
    """
    found = list[tuple[Array, Indices]]()
    for quads, view, step, reach in zip(corners, silhouettes, steps, far, strict=True):
        points = far_points(quads, view.signed, view.corner, step, reach)
        limbs = nearest_limbs(points, quads)
        found.append((points[limbs >= 0], limbs[limbs >= 0]))
    return found


def limb_names(body: BodyModel) -> tuple[str, ...]:
    """(L,) limb that each drawn one belongs to: that of the nearest parameter towards the root."""
    moving = [moving_joint(body, limb.joint) for limb in body.drawn]
    return tuple(
        body.parameters[body.joints[joint].parameters[-1]].limb if joint >= 0 else "" for joint in moving
    )
