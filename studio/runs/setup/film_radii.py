"""Radii of limbs from the borders of masks, the bones being known.

Each point of a silhouette's border belongs to the limb that reaches farthest there; from that limb's bone to the point
is its radius at that place. Whose the points are, and the radii, are found in turns; a limb that forms no border, since
others hide it in every view, is not measured.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from studio.body.definition import split_sign
from studio.body.forward_kinematics import limb_frames
from studio.body.mirroring import name_twins
from studio.body.model import BodyModel
from studio.body.stretching import with_slides
from studio.evidence.distance_maps import distances_of
from studio.foundations.arrays import Array, Bytes, Floats, Indices
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

ALONG = np.linspace(0.02, 0.98, 13)
"""Shares of a limb's length at which it is measured; what is nearest to the first or last is round an end."""
BORDER, MOST_VIEWS = 150, 120
"""Points of a view's border, and views that are looked at."""
FEWEST = 20
"""Points of a limb below which nothing is said of it."""
TURNS = 12
TEMPLATE_SPREAD, POINT_SPREAD = 0.5, 0.15
"""Standard deviations, as shares: of the template's radius, and of the radius as one point gives it."""
LEAST, GREATEST = 0.1, 4.0
"""Times the template's radius."""


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """reach : (K, L, T) mm from K points of a border to places along the limbs' bones, as a round limb's radius."""

    reach: Floats


def measured_radii(
    body: BodyModel,
    cameras: Sequence[Camera],
    frames: Sequence[tuple[Array, Mapping[str, Bytes]]],
    *,
    symmetric: bool = True,
) -> dict[str, tuple[float, float]]:
    """Dimensions that are radii of limbs which the masks show: mm, and how far single points of the border are from
    that, mm (median).

    frames : a pose (D,) of the body, and masks by camera.
    """
    looks = [
        (pose, camera, masks[camera.name])
        for pose, masks in frames
        for camera in cameras
        if camera.name in masks
    ]
    kept = looks[:: -(-len(looks) // MOST_VIEWS)] if looks else []
    views = [view for one in kept if (view := _view(body, *one)) is not None]
    return _Radii(body, symmetric=symmetric).fitted(views) if views else {}


def _view(body: BodyModel, pose: Array, camera: Camera, mask: Bytes) -> _View | None:
    border = distances_of(mask, BORDER).border
    if not len(border):
        return None
    frames = limb_frames(body, pose)[0]
    lengths = np.array([limb.length for limb in body.drawn])
    scales = np.array([(limb.scale_x, limb.scale_y) for limb in body.drawn])
    axes = frames[:, :, 2]
    points = frames[:, None, :, 3] + (ALONG * lengths[:, None])[..., None] * axes[:, None]
    across = np.cross(axes[:, None], points - camera.centre)
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    places, beside = project(camera, points)[0], project(camera, points + across)[0]
    per_mm = np.linalg.norm(beside - places, axis=-1)
    # How far an elliptical limb reaches across, beside a round one.
    own = np.einsum("lxk,ltx->ltk", frames[:, :, :2], across) * scales[:, None]
    stretched = np.linalg.norm(own, axis=-1)
    off = np.linalg.norm(border[:, None, None] - places, axis=-1)
    return _View(np.nan_to_num(off / (per_mm * stretched), nan=np.inf, posinf=np.inf).astype(np.float32))


class _Radii:
    def __init__(self, body: BodyModel, *, symmetric: bool) -> None:
        assert body.definition is not None
        entries = {limb.name: limb for limb in with_slides(body.definition, body.dimensions).limbs}
        self.body = body
        ends = [
            tuple(getattr(entries[limb.name], key) for key in ("radius_start", "radius_end"))
            for limb in body.drawn
        ]
        self.names = list(
            dict.fromkeys(split_sign(one)[1] for pair in ends for one in pair if isinstance(one, str))
        )
        twins = name_twins(self.names).tolist() if symmetric else list(range(len(self.names)))
        place = {name: min(at, twin) for at, (name, twin) in enumerate(zip(self.names, twins, strict=True))}
        self.place = place
        self.ends = np.array(
            [[place[split_sign(one)[1]] if isinstance(one, str) else -1 for one in pair] for pair in ends]
        )
        self.fixed = np.array([(limb.radius_start, limb.radius_end) for limb in body.drawn])
        self.before = np.array([body.dimensions[name] for name in self.names])

    def along(self, values: Array) -> Array:
        """(L, T) radii along the limbs."""
        ends = np.where(self.ends >= 0, values[self.ends], self.fixed) if len(values) else self.fixed
        return ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * ALONG

    def owners(self, views: Sequence[_View], values: Array) -> tuple[Indices, Indices, Array]:
        """Of every point of a border that lies beside a limb: its limb, the place along it, and its reach."""
        radii = self.along(values).astype(np.float32)
        limbs, places, reaches = list[Indices](), list[Indices](), list[Floats]()
        for view in views:
            beyond = (view.reach - radii).reshape(len(view.reach), -1)
            best = beyond.argmin(axis=1)
            limb, place = np.divmod(best, len(ALONG))
            beside = (place > 0) & (place < len(ALONG) - 1)
            limbs.append(limb[beside])
            places.append(place[beside])
            reaches.append(view.reach.reshape(len(view.reach), -1)[np.arange(len(best)), best][beside])
        return np.concatenate(limbs), np.concatenate(places), np.concatenate(reaches).astype(np.float64)

    def fitted(self, views: Sequence[_View]) -> dict[str, tuple[float, float]]:
        values = self.before.copy()
        if not len(values):
            return {}
        for _ in range(TURNS):
            limb, place, reach = self.owners(views, values)
            usual = self.along(values)[limb, place]
            sigma = POINT_SPREAD * np.maximum(usual, 1e-6)
            # Huber's weights: a point far off is of a fault of the mask.
            off = np.abs(reach - usual) / sigma
            weight = np.sqrt(np.minimum(1.0, 1.0 / np.maximum(off, 1e-9))) / sigma
            rows, wanted = np.zeros((len(limb), len(values))), weight * reach
            for end, share in ((0, 1.0 - ALONG[place]), (1, ALONG[place])):
                at = self.ends[limb, end]
                named = at >= 0
                rows[np.flatnonzero(named), at[named]] += (weight * share)[named]
                wanted = wanted - np.where(named, 0.0, weight * share * self.fixed[limb, end])
            spread = TEMPLATE_SPREAD * np.maximum(self.before, 1e-6)
            answer = scipy.optimize.lsq_linear(
                np.concatenate([rows, np.diag(1.0 / spread)]),
                np.concatenate([wanted, self.before / spread]),
                (LEAST * self.before, GREATEST * np.maximum(self.before, 1e-6)),
            )
            values = answer.x
        limb, place, reach = self.owners(views, values)
        off = np.abs(reach - self.along(values)[limb, place])
        measured = dict[str, tuple[float, float]]()
        for name in self.names:
            at = self.place[name]
            near = self.ends[limb, (ALONG[place] >= 0.5).astype(np.int64)] == at
            if near.sum() >= FEWEST:
                measured[name] = float(values[at]), float(np.median(off[near]))
        return measured
