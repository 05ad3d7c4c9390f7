"""Frames as black-box problems for anybody's optimiser, and races on them.

`studio.arena.problems()` gives the bundled problems, `problems_of` those of a stored run, `race` runs racers on them. A
racer of one's own is a `Racer`; the guide has an example (*Adding your own*).
"""

from studio.foundations.first_use import on_first_use

_NAMES = {
    "studio.operations.arena": ("export", "problems", "problems_of", "race", "racers"),
    "studio.results.arena.problem": ("ArenaError", "BudgetSpentError", "KnownBest", "Prior", "Problem"),
    "studio.results.arena.racers": ("Racer",),
}
__getattr__, __dir__ = on_first_use(__name__, _NAMES)
