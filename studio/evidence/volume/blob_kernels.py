# pyright: standard
"""The inner loops of blob fitting: assignment of voxels to blobs, sums by blob, update of the blobs.

Voxels come as six rows (x, y, z from the hull's mean, then the three colours), so that a loop over voxels with the
blob held fixed runs on whole vector registers. Sums are made in the order of the voxels, in double precision: the same
voxels give the same bits every time.
"""

import math

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Floats
from studio.foundations.numba_in_threads import EXACT, KERNEL, njit

# Columns of a blob's row in `factors`: mean, upper triangle of the root of its inverse covariance, colour, inverse
# standard deviation of each colour.
FACTORS = 15
# Columns of `gather`: volume, its products with x y z, with xx xy xz yy yz zz, with the colours and their squares, and
# with the voxels' own extents.
SUMS = 17
# Columns of a blob in `state`: mean, covariance xx xy xz yy yz zz, colour, variance of each colour, weight.
STATE = 16
LOG_TWO_PI = math.log(2.0 * math.pi)
# Voxels per block, so that their nearest distances stay in the first-level cache.
CHUNK = 512


@njit(**EXACT)
def assign(voxels: Floats, factors: Floats, labels: NDArray[np.int32], distances: Floats) -> None:
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


@njit(**KERNEL)
def gather(voxels, volumes, extents, labels, sums):
    """Sums over the voxels assigned to each blob, sums (B, SUMS) float64, overwritten.

    voxels : (6, K) float32. volumes : (K,) each voxel's share of all. extents : (K,) mm². labels : (K,) int32.
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
        row[16] += share * extents[k]


@njit(**KERNEL)
def count_changes(labels, before):
    """Number of labels (K,) that differ from those before; `before` is updated."""
    changed = 0
    for k in range(labels.shape[0]):
        if labels[k] != before[k]:
            changed += 1
            before[k] = labels[k]
    return changed


@njit(**KERNEL)
def precision_of(blob, inverse):
    """The inverse of a blob's covariance, inverse (6,) xx xy xz yy yz zz, and its determinant. blob : (STATE,)."""
    xx, xy, xz, yy, yz, zz = blob[3], blob[4], blob[5], blob[6], blob[7], blob[8]
    first, second, third = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * first + xy * second + xz * third
    inverse[0], inverse[1], inverse[2] = first / determinant, second / determinant, third / determinant
    inverse[3] = (xx * zz - xz * xz) / determinant
    inverse[4] = (xy * xz - xx * yz) / determinant
    inverse[5] = (xx * yy - xy * xy) / determinant
    return determinant


@njit(**KERNEL)
def fill_factors(state: Array, factors: Floats) -> None:
    """The rows of `assign`, factors (B, FACTORS), of blobs (B, STATE): the root is Lᵀ of Σ⁻¹ = L Lᵀ (Cholesky)."""
    inverse = np.empty(6)
    for b in range(state.shape[0]):
        blob, row = state[b], factors[b]
        precision_of(blob, inverse)
        a = math.sqrt(inverse[0])
        d, e = inverse[1] / a, inverse[2] / a
        f = math.sqrt(inverse[3] - d * d)
        g = (inverse[4] - d * e) / f
        h = math.sqrt(inverse[5] - e * e - g * g)
        row[0], row[1], row[2] = blob[0], blob[1], blob[2]
        row[3], row[4], row[5], row[6], row[7], row[8] = a, d, e, f, g, h
        for channel in range(3):
            row[9 + channel] = blob[9 + channel]
            row[12 + channel] = 1.0 / math.sqrt(blob[12 + channel])


@njit(**KERNEL)
def likelihood_of(state, sums, colours):
    """Nats a voxel: the mean over the volume of ln β + ln N(x; fitted) + ln N(colour; learnt) of each voxel's own blob,
    from the blobs' sums. state : (B, STATE). colours : (B, 6) the learnt colours and their variances.
    """
    inverse, total = np.empty(6), 0.0
    for b in range(state.shape[0]):
        held, row, blob = sums[b, 0], sums[b], state[b]
        if held <= 0.0:
            continue
        logs = math.log(precision_of(blob, inverse))
        about = 0
        for i in range(3):
            for j in range(i, 3):
                first, second = row[1 + i] / held, row[1 + j] / held
                spread = row[4 + about] / held - first * second + (first - blob[i]) * (second - blob[j])
                logs += (1.0 if i == j else 2.0) * inverse[about] * spread
                about += 1
        for channel in range(3):
            mean, variance = colours[b, channel], colours[b, 3 + channel]
            off = row[13 + channel] - 2.0 * mean * row[10 + channel] + mean * mean * held
            logs += off / (held * variance) + math.log(variance)
        total += held * (math.log(blob[15]) - 0.5 * (6.0 * LOG_TWO_PI + logs))
    return total


