# pyright: standard
"""The fitness of Fleischmann et al. 2012, section 2.2, of blocks of sixteen poses in one call.

A swarm weighs twenty poses sixty times a frame: what five calls would cost beside their work, and five waits for the
interpreter, would take as long as the work itself.
"""

import numpy as np

from studio.foundations.arrays import Array, Indices
from studio.foundations.geometry.camera_table import CameraTable
from studio.foundations.numba_in_threads import EXACT, njit
from studio.search.likelihood.area_kernels import area_blocks, areas_fitness, is_in_parts, mean_in_order
from studio.search.likelihood.edge_region_kernels import CHUNK
from studio.search.likelihood.kinematic_program import KinematicProgram
from studio.search.likelihood.occlusion_kernels import hidden_blocks
from studio.search.likelihood.outline_kernels import LANES, ROWS, outline_blocks
from studio.search.likelihood.picture_maps import Maps
from studio.search.likelihood.visible_edge_kernels import edge_blocks


@njit(**EXACT)
def fitness_blocks(
    first: int,
    last: int,
    poses: Array,
    program: KinematicProgram,
    cameras: CameraTable,
    edges: Indices,
    chunks: int,
    maps: Maps,
    scale: float,
    silhouettes: Maps,
    observed: Indices,
    fitness: Array,
) -> None:
    """Fill fitness (N,) with f = f_s + f_e of the poses (N, D) in blocks first..last - 1 of sixteen each.

    edges, chunks, maps : as `visible_edge_kernels.edge_blocks` takes them. scale, silhouettes : as
    `area_kernels.area_blocks` does. observed : (V,) pixels of the silhouettes.
    """
    begin, in_parts = first * LANES, is_in_parts(len(poses))
    part = poses[begin : last * LANES]
    blocks, views, count = last - first, cameras.shape[0], len(part)
    outlines = np.empty((blocks, views, program.limb_frame.shape[0], ROWS * LANES), np.float32)
    outline_blocks(0, blocks, part, program, cameras, outlines)
    hidden = np.empty((blocks, views, edges.shape[0], LANES), np.uint64)
    hidden_blocks(0, blocks, outlines, edges, chunks * CHUNK, hidden)
    edge = np.empty((blocks, views, LANES))
    edge_blocks(0, blocks, outlines, edges, hidden, chunks, maps, edge)
    counts, outside = np.empty((blocks, views, LANES, 2), np.int64), np.empty((blocks, views, LANES))
    area_blocks(0, blocks, count, outlines, scale, silhouettes, counts, outside)
    covered, bright = np.empty(views), np.empty(views)
    for n in range(count):
        block, lane = n // LANES, n % LANES
        shared, drawn = counts[block, :, lane, 1], counts[block, :, lane, 0]
        areas_fitness(shared, drawn, observed, outside[block, :, lane], covered)
        bright[:] = edge[block, :, lane]
        fitness[begin + n] = mean_in_order(covered, in_parts) + mean_in_order(bright, in_parts)
