"""Numba's CUDA target, loaded by who computes on a device: it takes a second that nobody else should pay.

Kernels come from the package numba-cuda (extra `gpu`), which puts itself in the place of Numba's own, older target.
Scalar helpers that `numba_in_threads.njit` compiles for the processor are compiled for the device from the same source
when a kernel calls them.
"""

from typing import Any

from numba import cuda as _cuda

__all__ = ["cuda", "missing"]

cuda: Any = _cuda


def missing() -> str:
    """Why no kernel can run, in words; empty where a device is there."""
    if cuda.is_available():
        return ""
    return " ".join(str(cuda.cuda_error() or "no device was found").split()).rstrip(" :.")
