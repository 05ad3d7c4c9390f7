"""People tracked from three cameras: Figs. 8, 9, 10, 21, 22 and 23, and how many particles work well (3.1).

Fig. 8 sets Condensation beside the annealed filter. The paper's has the edge likelihood of Blake & Isard with a
silhouette; here every tracker weighs alike, and Condensation chooses the scale of its likelihood on the first frames.
The one-layer search propagates the mode, as the paper's does, and reports it.

Figs. 9 and 10 (section 5) were tracked with the filter of Eq. 13, Figs. 21 to 23 (6.3) with the improved one, which
has bodies of 29 and 34 parameters. Beside the paper's filter and weighting every figure shows what the studio's own
choice does with as many evaluations.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio.comparison.findings import Chart, Number, Series
from studio.comparison.statistics import number
from studio.comparison.tracked import Tracked
from studio.comparison.trials import Outcome
from studio.reproduction.deutscher_reid.particles_on_bodies import FRAMES as FEW_FRAMES
from studio.reproduction.deutscher_reid.particles_on_bodies import first_frame
from studio.reproduction.deutscher_reid.setting import (
    BODY,
    BOX,
    CIRCLE,
    EQ17_WORDS,
    EQ18_WORDS,
    HANDSTAND,
    IMPROVED,
    LIMIT_MM,
    PLAIN,
    QUICK_FRAMES,
    RUN,
    SOURCE,
    STUDIO,
    STUDIO_WEIGHTING,
    TURNS,
    WEIGHTING,
    succeeded,
    success_number,
    times_in_words,
)
from studio.reproduction.drawing import bar_chart, intervals, places
from studio.reproduction.experiment import Experiment
from studio.reproduction.lost_limbs import spells
from studio.reproduction.tracking import (
    Claim,
    Contender,
    Groups,
    Line,
    curves,
    mean_errors,
    summary,
    tracked_experiment,
)

FPS = 60.0
EQ13, SECTION_6, OWN = "Eq. 13", "section 6", "studio"


def _annealed(name: str, knobs: Mapping[str, Any], particles: int, layers: int = 10) -> Contender:
    """The annealed filter; the studio's own choice of knobs with its own weighting."""
    weighting = STUDIO_WEIGHTING if knobs is STUDIO else WEIGHTING
    return Contender(name, "annealed", weighting, {**knobs, "layers": layers, "particles": particles})


def _tracks(name: str, paper: float | None) -> Claim:
    """The share of a line's seeds that succeed, beside what the paper saw: 1, it tracks; 0, it does not."""
    return lambda groups: (
        success_number(f"{name}: seeds that track", groups[name], paper) if name in groups else None
    )


def _over_seeds(name: str, what: str, of: Callable[[Tracked], float], unit: str) -> Claim:
    return lambda groups: (
        number(f"{name}: {what}", [of(run) for run in groups[name]], unit) if name in groups else None
    )


def _successes(groups: Groups, name: str) -> str:
    return times_in_words([succeeded(run) for run in groups[name]])


def _frames(outcomes: Sequence[Outcome]) -> int:
    return len(outcomes[0].measured["frames"])


def _all_curves(groups: Groups) -> Chart:
    return curves("Error over frames", groups, FPS)


# Fig. 8: Condensation, with the same number of evaluations and with ten times as many.

CONDENSATION, LARGE = "Condensation, 4000", "Condensation, 40 000"
ONE_LAYER, TEN_LAYERS, FEW = (
    "annealed, 1 × 4000, the mode carried",
    "annealed, 10 × 400",
    "annealed, 10 × 100",
)
OWN_LARGE, OWN_FEW = "studio's choice, 10 × 400", "studio's choice, 10 × 100"
FIG_8_FRAMES = 240
CONTENDERS = (
    Contender(CONDENSATION, "condensation", WEIGHTING, {"particles": 4000}),
    Contender(LARGE, "condensation", WEIGHTING, {"particles": 40000}),
    Contender(
        ONE_LAYER,
        "annealed",
        WEIGHTING,
        {**PLAIN, "layers": 1, "particles": 4000, "carry": "mode", "estimate": "mode"},
    ),
    _annealed(TEN_LAYERS, PLAIN, 400),
    _annealed(FEW, PLAIN, 100),
    _annealed(OWN_LARGE, STUDIO, 400),
    _annealed(OWN_FEW, STUDIO, 100),
)
# What the paper saw of each: 1, it tracks; 0, it fails.
PAPER = {CONDENSATION: 0.0, LARGE: 0.0, ONE_LAYER: 0.0, TEN_LAYERS: 1.0, FEW: 1.0}
# "Terminal failure after 1.2 seconds".
PAPER_SECONDS = 1.2
FAILING = (CONDENSATION, ONE_LAYER)


