"""People tracked from three cameras: Figs. 8, 9, 10, 21, 22 and 23, and the number of particles that work well (3.1).

Fig. 8 compares Condensation with the annealed filter. The paper's has the edge likelihood of Blake & Isard with a
silhouette; here every tracker weighs alike, and Condensation chooses the scale of its likelihood on the first frames.
The one-layer search propagates the mode, as the paper's does, and reports it.

Figs. 9 and 10 (section 5) were tracked with the filter of Eq. 13, Figs. 21 to 23 (6.3) with the improved one, which
has bodies of 29 and 34 parameters. Besides the paper's filter and weighting every figure shows the studio's own choice
at equal evaluations.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from studio.garden.reproduction.claims import share
from studio.garden.reproduction.deutscher_reid.particles_needed import BODY_FRAMES, body_frames
from studio.garden.reproduction.deutscher_reid.setting import (
    ADAPTIVE,
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
    SHRUNK,
    STUDIO,
    STUDIO_WEIGHTING,
    TURNS,
    WEIGHTING,
    succeeded,
)
from studio.garden.reproduction.drawing import bar_chart, intervals, places
from studio.garden.reproduction.experiment import Part
from studio.garden.reproduction.tracking import (
    Candidate,
    Groups,
    Line,
    curves,
    lost_percent,
    mean_errors,
    spells,
    summary_table,
    tracked_experiment,
)
from studio.results.comparison.findings import Chart, Number, Series
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import Tracked

FPS, LAYERS = 60.0, 10
EQ13, SECTION_6, OWN = "Eq. 13", "section 6", "studio"
THAT_TRACK = "seeds that track"
SUCCESS_WORDS = (
    f"Success is every frame below {LIMIT_MM:g} mm on average and no limb ever more than 150 mm off, which is stricter "
    "than the paper's judgement by eye."
)


def _annealed(name: str, knobs: Mapping[str, Any], particles: int) -> Candidate:
    """The annealed filter; the studio's own choice of knobs with its own weighting."""
    weighting = STUDIO_WEIGHTING if knobs is STUDIO else WEIGHTING
    return Candidate(name, "annealed", weighting, {**knobs, "layers": LAYERS, "particles": particles})


def _tracks(groups: Groups, paper: Mapping[str, float]) -> Iterator[Number]:
    """The share of each line's seeds that succeed. paper : its result for a line: 1, it tracks; 0, it does not."""
    for name, runs in groups.items():
        yield share(f"{name}: {THAT_TRACK}", map(succeeded, runs), paper.get(name))


def _knobs(candidates: Iterable[Candidate]) -> dict[str, Any]:
    return {f"{one.name}: {knob}": value for one in candidates for knob, value in one.changes.items()}


# Fig. 8: Condensation, with the same number of evaluations and with ten times as many.

CONDENSATION, LARGE = "Condensation, 4000", "Condensation, 40 000"
ONE_LAYER = "annealed, 1 × 4000, the mode carried"
TEN_LAYERS, FEW = "annealed, 10 × 400", "annealed, 10 × 100"
FIG_8_FRAMES = 240
CANDIDATES = (
    Candidate(CONDENSATION, "condensation", WEIGHTING, {"particles": 4000}),
    Candidate(LARGE, "condensation", WEIGHTING, {"particles": 40000}),
    Candidate(
        ONE_LAYER,
        "annealed",
        WEIGHTING,
        {**PLAIN, "layers": 1, "particles": 4000, "carry": "mode", "estimate": "mode"},
    ),
    _annealed(TEN_LAYERS, PLAIN, 400),
    _annealed(FEW, PLAIN, 100),
    _annealed(f"{TEN_LAYERS}, the mode carried", {**PLAIN, "carry": "mode"}, 400),
    _annealed(f"{FEW}, the mode carried", {**PLAIN, "carry": "mode"}, 100),
    _annealed("studio's choice, 10 × 400", STUDIO, 400),
    _annealed("studio's choice, 10 × 100", STUDIO, 100),
)
# The paper's results: 1, it tracks; 0, it fails.
PAPER = {CONDENSATION: 0.0, LARGE: 0.0, ONE_LAYER: 0.0, TEN_LAYERS: 1.0, FEW: 1.0}
# "Terminal failure after 1.2 seconds".
PAPER_SECONDS = 1.2
FAILING = (CONDENSATION, ONE_LAYER)


