"""Silhouettes and outlines of a body whose links have meshes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from studio.body.forward_kinematics import joint_frames
from studio.body.meshes import coarser
from studio.body.model import BodyModel, moving_joint
from studio.foundations.arrays import Array, Bytes, Indices, Mask
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import camera_table, outward_limit
from studio.foundations.geometry.projection import directions, project
from studio.search.likelihood.mesh_kernels import draw_triangles, project_points

MOST_POINTS = 3000
"""Of an outline in a view."""
SMOOTHED = 1.5
"""Standard deviation, pixels, of the smoothing before an outline's direction is measured."""
BEYOND = 4
"""Pixels around a silhouette that its smoothing reaches."""


@dataclass(frozen=True, slots=True, eq=False)
class MeshOutline:
    """One view's outline. border : (K, 2) pixels. outward : (K, 2) unit vectors. joint : (K,) that each point moves
    with. own : (K, 3) points in that joint's frame, mm.
    """

    border: Array
    outward: Array
    joint: Indices
    own: Array


class MeshOutlines:
    """Draws one body with meshes into some cameras; immutable."""

    def __init__(self, body: BodyModel, cameras: Sequence[Camera]) -> None:
        self.body, self.cameras = body, tuple(cameras)
        self.points, self.triangles, self.joints = all_meshes(body)
        self._limbs = np.array(limb_of_links(body), dtype=np.int64)[self.joints[self.triangles[:, 0]]]
        self._table = camera_table(self.cameras, outward_limit)

    def silhouettes(self, pose: Array) -> tuple[Bytes, ...]:
        """By camera (H, W), 0 or 255, of a pose (D,)."""
        frames = joint_frames(self.body, pose)[0]
        return tuple(
            np.where(self._drawn(frames, view)[0] >= 0, np.uint8(255), np.uint8(0))
            for view in range(len(self.cameras))
        )

    def owners(self, pose: Array, view: int, shrink: int, size: tuple[int, int]) -> Indices:
        """(H, W) of a view of a pose (D,) in cells of `shrink` × `shrink` pixels, the drawn limb that stands for the
        link that is seen at each cell's middle (`limb_of_links`), -1 where there is none. size : W and H.
        """
        owner = self._drawn(joint_frames(self.body, pose)[0], view, shrink, size)[0]
        return np.where(owner >= 0, self._limbs[owner], -1)

    def contours(self, pose: Array, view: int) -> tuple[Array, ...]:
        """By drawn limb the contour (K, 2) of the links that it stands for, alone, in a view of a pose (D,), pixels:
        one closed line, whose pieces and holes hang together by lines that go there and back. (0, 2) where none is
        seen.
        """
        frames, found = joint_frames(self.body, pose)[0], [np.zeros((0, 2))] * len(self.body.drawn)
        for limb in np.unique(self._limbs).tolist():
            owner, _ = self._drawn(frames, view, triangles=self.triangles[self._limbs == limb])
            pieces = _closed_lines(owner >= 0)
            if pieces:
                joined = [pieces[0], *(np.concatenate([piece, pieces[0][:1]]) for piece in pieces[1:])]
                found[limb] = np.concatenate(joined)
        return tuple(found)

    def of(self, pose: Array) -> tuple[MeshOutline, ...]:
        """The outlines of a pose (D,), by camera."""
        frames = joint_frames(self.body, pose)[0]
        return tuple(self._outline(frames, view) for view in range(len(self.cameras)))

    def slopes(
        self, pose: Array, view: int, outline: MeshOutline, rows: Indices, differences: Array
    ) -> Array:
        """(K, D) pixels by which points `rows` (K,) of an outline move outwards per unit of each parameter.
        differences : (D,) half the step.
        """
        size = len(pose)
        steps = np.concatenate([np.diag(differences), -np.diag(differences)])
        frames = joint_frames(self.body, pose + steps)[:, outline.joint[rows]]
        moved = np.einsum("nkij,kj->nki", frames[..., :3], outline.own[rows]) + frames[..., 3]
        pixels = project(self.cameras[view], moved)[0]
        change = (pixels[:size] - pixels[size:]) / (2.0 * differences)[:, None, None]
        return np.einsum("dki,ki->kd", np.nan_to_num(change), outline.outward[rows])

    def _drawn(
        self,
        frames: Array,
        view: int,
        shrink: int = 1,
        size: tuple[int, int] | None = None,
        triangles: Indices | None = None,
    ) -> tuple[Indices, NDArray[np.float32]]:
        width, height = size or (self.cameras[view].width, self.cameras[view].height)
        seen = np.empty((len(self.points), 3))
        project_points(self.points, frames, self.joints, self._table[view], float(shrink), seen)
        owner = np.empty((height, width), dtype=np.int64)
        depth = np.empty((height, width), dtype=np.float32)
        draw_triangles(seen, self.triangles if triangles is None else triangles, owner, depth)
        return owner, depth

    def _outline(self, frames: Array, view: int) -> MeshOutline:
        camera, (owner, depth) = self.cameras[view], self._drawn(frames, view)
        border, outward = _border_of(owner >= 0)
        if not len(border):
            return MeshOutline(border, outward, np.zeros(0, np.int64), np.zeros((0, 3)))
        x, y = border.astype(np.int64).T
        joint = self.joints[self.triangles[owner[y, x], 0]]
        away = depth[y, x].astype(np.float64)
        world = (directions(camera, border) * away[:, None] - camera.translation) @ camera.rotation
        own = np.einsum("kji,kj->ki", frames[joint][:, :, :3], world - frames[joint][:, :, 3])
        return MeshOutline(border, outward, joint, own)


