"""Local refinement after the search: Levenberg-Marquardt on distances between outlines and silhouettes.

Named as further work by the papers: a local search from where the stochastic one ended. Two kinds of residual, in mm at
the body (of a person's size: `mm_at`): from every point of a silhouette's border to the nearest outline that can
explain it (its outward direction must agree), and, weakly, from outlines to the border, which holds limbs that no
border explains. Both use only the border of the limbs' union. A robust loss discounts what is not body. Joint limits
hold by projection; a weak pull towards the start determines what no silhouette shows (twists).

Measured on rendered footage (`tests/runs/test_refinement_gain.py`): the error of a refinement
that starts from the truth ("floor") is that of the model. The border's points matter most: with outlines to border of
the same weight the floor rises from 11 to 16 mm. Starting with a wider loss and narrowing it gains nothing on one walk
and loses 2 mm on another, as the body moves to a neighbouring valley; the search ends near enough.

The processor refines where a card searches, too. Of the default's frame refinement is 6.3 of the 21 ms of processor
time that the search's thread takes (four 640 × 480 cameras, `studio bench --only frames`, a two-core server), with
distances that were made beside it. To bring a frame's maps to an H200 takes 0.9 ms, and its distances would go the same
way. A descent has one pose and up to 20 steps, each of which waits for the last: it fills no card, where a layer of a
thousand poses takes 0.8 ms, its kernels a third of them and launching and reading the rest (before records were copied
behind the next layer). It would pay where the distances were made there, of masks that are made there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, free_ends, moving_joint, rigid_limbs
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, Indices
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import knob
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.trackers.floor_hold import FloorHold, has_floor
from studio.search.trackers.mesh_equations import MeshEquations
from studio.search.trackers.refinement_kernels import normal_equations
from studio.search.trackers.tracker import FrameLikelihood

OUTLINE_PART = 0.1
"""Weight of an outline's sample relative to a border point."""
DIFFERENCE = 0.004
"""Step of the central differences, radians; outlines are projected in single precision."""
MM_PER_RADIAN = 300.0
"""A length that counts like a radian: about a limb's."""
DAMPING, EASED, TIGHTENED, MOST_DAMPING = 1e-2, 0.3, 8.0, 1e4
LEAST_MOVE = 2e-4
"""A step below this (radians, or mm / MM_PER_RADIAN) ends the search."""
FEWEST_PIXELS = 3.0
"""Pixels: least width c of the robust loss, as masks are rough at this scale."""
HIDDEN_PULL, REST_PULL = 100.0, 20.0
"""Pull towards the rest pose, mm per radian, of angles that move no limb of their own (collar-bones) and of the others.
An arm's outline inside the trunk costs nothing, so that without it shoulders sink into the chest (a rendered dance:
36 mm and limbs lost in 23 of 100 frames without, 20 mm and 1 with it and resampled limbs)."""
SPREAD_PULL = 15.0
"""mm that an angle is pulled by at its usual deviation from rest, where the body says one."""
HALFWAY = 0.5
SLACK_MM = 50.0
"""mm by which a hand or foot without a joint (`rigid_limbs`) may be off at no cost: a wrist turns it by so much. It
explains the border that it is near to, but pulls the limbs above it only by what is beyond. Measured on a rendered walk
with turns: rigid feet without slack pull the legs and the trunk 20 to 30 mm down, rigid hands the arms 10 mm. But a
hand in front of the trunk may be all that shows how far the elbow is bent."""
MESH_PIXELS = (4.0, 1.5)
"""Pixels: widths c of the loss by which a body with meshes is refined in turn, in place of the settings' scale: its
outlines are as good as the masks, of which pieces may be missing. On a robot's arm whose masks end before the last link
a width of 10 turns the wrist by 9 degrees, from the truth, one of 1.5 by 2."""
REACH = 4.0
"""Times c: a silhouette's distance map is kept up to here from its border; beyond, the loss is nearly its maximum."""


class Distances(Protocol):
    """A view's silhouette (`evidence.distance_maps.SilhouetteDistances`)."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture."""
        ...

    @property
    def corner(self) -> tuple[int, int]:
        """Left and top of the part that `signed` covers."""
        ...

    @property
    def signed(self) -> NDArray[np.float32]:
        """(H, W) pixels to the border, negative inside."""
        ...

    @property
    def border(self) -> Array:
        """(K, 2) border pixels."""
        ...

    @property
    def outward(self) -> Array:
        """(K, 2) their directions away from the silhouette."""
        ...


