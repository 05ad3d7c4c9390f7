"""Cost of the kernels, the hulls and a live run on this machine."""
