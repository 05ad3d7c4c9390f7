"""Voxels that are split into octants, and those that are kept, against plain loops."""

import itertools

import numpy as np

from studio.evidence.volume.hull_kernels import CARVED, KEPT, SPLIT
from studio.evidence.volume.hull_octree import children, kept_nodes


def test_octants_of_split_voxels_within_the_space_follow_their_parents() -> None:
    rng = np.random.default_rng(4)
    nodes = rng.integers(0, 6, (40, 3)).astype(np.int32)
    states = rng.integers(0, 99, (40, 3)).astype(np.uint32)
    verdicts = rng.choice(np.array([SPLIT, KEPT, CARVED], np.uint8), 40)
    limits = np.array([[3, 4, 2], [8, 9, 7]], np.int32)
    wanted, inherited = [], []
    for node, state, verdict in zip(nodes, states, verdicts, strict=True):
        for z, y, x in itertools.product((0, 1), repeat=3):
            cell = 2 * node + (x, y, z)
            if verdict == SPLIT and (cell >= limits[0]).all() and (cell <= limits[1]).all():
                wanted.append(cell)
                inherited.append(state)
    cells, given = children(nodes, states, verdicts, limits)
    assert cells.tolist() == np.array(wanted).tolist()
    assert given.tolist() == np.array(inherited).tolist()
    assert kept_nodes(nodes, verdicts).tolist() == nodes[verdicts == KEPT].tolist()
