"""Whether today's defaults are better than the first round's, on three clips that today's were not chosen by.

The first round's: two terms, 2000 evaluations a frame, no frame refined. Today's, as a run begins with them: three
terms, 1000 evaluations, every frame refined, the shape learnt on the way, chosen on the suite's choosing half. The
first round looked at the walk and its twin while it was built, so that these two favour it.
"""

from collections.abc import Iterable, Iterator, Mapping

from studio.garden.reproduction.experiment import Part
from studio.garden.reproduction.open_questions.generalisation import AS_A_RUN, REFINED, SEARCH_ALONE
from studio.garden.reproduction.tracking import (
    Candidate,
    Groups,
    Line,
    error_ratio,
    error_tests,
    lost_percent,
    mean_errors,
    summary_table,
    tracked_experiment,
)
from studio.results.comparison.statistics import number
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING

CLIPS = ("walk", "lee-walk-twin", "dance")
FRAMES, QUICK_FRAMES = 150, 24
FORMER, TODAY = "first round", "today"
CANDIDATES: tuple[tuple[Candidate, int, Mapping[str, int]], ...] = (
    (Candidate(FORMER, "annealed", "edge-region", SEARCH_ALONE), 2000, {}),
    (Candidate(TODAY, DEFAULT_TRACKER, DEFAULT_WEIGHTING, REFINED), 1000, AS_A_RUN),
)
"""Candidate, evaluations a frame, fields of its trials."""


def _lines(quick: bool) -> Iterator[Line]:
    """Clip by clip, so that a clip's evidence is computed once."""
    for clip in CLIPS:
        for one, evaluations, wanted in CANDIDATES:
            last = {"last": QUICK_FRAMES if quick else FRAMES}
            yield Line(f"{one.name}, {clip}", one, clip, evaluations, {**wanted, **last})


def _shown(groups: Groups) -> Iterable[Part]:
    """Of every clip: error and lost limbs of both, their ratio paired by seed; sign tests over seeds and frames."""
    for clip in CLIPS:
        former, today = groups[f"{FORMER}, {clip}"], groups[f"{TODAY}, {clip}"]
        for name, runs in ((FORMER, former), (TODAY, today)):
            yield number(f"mean error, {name}, {clip}", mean_errors(runs), "mm", better="lower")
            lost = [lost_percent(run) for run in runs]
            yield number(f"frames with a limb lost, {name}, {clip}", lost, "%", better="lower")
        yield error_ratio(f"mean error of today's by the first round's, {clip}", today, former, "")
    yield summary_table("Over seeds", groups)
    yield error_tests(groups, [(f"{TODAY}, {clip}", f"{FORMER}, {clip}") for clip in CLIPS])
    yield {"frames": max(len(runs[0].frames) for runs in groups.values())}


EXPERIMENTS = (tracked_experiment("defaults", lines=_lines, shown=_shown),)
