"""Frames as black-box problems for anybody's optimiser, and races on them.

`studio.arena.problems()` gives the bundled problems, `problems_of` those of a stored run, `race` runs racers on them. A
racer of one's own is a `Racer`; the guide has an example (*Adding your own*).
"""

import importlib

_NAMES = {
    "studio.operations.arena": ("export", "problems", "problems_of", "race", "racers"),
    "studio.results.arena.problem": ("ArenaError", "BudgetSpentError", "KnownBest", "Prior", "Problem"),
    "studio.results.arena.racers": ("Racer",),
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> object:
    """A name, imported on first use, like the verbs of `studio`."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'studio.arena' has no attribute '{name}'")
    value = getattr(importlib.import_module(_MODULE_OF[name]), name)
    if declared := getattr(value, "__operation__", None):
        value.__doc__, value.__signature__ = declared.help, declared.signature
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(_MODULE_OF)
