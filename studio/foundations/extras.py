"""Packages that only some uses need: each comes with one of the studio's extras and is loaded where it is used."""

import importlib
from typing import Any

from studio.foundations.errors import StudioError


def load_extra(module: str, extra: str) -> Any:  # noqa: ANN401 - a module that need not be installed
    """A module of an extra, such as "xarray" of `notebook`. Raises StudioError where it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError as problem:
        missing = problem.name.partition(".")[0] if problem.name else module
        raise StudioError(
            f"{missing} is not installed.", f"Install it: pip install 'capture-studio[{extra}]'."
        ) from None
