"""What a frame hands to the next, and how many particles are crossed: two choices that the paper leaves open.

Eq. 9 makes the next frame's first set "from S^π_{t,0}": from every particle of the last layer, from survivors drawn by
weight, or (as the one-layer search of Fig. 8 does) from the mode. The product of Eq. 13 is printed as α_M × … ×
α_{m-1}, one factor further than the layers selected so far: it includes α_0, the survival rate of the last layer's set,
which is only used if Eq. 9 draws from that set by weight. Ours ends at α_m, the layer whose survivors get the noise.
Both products are tried with all three ways.

Every seed tracks the bundled walk and two clips of the half that defaults are chosen by. Beside the strict measure of
success (no marker of a limb ever 150 mm off) stands how long a run lasts until it fails for good.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from studio.garden.reproduction.claims import ratio, share
from studio.garden.reproduction.deutscher_reid.setting import (
    EQ17_WORDS,
    EQ18_WORDS,
    IMPROVED,
    PLAIN,
    QUICK_FRAMES,
    WEIGHTING,
    succeeded,
)
from studio.garden.reproduction.deutscher_reid.tracked_people import FPS, SUCCESS_WORDS, terminal_failure
from studio.garden.reproduction.experiment import Part
from studio.garden.reproduction.tracking import (
    Candidate,
    Groups,
    Line,
    curves,
    error_ratio,
    lost_percent,
    mean_errors,
    summary_table,
    tracked_experiment,
)
from studio.results.comparison.findings import FIRM_SEEDS, Number, Table
from studio.results.comparison.statistics import equal_to, number, sign_test
from studio.results.comparison.tracked import Tracked

CLIPS = {"walk": "walk", "turns": "choosing-turns", "kick": "choosing-kick"}
BASES: Mapping[str, Mapping[str, Any]] = {
    "Eq. 13": PLAIN,
    "Eq. 13, the layers so far alone": {**PLAIN, "diffusion_decay": "variance"},
    "section 6": IMPROVED,
}
CARRIED = {"every particle": "weighted", "survivors": "resampled", "the mode": "mode"}
LAYERS, PARTICLES = 10, 200
CROSSED: Mapping[str, Mapping[str, Any]] = {
    "none crossed": {"crossover": 0.0},
    "half by limbs": {"crossover": 0.5, "crossover_by": "limbs"},
    "half by parameters": {"crossover": 0.5, "crossover_by": "parameters"},
    "all by parameters": {"crossover": 1.0, "crossover_by": "parameters"},
}
SIZES = (100, 200)


def lasting(run: Tracked) -> float:
    """Share of a run's frames before it fails for good, 1 where its last frame is good."""
    return terminal_failure(run) * FPS / len(run.frames)


def over_clips(groups: Groups, name: str) -> list[float]:
    """Each seed's mean error over all clips, mm."""
    runs = zip(*(mean_errors(groups[f"{name}, {clip}"]) for clip in CLIPS), strict=True)
    return [sum(errors) / len(CLIPS) for errors in runs]


def in_words(compared: Number) -> str:
    """What a ratio of errors shows, where all of its interval lies on one side of 1."""
    if not compared.seeds >= FIRM_SEEDS:
        return f"was tried with {compared.seeds} seeds, too few to conclude"
    if compared.high < 1.0:
        return f"is nearer (error × {compared.ours:.2f})"
    if compared.low > 1.0:
        return f"is farther off (error × {compared.ours:.2f})"
    low, high = equal_to(1.0)
    if low <= compared.low and compared.high <= high:
        return "makes no difference"
    return "shows no difference, nor that there is none"


def _lines(candidates: Mapping[str, Mapping[str, Any]], quick: bool) -> Iterable[Line]:
    """Every setting on every clip; 200 particles in ten layers unless it says otherwise."""
    for clip, footage in CLIPS.items():
        for name, knobs in candidates.items():
            words = f"{name}, {clip}"
            sized = {"layers": LAYERS, "particles": PARTICLES, **knobs}
            last = {"last": QUICK_FRAMES if quick else None}
            yield Line(words, Candidate(words, "annealed", WEIGHTING, sized), footage, wanted=last)


