"""Kernels as NVIDIA's compilers, which `make env` installs, make them for a card that is not there."""

import importlib
import inspect
import sys
from collections.abc import Mapping
from types import ModuleType, SimpleNamespace
from typing import Any

import numba
import numpy as np
import pytest

GENERATIONS = (8, 0), pytest.param((9, 0), marks=pytest.mark.slow)
"""Of cards, by what they can do; the oldest in every run of the tests."""
LONG, SINGLE, FLAG = numba.types.int64, numba.types.float32, numba.types.boolean
needs_compilers = pytest.mark.skipif(
    sys.version_info >= (3, 12) or sys.platform != "linux",
    reason="NVIDIA's compilers are locked for one Python",
)


def of_type(kind: str, dimensions: int = 1) -> numba.types.Array:
    """The type of an array of that kind of number."""
    return numba.types.Array(numba.from_dtype(np.dtype(kind)), dimensions, "C")


def kernels_of(module: ModuleType) -> set[str]:
    """Names of a module's kernels."""
    own = inspect.getmembers(module, inspect.isfunction)
    return {name for name, one in own if one.__module__ == module.__name__}


def compiled(
    monkeypatch: pytest.MonkeyPatch,
    capability: tuple[int, int],
    kernels: Mapping[str, tuple[Any, tuple[Any, ...]]],
) -> dict[str, str]:
    """PTX of kernels by name, each a function and the types that it is called with, for a generation of cards."""
    dispatching = importlib.import_module("numba.cuda.dispatcher")
    device = SimpleNamespace(compute_capability=capability)
    monkeypatch.setattr(dispatching, "get_current_device", lambda: device)
    cuda = importlib.import_module("studio.foundations.numba_on_devices").cuda
    made = dict[str, str]()
    for name, (kernel, types) in kernels.items():
        made[name] = cuda.compile_ptx(kernel, numba.types.void(*types), cc=capability)[0]
        assert f".target sm_{capability[0]}{capability[1]}" in made[name]
        assert ".entry" in made[name]
        assert "call" not in made[name], f"every helper of {name} is compiled into it"
    return made
