"""Names of a module that are imported once they are used, so that importing the module costs nothing."""

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence


def on_first_use(
    module: str, names: Mapping[str, Sequence[str]], submodules: Sequence[str] = ()
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """A module's `__getattr__` and `__dir__`. names : by the module that defines them. submodules : its own.

    A verb gets the help and the signature that it is declared with.
    """
    module_of = {name: source for source, own in names.items() for name in own}

    def get(name: str) -> object:
        if name in submodules:
            return importlib.import_module(f"{module}.{name}")
        if name not in module_of:
            raise AttributeError(f"module '{module}' has no attribute '{name}'")
        value = getattr(importlib.import_module(module_of[name]), name)
        if declared := getattr(value, "__operation__", None):
            value.__doc__, value.__signature__ = declared.help, declared.signature
        setattr(sys.modules[module], name, value)
        return value

    return get, lambda: sorted((*module_of, *submodules))
