"""Blobs learnt from the voxels of the first frames (Caillette, Galata & Howard 2007, section 6.2).

The paper's blobs start as one a body part, are learnt incrementally while the tracker runs its first frames, and are
split and merged by how colour changes along the bone. Here each frame's voxels, given to the limb whose blob they are
nearest to in that frame's pose, are added to *profiles*: sums of volume, place and colour in BINS slices along every
limb. For any division of a limb into blobs, their offset, eigenvalues, colours and shares follow from these sums alone,
so blobs are cut again after every frame, the result does not depend on the order of earlier splits, and only the
profiles (a small array) have to be kept.

**Split and merge.** The criterion is the paper's: the 3×3 mixed covariance of space and colour projected on the bone's
direction, that is the covariance of the place along the bone with each colour, and the norm of this vector. It is
divided by the blob's own standard deviation along the bone, which makes it the change of colour, in levels, over one
such deviation, and one threshold fit for thighs and hands. A blob above it is cut where the two parts' colours vary
least in themselves; neighbours whose union would be below MERGE_SHARE of it become one (halves of different splits
may). An even step of Δ levels in the middle of a limb reaches 0.43 Δ.

Colours that do not change steadily along the bone (stripes) leave the criterion at zero, in the paper as here.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.evidence.volume.blob_fitting import LEAST_COLOUR_VARIANCE, Voxels, nearest_blobs
from studio.evidence.volume.blob_model import SMALLEST_VARIANCE, BlobModel, cone_blobs, cone_moments
from studio.evidence.volume.hull import Hull
from studio.foundations.arrays import Array

IntArray = NDArray[np.int64]

BINS = 24
BEYOND = 0.1
"""The slices reach this share of the limb's length beyond both its ends; the last ones also hold what lies further."""
SUMS = 16
MERGE_SHARE = 0.5
LEAST_PART = 0.15
"""Least share of the limb's volume in each part of a split limb."""
MOST_PARTS = 4
SEEN = 0.05
"""Least share of its cone's volume that the hulls must hold of a limb; below, it keeps its cone."""


@dataclass(frozen=True, slots=True, eq=False)
class Profiles:
    """Statistics of the limbs over the first frames. sums : (L, BINS, SUMS) of each slice of each drawn limb, in mm³
    times: 1; x, y, z; x², y², z²; z times the three colours; the colours; their squares, all in the limb's axes. frames
    : their number.
    """

    sums: Array
    frames: int

    @classmethod
    def none(cls, body: BodyModel) -> "Profiles":
        return cls(np.zeros((len(body.drawn), BINS, SUMS)), 0)

    def with_frame(self, body: BodyModel, model: BlobModel, hull: Hull, pose: Array) -> "Profiles":
        """The profiles with one frame added: its hull, not empty, and its pose (D,)."""
        voxels = Voxels.of(hull)
        coloured = model.in_colour(voxels.colour, voxels.colour_variance)
        mixture = coloured.mixture(body, pose)
        labels = nearest_blobs(voxels, mixture.at(0))
        limbs = model.limb[labels]
        frames = limb_frames(body, pose)[0][limbs]
        local = np.einsum("kji,kj->ki", frames[..., :3], hull.centres - frames[..., 3])
        volumes = hull.volumes()
        return Profiles(self.sums + _sums(body, limbs, local, voxels, volumes), self.frames + 1)


def _sums(body: BodyModel, limbs: IntArray, local: Array, voxels: Voxels, volumes: Array) -> Array:
    """(L, BINS, SUMS) of voxels at places `local` (K, 3) in the axes of their limbs (K,)."""
    length = kinematic_tables(body).limb_shape[limbs, 0]
    share = (local[:, 2] / length + BEYOND) / (1.0 + 2.0 * BEYOND)
    slices = np.clip((share * BINS).astype(np.int64), 0, BINS - 1)
    colours = voxels.rows[3:].T.astype(np.float64)
    squares = local**2 + voxels.extents[:, None]
    columns = np.column_stack(
        [np.ones(len(local)), local, squares, local[:, 2:] * colours, colours, colours**2]
    )
    cells = limbs * BINS + slices
    count = len(body.drawn) * BINS
    made = np.zeros((count, SUMS))
    for index, column in enumerate(columns.T):
        made[:, index] = np.bincount(cells, volumes * column, minlength=count)
    return made.reshape(len(body.drawn), BINS, SUMS)


