"""What a body cannot do: leave its joints' limits."""

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel

Array = NDArray[np.float64]


class HardPriors:
    """What a body cannot do (the hard priors of Balan et al. that Fleischmann et al. 2012, 2.3, use)."""

    def __init__(self, body: BodyModel) -> None:
        self.lower = np.array([entry.lower for entry in body.parameters])
        self.upper = np.array([entry.upper for entry in body.parameters])

    def hold(self, poses: Array, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether every parameter lies within its limits, both included."""
        poses = np.asarray(poses, dtype=np.float64)
        return np.all((poses >= self.lower) & (poses <= self.upper), axis=1)
