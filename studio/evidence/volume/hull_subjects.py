"""Several subjects in one visual hull: which of its voxels are whose, in the first frame and over time.

Where subjects stand among few cameras, the hull has ghosts too: places that are foreground in every view by chance,
some as large as a subject. A ghost lies, in every view, in front of or behind something real; so a piece is real only
if there are masks that no other piece explains.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_pieces import chosen_voxels, piece_numbers
from studio.evidence.volume.hull_silhouette import silhouette
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera

NOBODY = -1
LEAST_PIECE = 0.15
"""Volume of a subject's piece in the first frame, as a share of the largest one's."""
LEAST_FRAGMENT = 0.01
"""Of the largest piece's volume: smaller pieces are noise."""
OWN_SHARE, OWN_VIEWS = 0.1, 2
"""A piece is real if in so many views so much of its silhouette is foreground that no other piece explains."""
REACH = 150.0
"""mm (of a person: `scale_of`) from a subject's voxels of the frame before within which a voxel may be his, where he
touches another."""
STRETCH = 250.0
"""mm (of a person) that a subject may reach farther from his middle, over the floor, than in the first frame: no label
creeps along ghosts."""
ROUNDS = 2
"""Each estimates again how a subject moves from one frame to the next."""
NEARLY_ALL = 0.97
"""Share of a piece from which all of it is one subject's."""
PLACE_REACH = 600.0
"""mm (of a person) between a place on the floor and the subject there."""

Labels = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class HullSubject:
    """A subject seen in a hull. place : (2,) mm, x and y of its voxels' middle. volume : mm³. top : mm above z = 0."""

    place: Array
    volume: float
    top: float


def real_pieces(hull: Hull, masks: Sequence[Bytes], cameras: Sequence[Camera]) -> tuple[Labels, list[int]]:
    """(K,) the piece of each voxel, and the numbers of those that are no ghosts, the largest first.

    masks : (h, w), of the size of the cameras. The smallest are tested first: of two that explain the same, the larger
    stays.
    """
    numbers, volumes = piece_numbers(hull)
    kept = [int(piece) for piece in np.flatnonzero(volumes >= LEAST_FRAGMENT * volumes[:1].sum())]
    seen = {
        piece: [silhouette(chosen_voxels(hull, numbers == piece), camera) > 0 for camera in cameras]
        for piece in kept
    }
    foreground = [mask > 0 for mask in masks]
    needed = min(OWN_VIEWS, len(cameras))
    for piece in reversed(list(kept)):
        others = [other for other in kept if other != piece]
        own_views = 0
        for view, mask in enumerate(foreground):
            own = seen[piece][view]
            alone = own & mask
            for other in others:
                alone &= ~seen[other][view]
            own_views += bool(np.count_nonzero(alone) > OWN_SHARE * max(np.count_nonzero(own), 1))
        if own_views < needed and others:
            kept = others
    return numbers, kept


def subjects_of(
    hull: Hull, masks: Sequence[Bytes], cameras: Sequence[Camera]
) -> tuple[Labels, list[HullSubject]]:
    """(K,) the subject of each voxel, NOBODY for ghosts and fragments, and the subjects, the largest first."""
    numbers, kept = real_pieces(hull, masks, cameras)
    volumes = hull.volumes()
    sizes = [float(volumes[numbers == piece].sum()) for piece in kept]
    large = [piece for piece, size in zip(kept, sizes, strict=True) if size >= LEAST_PIECE * max(sizes)]
    labels = np.full(len(numbers), NOBODY, dtype=np.int64)
    subjects: list[HullSubject] = []
    for label, piece in enumerate(large):
        own = numbers == piece
        labels[own] = label
        part = chosen_voxels(hull, own)
        middle = (part.centres[:, :2] * part.weights()[:, None]).sum(axis=0)
        subjects.append(HullSubject(middle, part.volume(), part.top()))
    return labels, subjects


