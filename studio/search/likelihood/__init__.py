"""Evidence to log-weights of poses, and their kernels. Settings, HTTP and stored runs call a likelihood a *weighting*.

Edge and region run on a card, too: `device_for` (`edge_region.py`) chooses, `edge_region_device.py` has the kernels;
the scalar helpers (outlines, lines, places) are those of `outline_kernels.py` and `edge_region_kernels.py`, so that a
change there changes both.
"""
