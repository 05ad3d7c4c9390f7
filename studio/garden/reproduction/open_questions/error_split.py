"""Whose fault the trackers' errors are, over how much they search: the search's part falls, the floor stays.

Parts as in `results.comparison.error_shares`, nothing refined.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from studio.garden.reproduction.experiment import Part
from studio.garden.reproduction.tracking import Candidate, Line, tracked_experiment
from studio.results.comparison.findings import Chart, Plain, Series, Table
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import Tracked
from studio.results.inspection.error_parts import BODY, LIKELIHOOD, SEARCH
from studio.search.settings import DEFAULT_WEIGHTING

CLIPS = ("walk", "choosing-turns", "choosing-kick")
EVALUATIONS, QUICK_EVALUATIONS = (250, 1000, 4000, 16_000), (1000, 4000)
TRACKERS = {
    "annealed": "annealed",
    "swarm": "swarm",
    "Condensation": "condensation",
    "tempered": "tempered",
}
FRAMES, SPLIT, QUICK_FRAMES, QUICK_SPLIT = 48, 8, 13, 3
PARTS = (BODY, LIKELIHOOD, SEARCH)


def _lines(quick: bool) -> Iterator[Line]:
    wanted = {"last": QUICK_FRAMES if quick else FRAMES, "split_frames": QUICK_SPLIT if quick else SPLIT}
    for clip in CLIPS[: 1 if quick else None]:
        for name, tracker in TRACKERS.items():
            one = Candidate(name, tracker, DEFAULT_WEIGHTING)
            for size in QUICK_EVALUATIONS if quick else EVALUATIONS:
                yield Line(f"{name}, {size} on {clip}", one, clip, size, wanted)


def _shown(groups: dict[str, list[Tracked]]) -> Iterable[Part]:
    """By clip: bars of the parts over evaluations; how much of its search's part each tracker loses; a table."""
    rows = list[tuple[Plain, ...]]()
    for clip in CLIPS:
        own = {name.removesuffix(f" on {clip}"): runs for name, runs in groups.items() if name.endswith(clip)}
        means = {
            name: [float(np.mean([run.parts_mm[part] for run in runs])) for part in PARTS]
            for name, runs in own.items()
        }
        rows += [
            (clip, name, round(sum(parts), 1), *(round(one, 1) for one in parts))
            for name, parts in means.items()
        ]
        if own:
            places = tuple(map(float, range(len(means))))
            bars = zip(PARTS, zip(*means.values(), strict=True), strict=True)
            series = tuple(Series(part, places, tuple(values), group=part) for part, values in bars)
            yield Chart(
                f"Whose fault: {clip}", "bars", "tracker, evaluations a frame", "mean error (mm)", series,
                categories=tuple(means), stacked=True,
            )  # fmt: skip
        for tracker in TRACKERS:
            sizes = [runs for name, runs in own.items() if name.startswith(f"{tracker}, ")]
            if len(sizes) > 1:
                gone = [
                    most.parts_mm[SEARCH] - fewest.parts_mm[SEARCH]
                    for fewest, most in zip(sizes[0], sizes[-1], strict=True)
                ]
                yield number(f"{clip}: {tracker}, search's part, most less fewest evaluations", gone, "mm")
    heads = ("clip", "tracker, evaluations a frame", "error (mm)", *(f"{part} (mm)" for part in PARTS))
    yield Table("Parts of the error", heads, tuple(rows))
    yield {"weighting": DEFAULT_WEIGHTING, "frames": FRAMES, "of them split": SPLIT, "refined": "no"}


EXPERIMENTS = (tracked_experiment("error-split", lines=_lines, shown=_shown),)