def limb_of_links(body: BodyModel) -> list[int]:
    """By joint the number of the drawn limb that stands for what is fixed to it: the first one that moves with it, the
    first of all where none does.
    """
    moving = [moving_joint(body, limb.joint) for limb in body.drawn]
    links = [moving_joint(body, joint) for joint in range(len(body.joints))]
    return [moving.index(link) if link in moving else 0 for link in links]


def all_meshes(body: BodyModel, share: float = 0.0) -> tuple[Array, Indices, Indices]:
    """Points (V, 3) in their joints' frames, triangles (F, 3), and the points' joints (V,) of all links. share : of its
    longest side that a mesh's points are put together over, 0 to keep them all.
    """
    points, triangles, joints, count = list[Array](), list[Indices](), list[Indices](), 0
    for mesh in body.meshes:
        own, faces = mesh.points, mesh.triangles
        if share:
            own, faces = coarser(own, faces, max(share * float(np.ptp(own, axis=0).max()), 1e-3))
        points.append(own)
        triangles.append(faces + count)
        joints.append(np.full(len(own), mesh.joint, dtype=np.int64))
        count += len(own)
    return np.concatenate(points), np.concatenate(triangles), np.concatenate(joints)


def _border_of(inside: Mask) -> tuple[Array, Array]:
    """(K, 2) pixels (x, y) of a silhouette (H, W) beside others, at most MOST_POINTS, none at the picture's own
    border, and (K, 2) unit vectors away from it.
    """
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if not len(rows):
        return np.zeros((0, 2)), np.zeros((0, 2))
    top, left = max(int(rows[0]) - BEYOND, 0), max(int(columns[0]) - BEYOND, 0)
    part = inside[top : rows[-1] + BEYOND + 1, left : columns[-1] + BEYOND + 1]
    amid = part[1:-1, 1:-1]
    surrounded = part[:-2, 1:-1] & part[2:, 1:-1] & part[1:-1, :-2] & part[1:-1, 2:]
    y, x = np.nonzero(amid & ~surrounded)
    step = max(1, -(-len(x) // MOST_POINTS))
    x, y = x[::step] + 1, y[::step] + 1
    smooth = ndimage.gaussian_filter(part.astype(np.float32), SMOOTHED)
    inwards = np.stack([smooth[y, x + 1] - smooth[y, x - 1], smooth[y + 1, x] - smooth[y - 1, x]], axis=1)
    lengths = np.maximum(np.linalg.norm(inwards, axis=1, keepdims=True), 1e-9)
    return np.stack([x + left, y + top], axis=1).astype(np.float64), -inwards.astype(np.float64) / lengths


def _closed_lines(inside: Mask) -> list[Array]:
    """The borders of what is inside (H, W) and of its holes: pixels (K, 2), x and y, that lie inside beside others, in
    the order in which one comes by, the first again at the end.
    """
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if not len(rows):
        return []
    corner = np.array([columns[0], rows[0]])
    part = np.pad(inside[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1], 1)
    sides = list[Indices]()
    # Sides of pixels from corner to corner, with what is inside at their right hand (y goes down).
    for away, begin, end in (
        ((-1, 0), (0, 0), (1, 0)),
        ((0, 1), (1, 0), (1, 1)),
        ((1, 0), (1, 1), (0, 1)),
        ((0, -1), (0, 1), (0, 0)),
    ):
        y, x = np.nonzero(part & ~np.roll(part, (-away[0], -away[1]), axis=(0, 1)))
        sides.append(
            np.stack([x, y, x + begin[0], y + begin[1], x + end[0], y + end[1]], axis=1).astype(np.int64)
        )
    leaving = dict[tuple[int, int], list[tuple[int, int, int, int]]]()
    for px, py, ax, ay, bx, by in np.concatenate(sides).tolist():
        leaving.setdefault((ax, ay), []).append((px, py, bx, by))
    lines = list[Array]()
    for start in list(leaving):
        while leaving[start]:
            at, line = start, list[tuple[int, int]]()
            while leaving[at]:
                px, py, bx, by = leaving[at].pop()
                if not line or line[-1] != (px, py):
                    line.append((px, py))
                at = bx, by
            if len(line) == 1 or line[-1] != line[0]:
                line.append(line[0])
            lines.append(np.array(line, dtype=np.float64) + corner - 1.0)
    return lines
