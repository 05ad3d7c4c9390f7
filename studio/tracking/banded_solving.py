"""Symmetric banded equations, solved in one order.

LAPACK's answer depends in its last bits on how many threads the BLAS has, and a descent with decisions in it (accept a
step or not) makes millimetres of them; the same run must come out on any number of threads.
"""

import numpy as np
from numpy.typing import NDArray

from studio.numba_in_threads import njit

Array = NDArray[np.float64]


def solve_banded(rows: Array, right: Array) -> Array:
    """x of A x = right, A symmetric and positive definite, by Cholesky's method.

    rows : (N, W), A's lower half: rows[i, W - 1 - k] is A[i, i - k]; it is written over. right : (N,). Raises
    FloatingPointError where A is not positive definite.
    """
    found = np.array(right, dtype=np.float64)
    if not _solved(rows, found):
        raise FloatingPointError("the matrix is not positive definite")
    return found


@njit(cache=True, nogil=True)
def _solved(rows, right):
    """Factor in place, then solve in place; whether the matrix is positive definite."""
    count, width = rows.shape
    last = width - 1
    for i in range(count):
        for j in range(max(0, i - last), i + 1):
            total = rows[i, j - i + last]
            for k in range(max(0, i - last), j):
                total -= rows[i, k - i + last] * rows[j, k - j + last]
            if j < i:
                rows[i, j - i + last] = total / rows[j, last]
            elif total > 0.0:
                rows[i, last] = np.sqrt(total)
            else:
                return False
        for k in range(max(0, i - last), i):
            right[i] -= rows[i, k - i + last] * right[k]
        right[i] /= rows[i, last]
    for i in range(count - 1, -1, -1):
        right[i] /= rows[i, last]
        for k in range(max(0, i - last), i):
            right[k] -= rows[i, k - i + last] * right[i]
    return True
