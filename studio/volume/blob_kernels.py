"""The inner loops of blob fitting: which blob a voxel is nearest to, and what each blob then holds.

Voxels come as six rows (x, y, z from the hull's mean, then the three colours), so that a loop over voxels with the
blob held fixed runs on whole vector registers. Sums are made in the order of the voxels, in double precision: the same
voxels give the same bits every time.
"""

import numba
import numpy as np

# Columns of a blob's row in `factors`: mean, upper triangle of the root of its inverse covariance, colour, inverse
# standard deviation of each colour.
FACTORS = 15
# Columns of `gather`: volume, its products with x y z, with xx xy xz yy yz zz, with the colours and their squares.
SUMS = 16
# Voxels at a time, so that their nearest distances stay in the first cache.
CHUNK = 512


@numba.njit(cache=True, nogil=True, error_model="numpy")
def assign(voxels, factors, labels, distances):
    """The nearest blob of each voxel: labels (K,) int32, and its squared Mahalanobis distance, distances (K,) float32.

    voxels : (6, K) float32. factors : (B, FACTORS) float32. Equal distances go to the first blob.
    """
    count = voxels.shape[1]
    for first in range(0, count, CHUNK):
        last = min(first + CHUNK, count)
        x, y, z = voxels[0, first:last], voxels[1, first:last], voxels[2, first:last]
        blue, green, red = voxels[3, first:last], voxels[4, first:last], voxels[5, first:last]
        best, label = distances[first:last], labels[first:last]
        best[:] = np.float32(np.inf)
        label[:] = 0
        for b in range(factors.shape[0]):
            row = factors[b]
            mx, my, mz = row[0], row[1], row[2]
            xx, xy, xz, yy, yz, zz = row[3], row[4], row[5], row[6], row[7], row[8]
            mb, mg, mr, sb, sg, sr = row[9], row[10], row[11], row[12], row[13], row[14]
            for k in range(last - first):
                dx, dy, dz = x[k] - mx, y[k] - my, z[k] - mz
                u = xx * dx + xy * dy + xz * dz
                v = yy * dy + yz * dz
                w = zz * dz
                p = (blue[k] - mb) * sb
                q = (green[k] - mg) * sg
                r = (red[k] - mr) * sr
                d = u * u + v * v + w * w + p * p + q * q + r * r
                nearer = d < best[k]
                best[k] = d if nearer else best[k]
                label[k] = np.int32(b) if nearer else label[k]


@numba.njit(cache=True, nogil=True)
def gather(voxels, volumes, labels, sums):
    """What each blob holds of the voxels assigned to it: sums (B, SUMS) float64, made new.

    voxels : (6, K) float32. volumes : (K,) float64, each voxel's share of all. labels : (K,) int32.
    """
    sums[:] = 0.0
    for k in range(voxels.shape[1]):
        row = sums[labels[k]]
        share = volumes[k]
        x, y, z = np.float64(voxels[0, k]), np.float64(voxels[1, k]), np.float64(voxels[2, k])
        row[0] += share
        row[1] += share * x
        row[2] += share * y
        row[3] += share * z
        row[4] += share * x * x
        row[5] += share * x * y
        row[6] += share * x * z
        row[7] += share * y * y
        row[8] += share * y * z
        row[9] += share * z * z
        for channel in range(3):
            colour = np.float64(voxels[3 + channel, k])
            row[10 + channel] += share * colour
            row[13 + channel] += share * colour * colour


@numba.njit(cache=True, nogil=True)
def count_changes(labels, before):
    """How many labels (K,) differ from those before, which become the same."""
    changed = 0
    for k in range(labels.shape[0]):
        if labels[k] != before[k]:
            changed += 1
            before[k] = labels[k]
    return changed