FLOOR_HELP = (
    "Pull what of a body that is sized by its height (a person, a dog) lies a little below the floor, z = 0, back up."
    " Off for who swims or climbs down."
)
Equations = tuple[float, Array, Array]
"""A loss, and the gradient (D,) and matrix (D, D) of half of it per unit of each parameter."""
FrameLoss = Callable[[Array], Equations]
"""Loss of a pose (D,) in a frame, with its equations."""


@dataclass(frozen=True, slots=True)
class RefinementSettings:
    """The knobs of local refinement."""

    title = "Refinement"

    refinement_steps: int = knob(20, 1, 100, 1, unit="steps", help="Most steps of the local search.")
    refinement_scale: float = knob(
        50.0, 5.0, 500.0, 5.0, unit="mm",
        help="From this distance on a point of the silhouette's border counts less and less: it may not be body.",
    )  # fmt: skip
    refinement_pull: float = knob(
        40.0, 0.0, 1000.0, 1.0, unit="mm per radian",
        help="Pull towards the pose that the search found; it determines what no silhouette shows.",
    )  # fmt: skip

    refinement_acceleration: float = knob(
        40.0, 0.0, 200.0, 1.0, unit="m/s²",
        help="Usual acceleration of limbs; it couples neighbouring frames. 0: every frame on its own.",
    )  # fmt: skip

    refinement_floor: bool = knob(True, help=FLOOR_HELP)

    # Walks and runs on subtracted masks: 0.84 to 0.95; masks that show a platform and its shadow as well: 0.57 to 0.64,
    # and refined poses that jump by 100 mm from frame to frame.
    refinement_least_overlap: float = knob(
        0.7, 0.0, 1.0, 0.05,
        help="Frames whose silhouettes agree less than this even when refined keep their pose: masks show more.",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """A refined pose. pose : (D,). moved : False where the start was kept because the likelihood would have fallen.
    gain : of the log-weight. steps : that were taken. matrix : (D, D) of the silhouettes' equations at `pose`
    (`Refiner.loss`), None where a likelihood had its say or there are no silhouettes.
    """

    pose: Array
    moved: bool
    gain: float
    steps: int
    matrix: Array | None = None


class Refiner:
    """Refines poses of one body in some cameras; immutable."""

    def __init__(
        self,
        body: BodyModel,
        cameras: tuple[Camera, ...],
        settings: RefinementSettings,
        still: Sequence[int] = (),
    ) -> None:
        """still : numbers of parameters that stay as they are."""
        self.body, self.cameras, self.settings = body, cameras, settings
        self.still = np.isin(np.arange(len(body.neutral)), still)
        self.projector = OutlineProjector.of_body(body, cameras)
        length = MM_PER_RADIAN * scale_of(body)
        self.unit = np.where(body.angles, 1.0, length)
        self.lower, self.upper = body.lower, body.upper
        self.ends = free_ends(body)
        self.slack = np.where(rigid_limbs(body), SLACK_MM, 0.0)
        self.neutral = body.neutral
        self.stiffness = np.where(hidden_angles(body), HIDDEN_PULL**2, REST_PULL**2)
        usual = np.isfinite(body.spread)
        self.stiffness[usual] = np.square(SPREAD_PULL / body.spread[usual])
        self.bounded = body.bounded_angles
        self.stiffness[~(self.bounded | usual)] = 0.0
        self.meshes = MeshEquations(body, cameras, DIFFERENCE * self.unit) if body.meshes else None
        if self.meshes is not None:
            self.stiffness[:] = 0.0
        on_floor = settings.refinement_floor and has_floor(body)
        self._floor = FloorHold(body, self.unit, DIFFERENCE) if on_floor else None

    def refine(
        self, pose: Array, silhouettes: Sequence[Distances], problem: FrameLikelihood | None = None
    ) -> Refined:
        """The pose (D,) refined on a frame's silhouettes, one a camera. Its log-weight in `problem` never falls: where
        it would, half of the step or none is taken.
        """
        start = np.asarray(pose, dtype=np.float64)
        if not any(len(view.border) for view in silhouettes):
            return Refined(start.copy(), False, 0.0, 0)
        found, steps, matrix = self._descended(start, silhouettes)
        if problem is None:
            return Refined(found, True, 0.0, steps, matrix)
        offered = np.stack([start, found, start + HALFWAY * (found - start)])
        weights = problem.log_likelihood(offered)
        for candidate, weight in zip(offered[1:], weights[1:], strict=True):
            if weight >= weights[0]:
                return Refined(candidate, True, float(weight - weights[0]), steps)
        return Refined(start.copy(), False, 0.0, steps)

    def loss(self, pose: Array, silhouettes: Sequence[Distances]) -> Equations:
        """The loss at a pose, and gradient (D,) and matrix (D, D) of half of it per unit of each parameter."""
        return self._equations(pose, self._prepared(pose, silhouettes))

    def loss_with_pull(self, pose: Array, silhouettes: Sequence[Distances]) -> float:
        """The loss at a pose plus the pull towards rest, to compare poses of different valleys."""
        bent = (pose - self.neutral) / self.unit
        return self.loss(pose, silhouettes)[0] + float(self.stiffness @ np.square(bent))

    def frame_loss(self, start: Array, silhouettes: Sequence[Distances], pixels: float = 0.0) -> "FrameLoss":
        """A frame's loss as a function of poses near `start` (D,); without silhouettes only the pull. pixels : c in
        pixels; 0: the usual one.
        """
        prepared = self._prepared(start, silhouettes, pixels) if silhouettes else None
        pull = self.settings.refinement_pull**2

        def equations(pose: Array) -> Equations:
            size = len(pose)
            loss, gradient, matrix = (
                (0.0, np.zeros(size), np.zeros((size, size)))
                if prepared is None
                else self._equations(pose, prepared)
            )
            away, bent = (pose - start) / self.unit, (pose - self.neutral) / self.unit
            held = None if self._floor is None else self._floor.of(pose)
            if held is not None:
                loss, gradient, matrix = loss + held.loss, gradient + held.gradient, matrix + held.matrix
            gradient += pull * away
            gradient += self.stiffness * bent
            diagonal = matrix.reshape(-1)[:: size + 1]
            diagonal += pull
            diagonal += self.stiffness
            return (
                loss + pull * float(away @ away) + float(self.stiffness @ np.square(bent)),
                gradient,
                matrix,
            )

        return equations

    def _descended(self, start: Array, silhouettes: Sequence[Distances]) -> tuple[Array, int, Array]:
        """The pose that Levenberg-Marquardt ends at, the steps taken, and the silhouettes' matrix (D, D) there."""
        if self.meshes is None:
            return self._descended_by(start, self.frame_loss(start, silhouettes))
        pose, steps, matrix = start, 0, np.zeros((len(start), len(start)))
        for width in MESH_PIXELS:
            pose, more, matrix = self._descended_by(pose, self.frame_loss(pose, silhouettes, width))
            steps += more
        return pose, steps, matrix

    def _descended_by(self, start: Array, of_frame: "FrameLoss") -> tuple[Array, int, Array]:
        pose, steps, damping = start.copy(), 0, DAMPING
        loss, gradient, matrix = of_frame(pose)
        while steps < self.settings.refinement_steps and damping < MOST_DAMPING:
            steps += 1
            offered = self._stepped(pose, gradient, matrix, damping)
            reached = of_frame(offered)
            moved = float(np.abs((offered - pose) / self.unit).max())
            if reached[0] <= loss:
                pose, (loss, gradient, matrix) = offered, reached
                damping *= EASED
            else:
                damping *= TIGHTENED
            if moved < LEAST_MOVE:
                break
        pulls = self.settings.refinement_pull**2 + self.stiffness
        return pose, steps, matrix - np.diag(pulls)

    def _stepped(self, pose: Array, gradient: Array, matrix: Array, damping: float) -> Array:
        """One damped step inside the limits; parameters that press against a limit stay there."""
        held = ((pose <= self.lower) & (gradient > 0.0)) | ((pose >= self.upper) & (gradient < 0.0))
        held |= self.still
        free = np.flatnonzero(~held)
        part = matrix[free[:, None], free]
        part.flat[:: len(free) + 1] += (
            damping * part.diagonal() + 1e-9 * np.trace(matrix) / len(matrix) + 1e-12
        )
        step = np.zeros(len(pose))
        step[free] = -np.linalg.solve(part, gradient[free])
        moved = np.clip(pose + step * self.unit, self.lower, self.upper)
        return np.where(self.still, pose, moved)

    def _prepared(self, pose: Array, silhouettes: Sequence[Distances], pixels: float = 0.0) -> "_Prepared":
        """The silhouettes as the kernel reads them, with each view's mm per pixel at the body."""
        mm = np.array(mm_at(self.body, self.cameras, pose))
        views, maps = np.zeros((len(silhouettes), 7), dtype=np.int64), list[NDArray[np.float32]]()
        begin = border = 0
        for row, view, scale in zip(views, silhouettes, self._scales(mm) / mm, strict=True):
            (left, top), part = _about_the_border(view, REACH * scale)
            height, width = part.shape
            row[:] = begin, width, height, border, border + len(view.border), left, top
            begin, border = begin + part.size, border + len(view.border)
            maps.append(part.ravel())
        points = [np.concatenate([view.border, view.outward], axis=1) for view in silhouettes]
        sizes = np.array([view.size for view in silhouettes], dtype=np.int64)
        border = np.ascontiguousarray(np.concatenate(points))
        scales = pixels * mm if pixels else self._scales(mm)
        return _Prepared(np.concatenate(maps), views, sizes, border, mm, scales)

    def _scales(self, mm: Array) -> Array:
        """(V,) mm: c of the loss in each view."""
        if self.meshes is not None:
            return MESH_PIXELS[-1] * mm
        return np.maximum(self.settings.refinement_scale, FEWEST_PIXELS * mm)

    def _equations(self, pose: Array, prepared: "_Prepared") -> Equations:
        if self.meshes is not None:
            borders, maps = prepared.by_view()
            return self.meshes.of(pose, borders, maps, prepared.mm, prepared.scales, OUTLINE_PART)
        size = len(pose)
        corners, slopes = self.projector.slopes(pose, DIFFERENCE * self.unit, DIFFERENCE)
        matrix, gradient = np.zeros((size, size)), np.zeros(size)
        loss = normal_equations(
            corners,
            slopes,
            self.ends,
            self.slack,
            prepared.maps,
            prepared.views,
            prepared.sizes,
            prepared.border,
            prepared.mm,
            prepared.scales,
            OUTLINE_PART,
            matrix,
            gradient,
        )
        return loss, gradient, matrix


@dataclass(frozen=True, slots=True, eq=False)
class _Prepared:
    """A frame's silhouettes, flat; see `refinement_kernels.normal_equations`."""

    maps: NDArray[np.float32]
    views: NDArray[np.int64]
    sizes: NDArray[np.int64]
    border: Array
    mm: Array
    scales: Array

    def by_view(self) -> tuple[list[Array], list[tuple[Array, Indices]]]:
        """Border points (K, 4), and distances (H, W) with their left and top in the picture."""
        borders, maps = list[Array](), list[tuple[Array, Indices]]()
        for begin, width, height, first, last, left, top in self.views.tolist():
            borders.append(self.border[first:last])
            signed = self.maps[begin : begin + width * height].reshape(height, width).astype(np.float64)
            maps.append((signed, np.array([left, top])))
        return borders, maps


def hidden_angles(body: BodyModel) -> NDArray[np.bool_]:
    """(D,) whether a parameter moves only joints that bear no drawn limb themselves; a limb on a fixed joint is borne
    by what that one is fixed to.
    """
    bearing = {moving_joint(body, limb.joint) for limb in body.drawn} - {-1}
    moves = [{s.parameter for s in joint.steps if s.parameter >= 0} for joint in body.joints]
    shown = set[int]().union(*(moves[number] for number in bearing)) if bearing else set[int]()
    return np.array([number not in shown for number in range(len(body.parameters))], dtype=np.bool_)


def _about_the_border(view: Distances, margin: float) -> tuple[tuple[int, int], NDArray[np.float32]]:
    """Left and top of the part of a view's map that lies within `margin` pixels of its border, and that part."""
    if not len(view.border):
        return (0, 0), np.ascontiguousarray(view.signed[:0, :0], dtype=np.float32)
    corner, (height, width) = np.array(view.corner), view.signed.shape
    left, top = np.maximum(np.floor(view.border.min(axis=0) - margin) - corner, 0.0).astype(int)
    right, bottom = np.ceil(view.border.max(axis=0) + margin - corner).astype(int) + 1
    part = view.signed[top : min(bottom, height), left : min(right, width)]
    return (int(left + corner[0]), int(top + corner[1])), np.ascontiguousarray(part, dtype=np.float32)


def mm_at(body: BodyModel, cameras: Sequence[Camera], pose: Array) -> list[float]:
    """Size of a pixel of each view at a body of pose (D,), mm: of a body much larger or smaller than a person the mm
    that it would be at a person (`scale_of`), so that distances from its outline mean the same for all bodies.
    """
    middle = limb_ends(body, pose[None])[0].reshape(-1, 3).mean(axis=0)
    return [mm_per_pixel(camera, middle) / scale_of(body) for camera in cameras]


def mm_per_pixel(camera: Camera, point: Array) -> float:
    """Size of a pixel at a point (3,), mm; the point is taken at least 100 mm from the camera."""
    depth = float(camera.rotation[2] @ point + camera.translation[2])
    return max(depth, 100.0) / float(np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1]))