def _results(groups: Groups, names: Sequence[str], pairs: Sequence[tuple[str, str]]) -> Iterator[Part]:
    """Errors, losses and lasting of each setting over all clips; ratios and sign tests of pairs."""
    tests: list[tuple[Any, ...]] = []
    for ours, theirs in pairs:
        better: list[float] = []
        other: list[float] = []
        for clip in CLIPS:
            runs, rest = groups[f"{ours}, {clip}"], groups[f"{theirs}, {clip}"]
            yield error_ratio(f"{ours} over {theirs}, {clip}", runs, rest, "")
            better += mean_errors(runs)
            other += mean_errors(rest)
        signs = sign_test(better, other)
        tests.append((f"{ours} against {theirs}", f"{signs.better} : {signs.worse}", float(f"{signs.p:.2g}")))
    for name in names:
        runs = [run for clip in CLIPS for run in groups[f"{name}, {clip}"]]
        yield number(f"{name}: mean error", over_clips(groups, name), "mm")
        yield share(f"{name}: runs that track", map(succeeded, runs), None)
        yield number(f"{name}: lasts until it fails for good", map(lasting, runs), "of 1")
        yield number(f"{name}: frames with a limb lost", map(lost_percent, runs), "%")
    heads = ("pair", "nearer in runs (seeds and clips)", "p")
    yield Table("Sign tests", heads, tuple(tests))
    for clip in CLIPS:
        own = {name: groups[f"{name}, {clip}"] for name in names}
        yield summary_table(f"On the {clip}", own)
        yield curves(f"Error over frames, {clip}", own)
    yield SUCCESS_WORDS


CARRYING = {
    f"{base}, {words}": {**knobs, "carry": carry}
    for base, knobs in BASES.items()
    for words, carry in CARRIED.items()
}


def _carried(groups: Groups) -> Iterator[Part]:
    """What is carried, for both products of Eq. 13 and for section 6."""
    usual, *others = CARRIED
    pairs = [(f"{base}, {other}", f"{base}, {usual}") for base in BASES for other in others]
    eq13, so_far, _ = BASES
    pairs += [(f"{so_far}, {words}", f"{eq13}, {words}") for words in CARRIED]
    yield from _results(groups, tuple(CARRYING), pairs)
    for base in BASES:
        for other in others:
            whole = ratio(
                f"{base}, all clips: {other} over {usual}",
                over_clips(groups, f"{base}, {other}"),
                over_clips(groups, f"{base}, {usual}"),
            )
            yield whole
            yield f"{base}: {other} instead of {usual} {in_words(whole)}."
    for words in CARRIED:
        whole = ratio(
            f"{words}, all clips: {so_far} over {eq13}",
            over_clips(groups, f"{so_far}, {words}"),
            over_clips(groups, f"{eq13}, {words}"),
        )
        yield whole
        yield f"The product of the layers so far instead of the printed one, {words}: {in_words(whole)}."
    yield f"{EQ17_WORDS} {EQ18_WORDS}"
    yield {
        "clips": ", ".join(CLIPS.values()),
        "layers": LAYERS,
        "particles": PARTICLES,
        "weighting": WEIGHTING,
    }


CROSSING = {
    f"{words}, {LAYERS} × {size}": {**IMPROVED, **knobs, "particles": size}
    for size in SIZES
    for words, knobs in CROSSED.items()
}


def _crossed(groups: Groups) -> Iterator[Part]:
    """Shares and cuts, with few particles and with the paper's."""
    none, *others = CROSSED
    pairs = [
        (f"{other}, {LAYERS} × {size}", f"{none}, {LAYERS} × {size}") for size in SIZES for other in others
    ]
    few, many = SIZES
    pairs += [(f"{words}, {LAYERS} × {few}", f"{words}, {LAYERS} × {many}") for words in CROSSED]
    yield from _results(groups, tuple(CROSSING), pairs)
    yield EQ18_WORDS
    yield {"clips": ", ".join(CLIPS.values()), "layers": LAYERS, "weighting": WEIGHTING, **IMPROVED}


EXPERIMENTS = (
    tracked_experiment("deutscher-carried", lines=lambda quick: _lines(CARRYING, quick), shown=_carried),
    tracked_experiment(
        "deutscher-crossover-share", lines=lambda quick: _lines(CROSSING, quick), shown=_crossed
    ),
)
