"""Normal equations of outlines against a silhouette's border, for bodies whose size changes with their pose."""

import numpy as np

from studio.numba_in_threads import njit
from studio.tracking.refinement_kernels import (
    OPTIONS,
    add_border,
    add_limbs,
    look_at_limbs,
    mirror_lower_half,
)


@njit(**OPTIONS)
def border_equations(quads, slopes, ends, border, views, mm, scales, matrix, gradient):
    """Fill matrix (P, P) and gradient (P,) of half the loss of `refinement_kernels`; returns the loss.

    quads : (V, L, 4, 2) pixels, NaN for limbs that are not seen. slopes : (V, L, 4, 2, P) per unit of each parameter
    of pose and shape. ends : (L,) whether a limb's far end may be border. border : (K, 4). views : (V, 2) first and
    last border point. mm : (V,) mm per pixel. scales : (V,) c of the loss, mm.
    """
    limbs = quads.shape[1]
    slack = np.zeros(limbs)
    normals, pulls, boxes = np.zeros((limbs, 8, 8)), np.zeros((limbs, 8)), np.zeros((limbs, 4))
    usable, turns, which = np.zeros(limbs, np.bool_), np.zeros(limbs), np.zeros(slopes.shape[4], np.int64)
    matrix[:] = 0.0
    gradient[:] = 0.0
    loss = 0.0
    for v in range(quads.shape[0]):
        look_at_limbs(quads[v], slopes[v], usable, turns, boxes)
        normals[:], pulls[:] = 0.0, 0.0
        seen = border[views[v, 0] : views[v, 1]]
        loss += add_border(
            seen, quads[v], usable, turns, boxes, ends, slack, mm[v], scales[v], normals, pulls
        )
        add_limbs(normals, pulls, slopes[v], usable, which, matrix, gradient)
    mirror_lower_half(matrix)
    return loss