@njit(**KERNEL)
def update(predicted, sums, prior_share, least_colour, state):
    """The M-step: state (B, STATE) from the blobs' sums, the prediction counting as `prior_share` of its volume.

    least_colour : levels², the least variance of a colour. The six entries of a covariance may make it too thin.
    """
    whole = 0.0
    for b in range(state.shape[0]):
        row, before, blob = sums[b], predicted[b], state[b]
        prior = prior_share * before[15]
        total = row[0] + prior
        whole += total
        for i in range(3):
            blob[i] = (row[1 + i] + prior * before[i]) / total
        about = 0
        for i in range(3):
            for j in range(i, 3):
                own = before[3 + about] + before[i] * before[j]
                blob[3 + about] = (row[4 + about] + prior * own) / total - blob[i] * blob[j]
                if i == j:
                    blob[3 + about] += row[16] / total
                about += 1
        for channel in range(9, 12):
            mean = (row[channel + 1] + prior * before[channel]) / total
            square = row[channel + 4] + prior * (before[channel + 3] + before[channel] ** 2)
            blob[channel] = mean
            blob[channel + 3] = max(square / total - mean * mean, least_colour)
        blob[15] = total
    state[:, 15] /= whole


@njit(**KERNEL)
def thicken(state, least):
    """Raise the covariances' eigenvalues to at least `least` mm², in place."""
    for b in range(state.shape[0]):
        blob = state[b]
        x, y, z = blob[3] - least, blob[6] - least, blob[8] - least
        plane = x * y - blob[4] * blob[4]
        first, second = y * z - blob[7] * blob[7], blob[5] * blob[7] - blob[4] * z
        third = blob[4] * blob[7] - blob[5] * y
        if x >= 0.0 and plane >= 0.0 and x * first + blob[4] * second + blob[5] * third >= 0.0:
            continue
        matrix = np.array(
            [[blob[3], blob[4], blob[5]], [blob[4], blob[6], blob[7]], [blob[5], blob[7], blob[8]]]
        )
        values, axes = np.linalg.eigh(matrix)
        about = 3
        for i in range(3):
            for j in range(i, 3):
                blob[about] = 0.0
                for k in range(3):
                    blob[about] += max(values[k], least) * axes[i, k] * axes[j, k]
                about += 1


@njit(**KERNEL)
def fit(
    voxels: Floats,
    volumes: Array,
    extents: Array,
    predicted: Array,
    colours: Array,
    rules: Array,
    best: Array,
    best_labels: NDArray[np.int32],
) -> float:
    """K-means from the predicted blobs (B, STATE): writes the likeliest state to best (B, STATE), the voxels' nearest
    blobs to best_labels (K,); returns their likelihood.

    colours : (B, 6) learnt colours and variances. rules : most rounds, share of voxels that may still change their
    blob, weight of the prediction, least colour variance, least variance.
    """
    count = voxels.shape[1]
    labels, before = np.empty(count, np.int32), np.full(count, -1, np.int32)
    distances = np.empty(count, np.float32)
    factors = np.empty((predicted.shape[0], FACTORS), np.float32)
    sums = np.empty((predicted.shape[0], SUMS))
    state, likelihood = predicted.copy(), -np.inf
    for step in range(int(rules[0]) + 1):
        fill_factors(state, factors)
        assign(voxels, factors, labels, distances)
        changed = count_changes(labels, before)
        gather(voxels, volumes, extents, labels, sums)
        improved = likelihood_of(state, sums, colours)
        if step > 0 and improved <= likelihood:
            break
        best[:] = state
        best_labels[:] = labels
        likelihood = improved
        if changed <= rules[1] * count:
            break
        update(predicted, sums, rules[2], rules[3], state)
        thicken(state, rules[4])
    return likelihood