def _fig_8_lines(quick: bool) -> Iterable[Line]:
    """The candidates; 40 000 particles take as long as all others together, and are left out of a preview."""
    last = {"last": QUICK_FRAMES if quick else FIG_8_FRAMES}
    return (
        Line(one.name, one, CIRCLE, wanted=last) for one in CANDIDATES if not (quick and one.name == LARGE)
    )


def terminal_failure(tracked: Tracked) -> float:
    """Seconds from the first frame to the final failure: a frame's mean is LIMIT_MM or more, or a limb is lost, in
    every frame from there on. The footage's length where the last frame is good.
    """
    good = [
        error < LIMIT_MM and not lost for error, lost in zip(tracked.per_frame_mm, tracked.lost, strict=True)
    ]
    if good[-1]:
        return len(good) / FPS
    since = len(good) - good[::-1].index(True) if True in good else 0
    return (tracked.frames[since] - tracked.frames[0]) / FPS


def _fig_8(groups: Groups) -> Iterator[Part]:
    yield from _tracks(groups, PAPER)
    for name in FAILING:
        seconds = [terminal_failure(run) for run in groups[name]]
        yield number(f"{name}: terminal failure after", seconds, "s", PAPER_SECONDS)
    for name, runs in groups.items():
        yield number(f"{name}: mean error", mean_errors(runs), "mm")
        if name not in FAILING:
            yield number(f"{name}: lasts until it fails for good", map(terminal_failure, runs), "s")
    yield (
        f"{SUCCESS_WORDS} The verdict is on which trackers succeed. A run that ends well counts with its whole "
        "length as the time to its failure. The studio's choice (all three terms, Eq. 18, crossover by limbs, limbs "
        "kept apart) is not in the paper; it says what the footage allows. The paper names no frame rate (60 a second "
        f"here), and its Condensation has a likelihood of its own. {EQ17_WORDS}"
    )
    if LARGE not in groups:
        yield "40 000 particles are left out of a quick look."
    yield summary_table("Trackers of Fig. 8", groups)
    yield curves("Error over frames", groups, FPS)
    held = tuple(
        sum(1.0 - run.lost_frames / len(run.frames) for run in runs) / len(runs) for runs in groups.values()
    )
    series = (Series("all limbs held", places(len(held)), held),)
    yield bar_chart("Frames in which no limb is lost", "tracker", "share of the frames", series, groups)
    frames = len(groups[FEW][0].frames)
    yield {"footage": CIRCLE, "frames": frames, "body": BODY, "weighting": WEIGHTING, **_knobs(CANDIDATES)}


# Figs. 9, 10, 21, 22 and 23: 10 layers of 200 particles.

MODE: Mapping[str, Any] = {"carry": "mode"}
FILTERS = tuple(
    _annealed(name, knobs, 200)
    for name, knobs in (
        (EQ13, PLAIN),
        (f"{EQ13}, the mode carried", {**PLAIN, **MODE}),
        (SECTION_6, IMPROVED),
        (f"{SECTION_6}, the mode carried", {**IMPROVED, **MODE}),
        (f"{SECTION_6}, none crossed", ADAPTIVE),
        (f"{SECTION_6}, shrunk (ours)", {**IMPROVED, **SHRUNK}),
        (f"{SECTION_6}, constant velocity", {**IMPROVED, "dynamics": "constant_velocity"}),
        (OWN, STUDIO),
    )
)
"""The paper's two filters, each with one thing changed that the paper leaves open, and ours."""


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


def longest_loss(run: Tracked) -> float:
    """Seconds of the longest row of frames in which one limb is lost."""
    return max((spell.frames for spell in spells(run)), default=0) / FPS


def _figure_lines(figure: Figure, quick: bool) -> Iterable[Line]:
    last = {"last": QUICK_FRAMES if quick else None}
    return (Line(one.name, one, figure.footage, wanted=last) for one in FILTERS)


