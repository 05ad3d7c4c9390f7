"""Solving a banded, positive definite system on one thread.

LAPACK's solver hands these narrow bands to all processors, which costs more than it saves, and very much more where
others use them (30 s instead of 0.05 s for 30 frames on two busy cores).
"""

import numpy as np

from studio.numba_in_threads import numba

SMALLEST = 1e-12


@numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def solve_banded(lower, right):
    """x with A x = right (n,), by Cholesky's factors, which take the place of `lower`; right becomes x.

    lower : (n, w + 1), row i holds A[i, i - w ... i]; what would lie left of the matrix is not read.
    """
    count, reach = lower.shape[0], lower.shape[1] - 1
    for i in range(count):
        first = max(0, i - reach)
        for j in range(first, i + 1):
            begin = max(first, j - reach)
            total = lower[i, j - i + reach]
            mine, theirs = lower[i], lower[j]
            to_mine, to_theirs = reach - i, reach - j
            for k in range(begin, j):
                total -= mine[k + to_mine] * theirs[k + to_theirs]
            if j < i:
                lower[i, j - i + reach] = total / lower[j, reach]
            else:
                lower[i, reach] = np.sqrt(max(total, SMALLEST))
    for i in range(count):
        total = right[i]
        for k in range(max(0, i - reach), i):
            total -= lower[i, k - i + reach] * right[k]
        right[i] = total / lower[i, reach]
    for i in range(count - 1, -1, -1):
        right[i] /= lower[i, reach]
        for k in range(max(0, i - reach), i):
            right[k] -= lower[i, k - i + reach] * right[i]
    return right
