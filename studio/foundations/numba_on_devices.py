"""Numba's CUDA target, loaded only where a device computes, since it takes a second.

Kernels come from the package numba-cuda (extra `gpu`), which puts itself in the place of Numba's own, older target.
Scalar helpers that `numba_in_threads.njit` compiles for the processor are compiled for the device from the same source
when a kernel calls them.
"""

import importlib
from collections.abc import Callable
from typing import Any

from numba import cuda as _cuda
from numba.core import config

__all__ = ["cuda", "missing", "record_launches"]

cuda: Any = _cuda


def missing() -> str:
    """Why no kernel can run, in words; empty where a device is there."""
    if cuda.is_available():
        return ""
    return " ".join(str(cuda.cuda_error() or "no device was found").split()).rstrip(" :.")


def record_launches(launches: Callable[[], None], stream: Any) -> Callable[[], None] | None:  # noqa: ANN401
    """What makes the same launches again by one call (a CUDA graph), which takes a fraction of the time that making
    them one by one does; None where that cannot be had.

    launches : makes them on the stream, all of which have been made before, so that nothing is compiled or allocated.
    They are recorded, not made. What they read and write has to stay where it is as long as the call is kept.
    """
    if config.ENABLE_CUDASIM:  # pyright: ignore[reportAttributeAccessIssue]
        return None
    try:
        driver: Any = importlib.import_module("cuda.bindings.driver")
    except ImportError:
        return None
    handle, mode = int(stream.handle), driver.CUstreamCaptureMode.CU_STREAM_CAPTURE_MODE_RELAXED
    if driver.cuStreamBeginCapture(handle, mode)[0]:
        return None
    try:
        launches()
    finally:
        failed, graph = driver.cuStreamEndCapture(handle)
    if failed:
        return None
    failed, runnable = driver.cuGraphInstantiate(graph, 0)
    if failed:
        return None

    def launch_again() -> None:
        error = driver.cuGraphLaunch(runnable, handle)[0]
        if error:
            raise RuntimeError(f"recorded launches cannot be made: {error}")

    return launch_again