def _figure_claims(figure: Figure, groups: Groups) -> Iterator[Part]:
    yield from _tracks(groups, {figure.filter: 1.0})
    for name, runs in groups.items():
        yield number(f"{name}: mean error", mean_errors(runs), "mm")
        yield number(f"{name}: largest frame's mean", [run.worst_mm for run in runs], "mm")
        yield number(f"{name}: frames with a limb lost", map(lost_percent, runs), "%")
        yield number(f"{name}: longest time with a limb lost", map(longest_loss, runs), "s")
        yield number(f"{name}: lasts until it fails for good", map(terminal_failure, runs), "s")
    for name, runs in groups.items():
        limbs = [limb for run in runs for limb in run.lost_limbs]
        if limbs:
            counts = ", ".join(f"{limb} in {limbs.count(limb)}" for limb in sorted(set(limbs)))
            yield f"Lost by {name}, in seeds: {counts}."
    yield (
        f"{SUCCESS_WORDS} The verdict is on the paper's filter as printed ({figure.filter}), which carries every "
        "particle to the next frame; what else it may have carried, crossed or predicted stands beside it. The person "
        f"is rendered, at 60 frames a second; the paper names no frame rate and has a real one. {EQ17_WORDS}"
    )
    if figure.filter == SECTION_6:
        yield EQ18_WORDS
    yield summary_table(f"Fig. {figure.number}: {figure.what}", groups)
    yield curves("Error over frames", groups, FPS)
    weightings = {f"{one.name}: weighting": one.weighting for one in FILTERS}
    frames = len(groups[EQ13][0].frames)
    yield {"footage": figure.footage, "frames": frames, "body": figure.body, **_knobs(FILTERS), **weightings}


# Section 3.1: ten layers with 200 particles and more, on the frames of the bisections.

ENOUGH = 200
PARTICLES = (50, 100, 200, 400, 800)
QUICK_PARTICLES = (100, 200, 400)


def _size_name(name: str, particles: int) -> str:
    return f"{name}, {LAYERS} × {particles}"


SIZED: Mapping[str, Mapping[str, Any]] = {
    EQ13: PLAIN,
    f"{EQ13}, the mode carried": {**PLAIN, **MODE},
    SECTION_6: IMPROVED,
    f"{SECTION_6}, shrunk (ours)": {**IMPROVED, **SHRUNK},
}


def _size_lines(quick: bool) -> Iterable[Line]:
    for name, knobs in SIZED.items():
        for particles in QUICK_PARTICLES if quick else PARTICLES:
            candidate = _annealed(name, knobs, particles)
            frames = partial(body_frames, quick=quick)
            yield Line(_size_name(name, particles), candidate, CIRCLE, wanted=frames)


def _sizes(groups: Groups) -> Iterator[Part]:
    yield from _tracks(groups, {_size_name(EQ13, size): 1.0 for size in PARTICLES if size >= ENOUGH})
    yield (
        f"{SUCCESS_WORDS} The claim is on Eq. 13 with {ENOUGH} or more, every particle carried, as printed; the mode "
        f"carried is another reading of Eq. 9. {EQ17_WORDS}"
    )
    yield summary_table("Eq. 13 and section 6 with more and more particles", groups)
    series: list[Series] = []
    for name in SIZED:
        of_size = {size: groups.get(_size_name(name, size)) for size in PARTICLES}
        held = {
            float(size): [float(succeeded(run)) for run in runs] for size, runs in of_size.items() if runs
        }
        series.append(intervals(name, tuple(held), held.values(), group=name))
    title = "Seeds that track, by particles in each of ten layers"
    yield Chart(title, "lines", "particles", "share of the seeds", tuple(series), log_x=True)
    yield {"footage": CIRCLE, "frames": BODY_FRAMES, "layers": LAYERS, "weighting": WEIGHTING, **PLAIN}


EXPERIMENTS = (
    *(
        tracked_experiment(
            f"deutscher-fig-{figure.number}",
            lines=partial(_figure_lines, figure),
            shown=partial(_figure_claims, figure),
        )
        for figure in FIGURES
    ),
    tracked_experiment("deutscher-fig-8", lines=_fig_8_lines, shown=_fig_8),
    tracked_experiment("deutscher-particles", lines=_size_lines, shown=_sizes),
)