def blobs_of(body: BodyModel, profiles: Profiles, split: float, most_parts: int = MOST_PARTS) -> BlobModel:
    """The blobs of the profiles; the cones' own where nothing was seen.

    split : levels of colour over a standard deviation along the bone beyond which a blob is cut.
    """
    cones, moments = cone_blobs(body), cone_moments(body)
    rows: list[tuple[int, Array, float]] = []
    for limb, slices in enumerate(profiles.sums):
        seen = slices[:, 0].sum()
        least = SEEN * moments.volume[limb] * max(profiles.frames, 1)
        if profiles.frames == 0 or seen < least:
            rows.append((limb, np.zeros(SUMS), least if profiles.frames else moments.volume[limb]))
            continue
        for first, last in parts_of(slices, split, most_parts):
            rows.append((limb, slices[first:last].sum(axis=0), 0.0))
    volumes = np.array([sums[0] + unseen for _, sums, unseen in rows])
    limb = np.array([row[0] for row in rows], dtype=np.int64)
    described = [
        _describe(sums) if sums[0] > 0.0 else (cones.offset[place], cones.eigenvalues[place], *_unknown())
        for place, sums, _ in rows
    ]
    offset, eigenvalues, colour, variance = (np.array(column) for column in zip(*described, strict=True))
    return BlobModel(limb, offset, eigenvalues, colour, variance, volumes / volumes.sum())


def _unknown() -> tuple[Array, Array]:
    return np.full(3, np.nan), np.full(3, np.nan)


def _describe(sums: Array) -> tuple[float, Array, Array, Array]:
    """Offset, eigenvalues (3,), colour (3,) and its variance (3,) of a part's sums (SUMS,)."""
    volume = sums[0]
    means, squares = sums[1:4] / volume, sums[4:7] / volume
    colour = sums[10:13] / volume
    variance = np.maximum(sums[13:16] / volume - colour**2, LEAST_COLOUR_VARIANCE)
    return float(means[2]), np.maximum(squares - means**2, SMALLEST_VARIANCE), colour, variance


def colour_change(sums: Array) -> float:
    """The split criterion of sums (SUMS,): levels of colour over a standard deviation along the bone."""
    volume = max(float(sums[0]), np.finfo(np.float64).tiny)
    place, colour = sums[3] / volume, sums[10:13] / volume
    mixed = sums[7:10] / volume - place * colour
    spread = max(float(sums[6] / volume - place**2), SMALLEST_VARIANCE)
    return float(np.linalg.norm(mixed) / np.sqrt(spread))


def parts_of(slices: Array, split: float, most_parts: int = MOST_PARTS) -> list[tuple[int, int]]:
    """Which slices (BINS, SUMS) of a limb make one blob each: (first, last + 1), in order along the bone."""
    least = LEAST_PART * slices[:, 0].sum()
    parts = [(0, len(slices))]
    while len(parts) < most_parts:
        changes = [colour_change(slices[first:last].sum(axis=0)) for first, last in parts]
        cuts = [
            _best_cut(slices, first, last, least) if change > split else None
            for (first, last), change in zip(parts, changes, strict=True)
        ]
        open_parts = [index for index, cut in enumerate(cuts) if cut is not None]
        if not open_parts:
            break
        worst = max(open_parts, key=lambda index: changes[index])
        first, last = parts[worst]
        cut = cuts[worst]
        assert cut is not None
        parts[worst : worst + 1] = [(first, cut), (cut, last)]
    return _merged(slices, parts, MERGE_SHARE * split)


def _merged(slices: Array, parts: list[tuple[int, int]], threshold: float) -> list[tuple[int, int]]:
    """Parts with neighbours made one while their union's criterion stays below the threshold."""
    merged = list(parts)
    while len(merged) > 1:
        unions = [
            colour_change(slices[first[0] : second[1]].sum(axis=0))
            for first, second in itertools.pairwise(merged)
        ]
        calmest = int(np.argmin(unions))
        if unions[calmest] >= threshold:
            break
        merged[calmest : calmest + 2] = [(merged[calmest][0], merged[calmest + 1][1])]
    return merged


def _best_cut(slices: Array, first: int, last: int, least: float) -> int | None:
    """The slice before which to cut so that the colours of the two parts vary least; None where a part would hold less
    than `least` of the volume.
    """
    forward = np.cumsum(slices[first:last], axis=0)
    whole = forward[-1]
    best, lowest = None, np.inf
    for cut in range(1, last - first):
        left, right = forward[cut - 1], whole - forward[cut - 1]
        if min(left[0], right[0]) < max(least, np.finfo(np.float64).tiny):
            continue
        within = sum(float((part[13:16] - part[10:13] ** 2 / part[0]).sum()) for part in (left, right))
        if within < lowest:
            best, lowest = first + cut, within
    return best
