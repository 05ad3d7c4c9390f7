"""Evidence to log-weights of poses, and their kernels. Settings, HTTP and stored runs call a likelihood a *weighting*.

`Weighting.prepare` (`catalogue.py`) makes a `Likelihood` for a body and its cameras; its `problem` makes of a frame's
evidence a `FrameLikelihood`, the *problem* that a tracker searches: poses in, log-weights out.

Edges, region and areas run on a card, too: `device_for` (`edge_region.py`) chooses, `device_weighing.py` weighs with
the kernels of `device_weighing_kernels.py`, whose scalar helpers (outlines, lines, places) are those of
`outline_kernels.py` and `edge_region_kernels.py`, so that a change there changes both.
"""