def _fig_8_lines(quick: bool) -> Iterable[Line]:
    """40 000 particles take as long as all others together, and are left out of a quick look."""
    last = {"last": QUICK_FRAMES if quick else FIG_8_FRAMES}
    return (
        Line(one.name, one, CIRCLE, wanted=last) for one in CONTENDERS if not (quick and one.name == LARGE)
    )


def terminal_failure(found: Tracked) -> float:
    """Seconds from the first frame to the failure that never ends: a frame's mean is LIMIT_MM or more, or a limb is
    lost, in every frame from there on. The footage's length where the last frame is good: it fails later, if ever.
    """
    good = [error < LIMIT_MM and not lost for error, lost in zip(found.per_frame_mm, found.lost, strict=True)]
    if good[-1]:
        return len(good) / FPS
    since = len(good) - good[::-1].index(True) if True in good else 0
    return (found.frames[since] - found.frames[0]) / FPS


def _failure(name: str) -> Claim:
    return lambda groups: number(
        f"{name}: terminal failure after",
        [terminal_failure(run) for run in groups[name]],
        "s",
        PAPER_SECONDS,
    )


def _fig_8_words(groups: Groups, numbers: Sequence[Number]) -> str:
    told = "; ".join(
        f"{name}: {_successes(groups, name)}, {sum(mean_errors(runs)) / len(runs):.0f} mm"
        for name, runs in groups.items()
    )
    lasts = sum(
        run.per_frame_mm[-1] < LIMIT_MM and not run.lost[-1] for name in FAILING for run in groups[name]
    )
    seconds = "; ".join(
        f"{entry.name} {entry.ours:.1f} s on average"
        for entry in numbers
        if entry.name.endswith("terminal failure after")
    )
    left_out = " 40 000 particles are left out of a quick look." if LARGE not in groups else ""
    return (
        f"Seeds that track (every frame below {LIMIT_MM:g} mm, no limb ever lost) and mean errors: {told}. "
        f"{seconds} ({lasts} of these runs end well and count with their whole length; the paper: 1.2 s). "
        "The verdict is on who tracks and who does not. The "
        "studio's choice (all three terms, Eq. 18, crossover by limbs, limbs kept apart) is not in the paper; it says "
        "what the footage allows. Deviations: the paper names no frame rate (60 a second here), its Condensation has a "
        "likelihood of its own, and its judgement is by eye. "
        f"{EQ17_WORDS}{left_out}"
    )


def _kept_chart(groups: Groups) -> Chart:
    """In how many frames all limbs are held."""
    shares = tuple(
        sum(1.0 - run.lost_frames / len(run.frames) for run in runs) / len(runs) for runs in groups.values()
    )
    series = Series("all limbs held", places(len(shares)), shares)
    return bar_chart("Frames in which no limb is lost", "tracker", "share of the frames", (series,), groups)


FIG_8 = tracked_experiment(
    "deutscher-fig-8",
    "Condensation against annealed particle filtering",
    f"{SOURCE}, Fig. 8",
    "Condensation with 4000 particles fails after 1.2 s and with 40 000, too, as does a search of one layer; the "
    "annealed filter with 10 layers of 400 particles tracks very well, and of as few as 100.",
    lines=_fig_8_lines,
    claims=(
        *(_tracks(one.name, PAPER.get(one.name)) for one in CONTENDERS),
        *(_failure(name) for name in FAILING),
        *(_over_seeds(one.name, "mean error", lambda run: run.mean_mm, "mm") for one in CONTENDERS),
    ),
    words=_fig_8_words,
    tables=(summary("Trackers of Fig. 8"),),
    charts=(_all_curves, _kept_chart),
    settings=lambda outcomes: {
        "footage": CIRCLE,
        "frames": _frames(outcomes),
        "body": BODY,
        "weighting": WEIGHTING,
        **{f"{one.name}: {knob}": value for one in CONTENDERS for knob, value in one.changes.items()},
    },
    judged=lambda entry: entry.name.endswith("seeds that track"),
)

