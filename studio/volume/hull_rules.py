"""The rules of carving as a row of numbers for the kernels."""

DEPTH_IS_LAST, PIXELS, LEAST_VIEWS, EDGE_SHARE, SAMPLING = 0, 1, 2, 3, 4
SHADOW, DEEPEST, SINGLE, POLYNOMIAL, RULES = 5, 6, 7, 8, 11
"""Is this the last depth, are pixels the evidence, fewest views that see a voxel, share of the samples at the last
depth, samples / √area, the shadow's share, the deepest shadow's, T_1, and T_k's three coefficients."""
