"""Evidence to log-weights of poses, and their kernels. Settings, HTTP and stored runs call a likelihood a *weighting*.

Edges, region and areas run on a card, too: `device_for` (`edge_region.py`) chooses, `device_weighing.py` weighs with
the kernels of `device_kernels.py`, whose scalar helpers (outlines, lines, places) are those of `outline_kernels.py` and
`edge_region_kernels.py`, so that a change there changes both.
"""