# Figs. 9, 10, 21, 22 and 23: 10 layers of 200 particles.

FILTERS = tuple(
    _annealed(name, knobs, 200) for name, knobs in ((EQ13, PLAIN), (SECTION_6, IMPROVED), (OWN, STUDIO))
)
DESCRIBED = {
    EQ13: "The filter of sections 3 to 5 (Eq. 13)",
    SECTION_6: "The improved filter of section 6 (Eq. 18, 19)",
    OWN: "The studio's own choice (all three terms, limbs kept apart, crossover by limbs)",
}


@dataclass(frozen=True, slots=True)
class Figure:
    """number : in the paper. filter : the paper's, of FILTERS. body : the footage's own, of 29 or 34 parameters."""

    number: int
    what: str
    footage: str
    filter: str
    body: str


FIGURES = (
    Figure(9, "walking in a circle", CIRCLE, EQ13, "human29"),
    Figure(10, "stepping over a box, turning and stepping over it again", BOX, EQ13, "human29"),
    Figure(21, "walking with turns", TURNS, SECTION_6, "human34"),
    Figure(22, "running around", RUN, SECTION_6, "human34"),
    Figure(23, "a handstand", HANDSTAND, SECTION_6, "human34"),
)


def _lost_percent(run: Tracked) -> float:
    return 100.0 * run.lost_frames / len(run.frames)


def longest_loss(run: Tracked) -> float:
    """Seconds of the longest row of frames in which one limb is lost."""
    return max((spell.frames for spell in spells(run.lost)), default=0) / FPS


def _which(runs: Sequence[Tracked]) -> str:
    """Which limbs are lost, and in how many seeds."""
    limbs = [limb for run in runs for limb in run.lost_limbs]
    counts = ", ".join(f"{limb} in {limbs.count(limb)}" for limb in sorted(set(limbs)))
    return f" ({counts})" if counts else ""


def _figure_words(figure: Figure, groups: Groups) -> str:
    told = " ".join(
        f"{DESCRIBED[name]}: {_successes(groups, name)} succeed, mean "
        f"{np.mean(mean_errors(runs)):.0f} mm, a limb lost in "
        f"{np.mean([_lost_percent(run) for run in runs]):.0f} % of the frames{_which(runs)}, for "
        f"{max(longest_loss(run) for run in runs):.2f} s at most."
        for name, runs in groups.items()
    )
    eq18 = f"{EQ18_WORDS} " if figure.filter == SECTION_6 else ""
    return (
        f"Success is every frame below {LIMIT_MM:g} mm on average and no limb ever more than 150 mm off, which is "
        f"stricter than the paper's judgement by eye. {told} The verdict is on the paper's filter ({figure.filter}). "
        "The person is rendered, at 60 frames a second; the paper names no frame rate and has a real one. "
        f"{eq18}{EQ17_WORDS}"
    )


