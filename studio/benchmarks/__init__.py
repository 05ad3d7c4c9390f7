"""What the kernels, the hulls and a live run cost on this machine."""
