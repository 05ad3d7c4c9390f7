"""The visual hull of one frame: the largest body that all silhouettes allow, as coloured voxels of an octree."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.evidence.volume.tracking_space import Box
from studio.foundations.arrays import Array, Floats


@dataclass(frozen=True, slots=True, eq=False)
class Hull:
    """K voxels of an octree; those well inside are larger than those at the surface.

    centres : (K, 3) mm, world. edges : (K,) mm, length of each voxel's edge. view_colours : (K, V, 3) 0 to 255, BGR,
    mean colour of the voxel's foreground samples in each view, NaN in a view where it has none. colours : (K, 3) the
    mean of these (of all samples where no view has any). depth : of the octree; 16 voxels a side are depth 4. box : the
    tracking space.
    """

    centres: Array
    edges: Array
    colours: Floats
    view_colours: Floats
    depth: int
    box: Box

    @property
    def empty(self) -> bool:
        """Whether nothing was found."""
        return len(self.centres) == 0

    @property
    def smallest_edge(self) -> float:
        """Edge of a voxel at the last depth, mm."""
        return self.box.edge / 2.0**self.depth

    def volumes(self) -> Array:
        """(K,) mm³ of each voxel."""
        return self.edges**3

    def volume(self) -> float:
        """All voxels' volume, mm³."""
        return float(np.sum(self.volumes()))

    def weights(self) -> Array:
        """(K,) each voxel's share of the volume; they sum to 1 unless the hull is empty."""
        volumes = self.volumes()
        return volumes / max(float(volumes.sum()), np.finfo(np.float64).tiny)

    def top(self) -> float:
        """Height of the highest voxel's upper face, mm; NaN for an empty hull."""
        return float((self.centres[:, 2] + 0.5 * self.edges).max()) if len(self.centres) else float("nan")

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Which world points (..., 3) mm lie in a voxel."""
        count = 2**self.depth
        flat = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        cells = np.floor((flat - self.box.corner) / self.smallest_edge).astype(np.int64)
        inside = ((cells >= 0) & (cells < count)).all(axis=1)
        cells = np.clip(cells, 0, count - 1)
        inside_hull = np.zeros(len(flat), dtype=np.bool_)
        for edge in np.unique(self.edges):
            side = max(1, round(edge / self.smallest_edge))
            own = self.centres[self.edges == edge] - self.box.corner
            kept = _codes(np.floor(own / edge).astype(np.int64))
            inside_hull |= np.isin(_codes(cells // side), kept)
        return (inside_hull & inside).reshape(np.shape(points)[:-1])


def _codes(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """One number for each cell (N, 3)."""
    return (cells[:, 0] << 40) | (cells[:, 1] << 20) | cells[:, 2]
