"""Stochastic search, a layer at a time; sees a function of poses, never an image.

Where a card weighs the poses, the particles stay there: `frame_loop.py` asks a tracker what a layer does in numbers
(`layer_plan.py`), and `device_search.py` does it with the kernels of `device_search_kernels.py`, at once for all runs
that are at the same frame.
"""
