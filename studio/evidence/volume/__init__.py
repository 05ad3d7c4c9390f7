"""The visual hull, and coloured Gaussian blobs fitted to it."""
