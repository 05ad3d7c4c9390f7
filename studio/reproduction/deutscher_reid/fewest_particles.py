"""How many particles are needed: the paper's measure of a filter's speed (captions of Fig. 13, sections 6.1 to 6.3).

For every seed the fewest particles with which tracking succeeds are found by bisection on a grid in equal ratios.
A success of one run can be luck, so a number of particles counts as enough when most of a few runs succeed. Both
filters of a comparison search the same motions, so that their numbers are paired by seed; what one saves is the
geometric mean of the ratios.

Where even the most particles fail, the next step of the grid beyond them is taken (a lower bound); where the fewest
succeed, these (an upper bound). Pairs in which both ends fail say nothing and are left out.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from studio.comparison.findings import Chart, Findings, Number, Table
from studio.comparison.statistics import number
from studio.comparison.trials import Outcome
from studio.reproduction.deutscher_reid.setting import geometric_mean
from studio.reproduction.drawing import bar_chart, intervals, line, places
from studio.reproduction.tracking import grouped

Groups = Mapping[str, Sequence["Fewest"]]
ABOVE, BELOW = "above", "below"


@dataclass(frozen=True, slots=True)
class Fewest:
    """particles : enough for success. censored : "above" where even the most failed, "below" where the fewest
    succeeded, else "". tried : particles, successes and runs of every size that was tried.
    """

    particles: float
    censored: str
    tried: list[list[int]]

    def plain(self) -> dict[str, Any]:
        """As a trial's measurements."""
        return asdict(self)


def sizes(smallest: int, largest: int, per_doubling: int = 2) -> tuple[int, ...]:
    """Numbers of particles in equal ratios, both ends included (the last may lie a step beyond `largest`)."""
    count = math.ceil(per_doubling * math.log2(largest / smallest))
    return tuple(round(smallest * 2.0 ** (step / per_doubling)) for step in range(count + 1))


def fewest(succeeds: Callable[[int, int], bool], grid: Sequence[int], runs: int) -> Fewest:
    """The first of the grid's sizes that is enough, by bisection.

    succeeds : with so many particles, in the run of that number. runs : at most, of each size; it ends as soon as
    most of them have succeeded or failed.
    """
    tried: list[list[int]] = []
    failing, enough = -1, len(grid)
    while enough - failing > 1:
        middle = (failing + enough) // 2
        won, done = 0, 0
        while won <= runs // 2 and done - won < runs - runs // 2:
            won += succeeds(grid[middle], done)
            done += 1
        tried.append([grid[middle], won, done])
        if won > runs // 2:
            enough = middle
        else:
            failing = middle
    if enough == len(grid):
        step = grid[-1] / grid[-2] if len(grid) > 1 else 2.0
        return Fewest(grid[-1] * step, ABOVE, tried)
    return Fewest(float(grid[enough]), BELOW if enough == 0 else "", tried)


def saving(name: str, slow: Sequence[Fewest], fast: Sequence[Fewest], paper: float | None) -> Number:
    """How many times fewer particles `fast` needs than `slow`, of the same seeds in order."""
    pairs = list(zip(slow, fast, strict=True))
    ratios = [
        math.nan if one.censored == other.censored == ABOVE else one.particles / other.particles
        for one, other in pairs
    ]
    return number(name, ratios, "×", paper=paper, better="higher", statistic=geometric_mean)


def needed(name: str, found: Sequence[Fewest]) -> Number:
    """The geometric mean of the particles needed, without a paper's value."""
    return number(name, [entry.particles for entry in found], "particles", statistic=geometric_mean)


def censored_in_words(groups: Groups) -> str:
    """Which searches met an end of the grid; empty where none did."""
    told = []
    for name, found in groups.items():
        above = sum(entry.censored == ABOVE for entry in found)
        below = sum(entry.censored == BELOW for entry in found)
        if above:
            told.append(
                f"{name} failed with the most particles tried in {above} of {len(found)} seeds (a lower bound is taken)"
            )
        if below:
            told.append(
                f"{name} succeeded with the fewest tried in {below} of {len(found)} (an upper bound is taken)"
            )
    return ("; ".join(told) + ".") if told else ""


def times(found: Number, digits: int = 1) -> str:
    """ "2.1 times (1.9 to 2.3)"."""
    return f"{found.ours:.{digits}f} times ({found.low:.{digits}f} to {found.high:.{digits}f})"


def concluded(
    groups: Groups,
    verdict: str,
    words: str,
    savings: Iterable[Number],
    title: str,
    settings: Mapping[str, Any],
) -> Findings:
    """What all experiments on the particles needed show: savings, needs, shares of success, each seed's. title : of
    the chart of needs.
    """
    numbers = (*savings, *(needed(f"particles needed: {name}", found) for name, found in groups.items()))
    charts = (bars(title, groups), successes("Runs that succeed, by particles", groups))
    table = per_seed("Fewest particles with which most runs succeed", groups)
    return Findings(verdict, words, numbers, (table,), charts, settings)


def bars(title: str, groups: Groups) -> Chart:
    """The particles that each filter needs, with intervals over the seeds."""
    rows = ([entry.particles for entry in found] for found in groups.values())
    series = intervals("particles needed", places(len(groups)), rows, geometric_mean)
    return bar_chart(title, "filter", "particles needed for success", (series,), groups)


def successes(title: str, groups: Groups) -> Chart:
    """Share of the runs that succeeded with so many particles, over all seeds' bisections (which try a size only
    where it matters, so neighbouring sizes rest on different seeds).
    """
    series = []
    for name, found in groups.items():
        won: dict[int, list[int]] = {}
        for particles, good, runs in (row for entry in found for row in entry.tried):
            total = won.setdefault(particles, [0, 0])
            total[0], total[1] = total[0] + good, total[1] + runs
        order = sorted(won)
        shares = tuple(won[size][0] / won[size][1] for size in order)
        series.append(line(name, order, shares))
    return Chart(title, "lines", "particles", "runs that succeed (share)", tuple(series), log_x=True)


def per_seed(title: str, groups: Groups) -> Table:
    """A line a filter, a column a seed."""
    mark = {ABOVE: "> ", BELOW: "≤ ", "": ""}
    count = max(len(found) for found in groups.values())
    rows = tuple(
        (name, *(f"{mark[entry.censored]}{entry.particles:.0f}" for entry in found))
        for name, found in groups.items()
    )
    return Table(title, ("filter", *(f"seed {index}" for index in range(count))), rows)


def found_by_group(outcomes: Sequence[Outcome]) -> dict[str, list[Fewest]]:
    """What was found, by group in the order of the trials, seeds in order."""
    return grouped(outcomes, Fewest)
