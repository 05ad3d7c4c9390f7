"""Tempered sequential Monte Carlo on people: its error beside the improved filter's, and its evidence for a body.

Both search with as many evaluations, and nothing is refined. The evidence of a body 10 per cent too large is compared
with the true one's over the same frames; both begin at the pose fitted to the first frame's true markers.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from studio.garden.drawn_recipes import HALVES, REPORTING, clip_name
from studio.garden.reproduction.claims import LOWER, beyond, geometric_mean, percent
from studio.garden.reproduction.experiment import Part
from studio.garden.reproduction.tracking import Candidate, Line, lost_percent, mean_errors, tracked_experiment
from studio.results.comparison.findings import Plain, Table
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import Tracked

KINDS = ("walk", "kick", "leap", "turns", "dance", "sit", "run", "arms", "crouch", "cartwheel")
WEIGHTING = "edge-region-silhouette"
EVALUATIONS = 5000
TEMPERED, IMPROVED, TRUE, LARGE = "tempered", "improved filter", "true body", "10 % larger"
LARGER = 0.1
FRAMES, QUICK_FRAMES, EVIDENCE_FRAMES = 60, 15, 16
ALLOWED = 1.1
"""Times the improved filter's error."""


def _error_lines(quick: bool) -> Iterator[Line]:
    """Clip by clip, so that a clip's evidence is computed once."""
    for half in HALVES[: 1 if quick else None]:
        for kind in KINDS[: 2 if quick else None]:
            for name, tracker in ((IMPROVED, "annealed"), (TEMPERED, "tempered")):
                one = Candidate(name, tracker, WEIGHTING)
                wanted = {"last": QUICK_FRAMES if quick else FRAMES}
                yield Line(f"{name}, {half} {kind}", one, clip_name(half, kind), EVALUATIONS, wanted)


def _errors_shown(groups: dict[str, list[Tracked]]) -> Iterable[Part]:
    """By half the ratio of the errors over its clips, and each clip's."""
    rows = list[tuple[Plain, ...]]()
    for half in HALVES:
        ratios = list[list[float]]()
        for kind in KINDS:
            sampled, improved = (groups.get(f"{name}, {half} {kind}", []) for name in (TEMPERED, IMPROVED))
            if not sampled or not improved:
                continue
            ours, theirs = mean_errors(sampled), mean_errors(improved)
            ratios.append([one / other for one, other in zip(ours, theirs, strict=True)])
            lost = [float(np.mean([lost_percent(run) for run in runs])) for runs in (sampled, improved)]
            rows.append((half, kind, round(float(np.mean(ours)), 1), round(float(np.mean(theirs)), 1), *lost))
        if ratios:
            by_seed = [geometric_mean(np.array(one)) for one in zip(*ratios, strict=True)]
            yield beyond(
                number(f"{half} half: error over the improved filter's", by_seed, "×"), ALLOWED, LOWER
            )
    heads = ("half", "clip", "tempered (mm)", "improved (mm)", "tempered, lost (%)", "improved, lost (%)")
    yield Table("Each clip", heads, tuple(rows))
    yield {"evaluations": EVALUATIONS, "weighting": WEIGHTING, "refined": "no"}


def _body_lines(quick: bool) -> Iterator[Line]:
    for kind in KINDS[: 2 if quick else None]:
        for name, larger in ((TRUE, 0.0), (LARGE, LARGER)):
            one = Candidate(name, "tempered", WEIGHTING)
            wanted = {"last": EVIDENCE_FRAMES, "larger": larger}
            yield Line(f"{name}, {kind}", one, clip_name(REPORTING, kind), EVALUATIONS, wanted)


def _bodies_shown(groups: dict[str, list[Tracked]]) -> Iterable[Part]:
    """In how many clips the true body has more evidence, mean over the seeds; whether it has the smaller error, too."""
    rows, ahead, agree = list[tuple[Plain, ...]](), list[bool](), list[bool]()
    for kind in KINDS:
        pair = [groups.get(f"{name}, {kind}", []) for name in (TRUE, LARGE)]
        if not all(pair):
            continue
        known = [[run.log_evidence or 0.0 for run in runs] for runs in pair]
        errors = [float(np.mean(mean_errors(runs))) for runs in pair]
        gains = [one - other for one, other in zip(*known, strict=True)]
        ahead.append(float(np.mean(gains)) > 0.0)
        agree.append(ahead[-1] == (errors[0] < errors[1]))
        means = (round(float(np.mean(one)), 2) for one in (*known, gains))
        rows.append((kind, *means, *(round(one, 1) for one in errors)))
    yield percent("clips in which the true body has more evidence", ahead, 50.0)
    yield percent("clips in which the body with more evidence is nearer to the truth", agree, 50.0)
    heads = (
        "clip", "true body (nats a frame)", "10 % larger", "difference", "true body (mm)", "10 % larger (mm)"
    )  # fmt: skip
    yield Table("Each clip", heads, tuple(rows))
    yield {"evaluations": EVALUATIONS, "frames": EVIDENCE_FRAMES, "weighting": WEIGHTING}


EXPERIMENTS = (
    tracked_experiment("tempered-error", lines=_error_lines, shown=_errors_shown),
    tracked_experiment("body-evidence", lines=_body_lines, shown=_bodies_shown),
)