def labels_at(
    hull: Hull, labels: Labels, subjects: Sequence[HullSubject], places: Array, scale: float = 1.0
) -> tuple[Labels | None, int]:
    """(K,) labels by which the subject at places[i] is i, all others of the frame come after; and how many there are.

    labels, subjects : of `subjects_of`. places : (P, 2) mm. Two places in one piece part it between them. None where
    nobody stands near a place; the number is then that place's. scale : of the body beside a person (`scale_of`).
    """
    chosen: list[int] = []
    for at, place in enumerate(places):
        apart = [
            float(np.linalg.norm(hull.centres[labels == label][:, :2] - place, axis=1).min())
            for label in range(len(subjects))
        ]
        # Of two near the place (a hull's limbs reach far), it is meant for whose middle is nearer.
        near = [label for label, distance in enumerate(apart) if distance <= PLACE_REACH * scale]
        if not near:
            return None, at
        chosen.append(
            min(
                near,
                key=lambda label: (apart[label] > 0.0, float(np.linalg.norm(subjects[label].place - place))),
            )
            if len(near) > 1
            else near[0]
        )
    owners = np.full(len(labels), NOBODY, dtype=np.int64)
    count = len(places)
    for label in range(len(subjects)):
        own = labels == label
        at = [number for number, one in enumerate(chosen) if one == label]
        if not at:
            owners[own] = count
            count += 1
        elif len(at) == 1:
            owners[own] = at[0]
        else:
            distances = np.linalg.norm(hull.centres[own][:, None, :2] - places[at], axis=2)
            owners[own] = np.array(at)[distances.argmin(axis=1)]
    return owners, count


class HullFollower:
    """Follows labelled voxels from frame to frame. scale : of the body beside a person (`scale_of`)."""

    def __init__(self, hull: Hull, labels: Labels, scale: float = 1.0) -> None:
        self._reach, count = REACH * scale, int(labels.max(initial=NOBODY)) + 1
        self._subjects = [_Followed(hull.centres[labels == label], STRETCH * scale) for label in range(count)]

    def step(self, hull: Hull, masks: Sequence[Bytes], cameras: Sequence[Camera]) -> Labels:
        """(K,) labels of the next frame's hull, NOBODY for ghosts and for what was not there.

        A piece is whose voxels were nearest in the frame before, moved on as they moved then; one that several share
        (they touch) is parted between them, voxel by voxel. Who is not seen stays where he was.
        """
        owners = np.full(len(hull.centres), NOBODY, dtype=np.int64)
        if hull.empty:
            return owners
        numbers, kept = real_pieces(hull, masks, cameras)
        volumes = hull.volumes()
        moved = [subject.velocity for subject in self._subjects]
        for _ in range(ROUNDS):
            apart = np.stack(
                [one.apart(hull.centres, to) for one, to in zip(self._subjects, moved, strict=True)]
            )
            guess = np.where(apart.min(axis=0) <= self._reach, apart.argmin(axis=0), NOBODY)
            owners[:] = NOBODY
            for piece in kept:
                own = np.flatnonzero((numbers == piece) & (guess != NOBODY))
                if not len(own):
                    continue
                shares = np.bincount(guess[own], weights=volumes[own])
                most = int(shares.argmax())
                if shares[most] >= NEARLY_ALL * shares.sum():
                    owners[numbers == piece] = most
                else:
                    owners[own] = guess[own]
            moved = [
                np.median(hull.centres[owners == label, :2], axis=0) - subject.middle
                if (owners == label).any()
                else np.zeros(2)
                for label, subject in enumerate(self._subjects)
            ]
        for label, subject in enumerate(self._subjects):
            subject.keep(hull.centres[owners == label], moved[label])
        return owners


class _Followed:
    """A subject's voxels (K, 3) when last seen. stretch : mm that it may reach farther than in the first frame."""

    def __init__(self, centres: Array, stretch: float) -> None:
        self.middle, self.velocity = np.median(centres[:, :2], axis=0), np.zeros(2)
        self._farthest = float(np.linalg.norm(centres[:, :2] - self.middle, axis=1).max()) + stretch
        self._tree = cKDTree(centres)

    def apart(self, centres: Array, moved: Array) -> Array:
        """(K,) mm of places (K, 3) from its voxels, moved on by (2,) mm over the floor; inf out of its reach."""
        offsets = centres - np.array([*moved, 0.0])
        distances = np.asarray(self._tree.query(offsets)[0], dtype=np.float64)
        away = np.linalg.norm(offsets[:, :2] - self.middle, axis=1)
        return np.where(away <= self._farthest, distances, np.inf)

    def keep(self, centres: Array, moved: Array) -> None:
        """Learn the voxels of the next frame, if there are any."""
        self.velocity = moved
        if len(centres):
            self.middle, self._tree = self.middle + moved, cKDTree(centres)


def label_silhouettes(hull: Hull, labels: Labels, count: int, camera: Camera) -> list[Bytes]:
    """(H, W) 0 or 255 each: where a camera sees the voxels of the labels 0 to `count` - 1."""
    return [silhouette(chosen_voxels(hull, labels == label), camera) for label in range(count)]