def _figure(figure: Figure) -> Experiment:
    def lines(quick: bool) -> Iterable[Line]:
        last = {"last": QUICK_FRAMES if quick else None}
        return (Line(one.name, one, figure.footage, wanted=last) for one in FILTERS)

    return tracked_experiment(
        f"deutscher-fig-{figure.number}",
        f"Three cameras: {figure.what}",
        f"{SOURCE}, Fig. {figure.number}",
        "With three cameras and 10 layers of 200 particles the tracker keeps an accurate lock throughout: "
        f"{figure.what}.",
        lines=lines,
        claims=(
            *(_tracks(one.name, 1.0 if one.name == figure.filter else None) for one in FILTERS),
            *(
                _over_seeds(one.name, what, of, unit)
                for one in FILTERS
                for what, of, unit in (
                    ("mean error", lambda run: run.mean_mm, "mm"),
                    ("largest frame's mean", lambda run: run.worst_mm, "mm"),
                    ("frames with a limb lost", _lost_percent, "%"),
                    ("longest time with a limb lost", longest_loss, "s"),
                )
            ),
        ),
        words=lambda groups, numbers: _figure_words(figure, groups),
        tables=(summary(f"Fig. {figure.number}: {figure.what}"),),
        charts=(_all_curves,),
        settings=lambda outcomes: {
            "footage": figure.footage,
            "frames": _frames(outcomes),
            "body": figure.body,
            **{f"{one.name}: {knob}": value for one in FILTERS for knob, value in one.changes.items()},
            **{f"{one.name}: weighting": one.weighting for one in FILTERS},
        },
    )


# Section 3.1: ten layers with 200 particles and more, on the frames of the bisections.

LAYERS, ENOUGH = 10, 200
PARTICLES = (50, 100, 200, 400, 800)
QUICK_PARTICLES = (100, 200, 400)


def _size_name(name: str, particles: int) -> str:
    return f"{name}, {LAYERS} × {particles}"


def _sizes(quick: bool) -> Iterable[tuple[str, int]]:
    return (
        (name, particles)
        for name in (EQ13, SECTION_6)
        for particles in (QUICK_PARTICLES if quick else PARTICLES)
    )


@dataclass(frozen=True, slots=True)
class _FramesOfSeed(Line):
    """A line whose every seed tracks frames of its own."""

    quick: bool = False

    def trial(self, seed: int):
        first = first_frame(seed, self.quick)
        return Line(
            self.name, self.contender, self.footage, 0, {"first": first, "last": first + FEW_FRAMES}
        ).trial(seed)


def _size_lines(quick: bool) -> Iterable[Line]:
    for name, particles in _sizes(quick):
        contender = _annealed(name, PLAIN if name == EQ13 else IMPROVED, particles)
        yield _FramesOfSeed(_size_name(name, particles), contender, CIRCLE, quick=quick)


def _size_words(groups: Groups, numbers: Sequence[Number]) -> str:
    told = "; ".join(f"{name}: {_successes(groups, name)}" for name in groups)
    return (
        f"Seeds that track 40 frames of the walk in a circle (every frame below {LIMIT_MM:g} mm, no limb lost): {told}."
        " The paper says that 10 layers with 200 particles or more work well for a model of 30 parameters; the verdict "
        f"is on Eq. 13 with 200. {EQ17_WORDS}"
    )


def _size_chart(groups: Groups) -> Chart:
    series = []
    for name in (EQ13, SECTION_6):
        found = {
            size: groups[_size_name(name, size)] for size in PARTICLES if _size_name(name, size) in groups
        }
        held = [[float(succeeded(run)) for run in runs] for runs in found.values()]
        series.append(intervals(name, tuple(float(size) for size in found), held, group=name))
    title = "Seeds that track, by particles in each of ten layers"
    return Chart(title, "lines", "particles", "share of the seeds", tuple(series), log_x=True)


ENOUGH_PARTICLES = tracked_experiment(
    "deutscher-particles",
    "200 particles in 10 layers",
    f"{SOURCE}, section 3.1",
    "For a model of 30 parameters 10 layers with 200 particles or more work well.",
    lines=_size_lines,
    claims=tuple(
        _tracks(_size_name(name, size), 1.0 if name == EQ13 and size >= ENOUGH else None)
        for name, size in _sizes(False)
    ),
    words=_size_words,
    tables=(summary("Eq. 13 and section 6 with more and more particles"),),
    charts=(_size_chart,),
    settings={
        "footage": CIRCLE,
        "frames": FEW_FRAMES,
        "layers": LAYERS,
        "weighting": WEIGHTING,
        **PLAIN,
    },
    judged=lambda entry: entry.name.startswith(f"{_size_name(EQ13, ENOUGH)}:"),
)

THREE_CAMERAS = tuple(_figure(figure) for figure in FIGURES)
EXPERIMENTS = (FIG_8, *THREE_CAMERAS, ENOUGH_PARTICLES)
