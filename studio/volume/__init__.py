"""What is filled in space: the visual hull, and coloured Gaussian blobs fitted to it."""
