"""How much search a frame needs whose result is refined: fewer layers and particles than the default's 10 x 100.

The default tracker as a run begins with it (frames refined, the shape learnt on the way), on three clips of the half
that defaults are chosen by and on the three of the same kinds of the other half, which only report.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from studio.garden.drawn_recipes import HALVES, clip_name
from studio.garden.reproduction.claims import sign_tests
from studio.garden.reproduction.experiment import Part
from studio.garden.reproduction.open_questions.generalisation import AS_A_RUN, REFINED
from studio.garden.reproduction.tracking import (
    Candidate,
    Line,
    error_rows,
    lost_percent,
    mean_errors,
    tracked_experiment,
)
from studio.results.comparison.findings import Plain, Table
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import Tracked
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING

KIND_OF_CLIPS = ("turns", "kick", "dance")
SIZES = ((10, 100), (10, 50), (10, 33), (10, 20), (5, 100), (5, 66), (3, 110))
"""Layers and particles, the default first."""
FRAMES, QUICK_FRAMES = 75, 24


def _name(layers: int, particles: int) -> str:
    return f"{layers} × {particles}"


def _lines(quick: bool) -> Iterator[Line]:
    """Clip by clip, so that a clip's evidence is computed once."""
    for half in HALVES:
        for kind in KIND_OF_CLIPS:
            for layers, particles in SIZES:
                knobs = {"layers": layers, "particles": particles, **REFINED}
                one = Candidate(_name(layers, particles), DEFAULT_TRACKER, DEFAULT_WEIGHTING, knobs)
                wanted = {**AS_A_RUN, "last": QUICK_FRAMES if quick else FRAMES}
                yield Line(f"{one.name}, {half} {kind}", one, clip_name(half, kind), wanted=wanted)


def _shown(groups: dict[str, list[Tracked]]) -> Iterable[Part]:
    """By half: the mean error of every size over its clips, its limbs lost, and sign tests against the default."""
    usual, added = _name(*SIZES[0]), list[str]()
    for half in HALVES:
        runs = {
            _name(*size): [groups[f"{_name(*size)}, {half} {kind}"] for kind in KIND_OF_CLIPS]
            for size in SIZES
        }
        for name, clips in runs.items():
            by_seed = list(zip(*clips, strict=True))
            errors = [float(np.mean(mean_errors(one))) for one in by_seed]
            lost = [float(np.mean([lost_percent(run) for run in one])) for one in by_seed]
            yield number(f"mean error, {name}, {half}", errors, "mm", better="lower")
            yield number(f"frames with a limb lost, {name}, {half}", lost, "%", better="lower")
        means = {name: float(np.mean([mean_errors(one) for one in clips])) for name, clips in runs.items()}
        shares = (f"{name} {100.0 * (mean / means[usual] - 1.0):+.1f} %" for name, mean in means.items())
        added.append(f"{half} half: {', '.join(list(shares)[1:])}")
        rows: list[tuple[Plain, ...]] = []
        for name, clips in runs.items():
            cells = [
                f"{np.mean(mean_errors(one)):.1f} / {max(run.worst_mm for run in one):.0f}" for one in clips
            ]
            rows.append((name, *cells))
        yield Table(
            f"{half}: mean error / worst frame of any seed (mm)", ("size", *KIND_OF_CLIPS), tuple(rows)
        )

        def of(name: str, runs: dict[str, list[list[Tracked]]] = runs) -> tuple[list[float], list[float]]:
            clips = runs[name]
            means = [error for one in clips for error in mean_errors(one)]
            return means, [float(error) for one in clips for error in error_rows(one).ravel()]

        yield sign_tests(of, [(_name(*size), usual) for size in SIZES[1:]])
    yield f"Mean error over clips and seeds against {usual}'s: {'; '.join(added)}."
    yield {
        "tracker": DEFAULT_TRACKER,
        "weighting": DEFAULT_WEIGHTING,
        "frames": max(len(runs[0].frames) for runs in groups.values()),
        "refined": "every frame, the shape after its first frames",
    }


EXPERIMENTS = (tracked_experiment("effort", lines=_lines, shown=_shown),)
