"""Symmetric banded equations, solved in one order on one thread.

LAPACK's result depends in its last bits on the number of BLAS threads, and a descent with decisions (accept a step or
not) amplifies these to millimetres; a run must be the same on any number of threads. Narrow bands do not gain from
threads either (30 s instead of 0.05 s for 30 frames on two busy cores).
"""

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.numba_in_threads import KERNEL, njit


def solve_banded(rows: Array, right: Array, least: float = 0.0) -> Array:
    """x of A x = right, A symmetric and positive definite, by Cholesky's method.

    rows : (N, W), A's lower half: rows[i, W - 1 - k] is A[i, i - k]; it is overwritten. right : (N,). least : if above
    0, smaller pivots are raised to it. Raises FloatingPointError where A is not positive definite.
    """
    found = np.array(right, dtype=np.float64)
    if not _solved(rows, found, least):
        raise FloatingPointError("the matrix is not positive definite")
    return found


@njit(**KERNEL)
def _solved(rows: Array, right: Array, least: float) -> bool:
    """Factor and solve in place; return whether the matrix is positive definite.

    A column's products are taken from all entries behind it at once, which vectorises without changing the order in
    which any entry's are.
    """
    count, width = rows.shape
    last = width - 1
    column = np.empty(width)
    for j in range(count):
        pivot = max(rows[j, last], least)
        if not pivot > 0.0:
            return False
        rows[j, last] = np.sqrt(pivot)
        behind = min(last, count - 1 - j)
        for k in range(behind):
            column[k] = rows[j + 1 + k, last - 1 - k] / rows[j, last]
            rows[j + 1 + k, last - 1 - k] = column[k]
        for i in range(behind):
            row, share = rows[j + 1 + i], column[i]
            for k in range(i + 1):
                row[last - i + k] -= share * column[k]
        right[j] /= rows[j, last]
        for k in range(behind):
            right[j + 1 + k] -= column[k] * right[j]
    for i in range(count - 1, -1, -1):
        right[i] /= rows[i, last]
        for k in range(max(0, i - last), i):
            right[k] -= rows[i, k - i + last] * right[i]
    return True
