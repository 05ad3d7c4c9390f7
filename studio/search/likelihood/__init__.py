"""Evidence to log-weights of poses: named weightings and their kernels."""
