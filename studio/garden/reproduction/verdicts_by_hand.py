"""Five verdicts of the guide reached a second time, from the kept numbers alone, as a page that can be followed with a
pocket calculator: `make guide` writes it.

Nothing here is shared with what judges the experiments (`claims`, `results.comparison.statistics`): the rules are
written down again, a Student interval of logarithms or all resamples stand for the bootstrap, and tests count every
outcome.
"""

import json
import math
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from pathlib import Path
from typing import Any

from studio.garden.reproduction.guide_findings import guide_folder

Kept = Mapping[str, Any]
Span = tuple[float, float]

MARGIN = 1.1
SURE = 0.05
STUDENT = {90: 1.833, 95: 2.262}
"""How many standard errors of ten values' mean an interval reaches to either side, by its per cent."""
TEN = 10


@dataclass(frozen=True, slots=True)
class Judged:
    """A claim. number : its name in the kept file. here, shown : the verdict of this page, and of the studio."""

    experiment: str
    number: str
    here: str
    shown: str

    @property
    def agrees(self) -> bool:
        """Whether both verdicts are the same."""
        return self.here == self.shown


@dataclass(frozen=True, slots=True)
class Recomputed:
    """A section of the page. kind : of claim. text : Markdown."""

    kind: str
    judged: tuple[Judged, ...]
    text: str


INTRODUCTION = f"""# Five verdicts by hand

Here five of the verdicts on [the papers' claims](/guide/reproduction) are reached a second time from the same kept
numbers, by other means: no code of the studio's that judges is used, and no random numbers. Whoever has a pocket
calculator with ln and eˣ can follow each step; what only a machine can count stands beside it. There is one claim of
each kind, from all three papers.

The numbers are those of the files that the guide keeps, rounded to four figures, so that a last digit may differ. The
first two sections begin with every seed's number; of the others the file has counts, means and intervals, and they
begin with these. Two values count as equal where their ratio lies between 1 / {MARGIN:g} = {1 / MARGIN:.3f} and
{MARGIN:g}; what comes by chance alone in at most one of twenty experiments ({SURE:g}) is not taken for chance.
"""


def recompute(folder: Path) -> tuple[Recomputed, ...]:
    """The five sections, from the files of a folder. Raises OSError, or StopIteration where a file lacks a number."""

    def kept(experiment: str) -> Kept:
        return json.loads((folder / f"{experiment}.json").read_text(encoding="utf-8"))

    return (
        _quarter_of_the_particles(kept("deutscher-full-body")),
        _no_difference_on_a_chain(kept("deutscher-crossover")),
        _swarm_against_filter(kept("fleischmann-fig-6")),
        _losing_track(kept("caillette-fig-11")),
        _longer_memory(kept("caillette-fig-13")),
    )


def page(folder: Path) -> str:
    """The page as Markdown. Raises what `recompute` raises."""
    sections = recompute(folder)
    rows = [
        (
            section.kind,
            f"{one.number} (`{one.experiment}`)",
            one.here,
            one.shown,
            "yes" if one.agrees else "**no**",
        )
        for section in sections
        for one in section.judged
    ]
    heads = ("kind of claim", "number", "here", "the studio", "agree")
    return "\n".join([INTRODUCTION, _table(heads, rows), *(section.text for section in sections)]) + "\n"


# A ratio, and an equality: each seed's numbers are kept.


@dataclass(frozen=True, slots=True)
class _Ratios:
    """Ratios of ten seeds by their logarithms. mean, error : of the logarithms. squares : the sum of their squared
    distances from the mean.
    """

    ratios: tuple[float, ...]
    logs: tuple[float, ...]
    mean: float
    squares: float
    error: float

    def span(self, percent: int) -> Span:
        """The Student interval of the geometric mean."""
        reach = STUDENT[percent] * self.error
        return math.exp(self.mean - reach), math.exp(self.mean + reach)


def _ratios_of(above: Sequence[float], below: Sequence[float]) -> _Ratios:
    ratios = tuple(one / other for one, other in zip(above, below, strict=True))
    if len(ratios) != TEN:
        raise ValueError(f"There are {len(ratios)} seeds; the table of Student's t here is for {TEN}.")
    logs = tuple(map(math.log, ratios))
    mean = sum(logs) / TEN
    squares = sum((value - mean) ** 2 for value in logs)
    return _Ratios(ratios, logs, mean, squares, math.sqrt(squares / (TEN - 1)) / math.sqrt(TEN))


def spans_of_all_resamples(values: Sequence[float], percents: Sequence[int]) -> tuple[int, list[Span]]:
    """How many different resamples of as many values there are, and the intervals that hold so many per cent of their
    means, each weighed by the number of ways to draw it.
    """
    count, of_value = len(values), Counter(values)
    means: list[tuple[float, int]] = []
    for drawn in _shares(len(of_value), count):
        ways = math.factorial(count)
        for times, have in zip(drawn, of_value.values(), strict=True):
            ways = ways // math.factorial(times) * have**times
        means.append((sum(times * value for times, value in zip(drawn, of_value, strict=True)) / count, ways))
    means.sort()

    def below(share: float) -> float:
        wanted, seen = share * count**count, 0
        for mean, ways in means:
            seen += ways
            if seen >= wanted:
                return mean
        return means[-1][0]

    return len(means), [(below((100 - one) / 200), below((100 + one) / 200)) for one in percents]


def _shares(parts: int, whole: int) -> Iterator[tuple[int, ...]]:
    """Every way to divide a whole number among some parts."""
    if parts == 1:
        yield (whole,)
        return
    for first in range(whole + 1):
        for rest in _shares(parts - 1, whole - first):
            yield (first, *rest)


def _particles(kept: Kept, name: str) -> list[float]:
    """The particles that a filter needs, by seed: a bound where the file has ">" or "≤"."""
    rows = next(table["rows"] for table in kept["tables"] if table["title"].startswith("Fewest particles"))
    cells = next(row[1:] for row in rows if row[0] == name)
    return [float(cell.strip("> ≤")) for cell in cells]


def _by_seed(above: Sequence[float], below: Sequence[float], names: tuple[str, str], ratios: _Ratios) -> str:
    rows = [
        (seed, f"{one:g}", f"{other:g}", f"{ratio:.4g}", f"{log:.4f}", f"{(log - ratios.mean) ** 2:.4f}")
        for seed, (one, other, ratio, log) in enumerate(
            zip(above, below, ratios.ratios, ratios.logs, strict=True)
        )
    ]
    total = ("sum", "", "", "", f"{sum(ratios.logs):.4f}", f"{ratios.squares:.4f}")
    return _table(("seed", *names, "ratio r", "ln r", "(ln r - m)²"), [*rows, total])


def _steps_to_the_interval(ratios: _Ratios, shown: Kept, percents: Sequence[int]) -> list[str]:
    """From the sums to the intervals, and the same of all resamples."""
    count, spans = spans_of_all_resamples(ratios.logs, percents)
    return [
        f"Mean of the logarithms: m = {sum(ratios.logs):.4f} / {TEN} = {ratios.mean:.4f}. The geometric mean of the "
        f"ratios is e^m = {math.exp(ratios.mean):.4g}; the studio shows {shown['ours']:g}.",
        f"Standard error of m: √({ratios.squares:.4f} / {TEN - 1}) / √{TEN} = {ratios.error:.4f}.",
        *(
            f"{percent} % interval of m (Student's t with {TEN - 1} degrees of freedom): {ratios.mean:.4f} ± "
            f"{STUDENT[percent]} × {ratios.error:.4f}; as a ratio e^… = {_interval(ratios.span(percent))}."
            for percent in percents
        ),
        f"Without a bell curve, by a machine: ten seeds drawn from the ten with replacement give {count} different "
        "samples. All of them are counted; their geometric mean lies "
        + ", ".join(
            f"with {percent} % in {_interval((math.exp(low), math.exp(high)))}"
            for percent, (low, high) in zip(percents, spans, strict=True)
        )
        + ". The studio draws 9999 at random and corrects for skewness: with 95 % in "
        f"{_interval((shown['low'], shown['high']))}.",
    ]


def _quarter_of_the_particles(kept: Kept) -> Recomputed:
    number = "particles saved by both together"
    shown = _number(kept, number)
    names = "Eq. 13", "adaptive and crossover"
    planned, both = (_particles(kept, name) for name in names)
    ratios = _ratios_of(planned, both)
    claimed = 4.0
    inner, outer = ratios.span(90), ratios.span(95)
    if outer[0] > claimed:
        here = "better"
    elif inner[0] >= claimed / MARGIN:
        here = "reproduced"
    else:
        here = "undecided" if outer[0] <= claimed <= outer[1] else "not reproduced"
    more = sum(ratio > claimed for ratio in ratios.ratios)
    steps = [
        *_steps_to_the_interval(ratios, shown, (90, 95)),
        f"Claimed is a ratio of {claimed:g}, and more is better: *better* where the whole 95 % interval lies above "
        f"{claimed:g}; else *reproduced* where the 90 % interval begins at {claimed:g} / {MARGIN:g} = "
        f"{claimed / MARGIN:.3g} or above; else *undecided* where the 95 % interval contains {claimed:g}, *not "
        f"reproduced* where it does not. {outer[0]:.3g} against {claimed:g}: **{here}**.",
        f"A second look by signs alone: {more} of {TEN} seeds save more than {claimed:g}. If either were as likely, "
        f"so many or more would come with probability {_in_words(_at_least(more, TEN))}.",
    ]
    judged = Judged(kept["name"], number, here, shown["verdict"])
    quote = (
        "We observed an improved by a factor of 4 when comparing the new PAPF to the original APF (i.e. successful "
        "tracking achieved with one quarter the number of particles).",
        "Deutscher & Reid 2005, section 6.3",
    )
    body = (
        "The fewest particles a layer with which most runs over 40 frames succeed. A seed's two filters track the "
        "same frames.",
        _by_seed(planned, both, ("Eq. 13", "Eq. 18 and 19"), ratios),
        _steps(steps),
    )
    return _section("A ratio: a quarter of the particles", "ratio", kept, quote, body, (judged,))


def _no_difference_on_a_chain(kept: Kept) -> Recomputed:
    quote = (
        "… there was no difference when it was applied to the non-branched object.",
        "Deutscher & Reid 2005, section 6.2.2, of crossover",
    )
    body = [
        "The fewest particles with which most runs succeed on an arm without branches, without and with every "
        "particle crossed. The paper prints no survival rate for it, so two are judged.",
        "The rule: no difference is *reproduced* where the 90 % interval lies between the margins on both sides; "
        "else *undecided* where the 95 % interval contains 1, *not reproduced* where it does not: a saving refutes "
        "it as a loss does. Until 27 November 2026 the studio asked here only whether crossover does harm, and "
        "called the second one reproduced; this page brought it to light.",
    ]
    judged: list[Judged] = []
    for base in ("adaptive, α 0.5", "adaptive, α 0.315"):
        number = f"particles saved, chain: {base}, cut by parameters"
        shown = _number(kept, number)
        plain, crossed = (
            _particles(kept, f"{base}{words}, chain, 10 pictures/s")
            for words in ("", ", crossed by parameters")
        )
        ratios = _ratios_of(plain, crossed)
        inner, outer = ratios.span(90), ratios.span(95)
        if inner[0] >= 1.0 / MARGIN and inner[1] <= MARGIN:
            here = "reproduced"
        else:
            here = "undecided" if outer[0] <= 1.0 <= outer[1] else "not reproduced"
        judged.append(Judged(kept["name"], number, here, shown["verdict"]))
        verdict = (
            f"Is {_interval(inner)} within {1 / MARGIN:.3f} to {MARGIN:g}? {_yes(here == 'reproduced')}. Does "
            f"{_interval(outer)} contain 1? {_yes(outer[0] <= 1.0 <= outer[1])}. **{here.capitalize()}**."
        )
        body += [
            f"With a survival rate of {base.rpartition(' ')[2]}:",
            _by_seed(plain, crossed, ("without", "with crossover"), ratios),
            _steps([*_steps_to_the_interval(ratios, shown, (90, 95)), verdict]),
        ]
    return _section("An equality on both sides: no difference", "equality", kept, quote, body, judged)


# A sign test: how often a seed's run is nearer is kept, and the means.


def _swarm_against_filter(kept: Kept) -> Recomputed:
    quote = (
        "SPPSO performs significantly better at 20 fps and equally well at a frame rate of 60 fps.",
        "Fleischmann, Austvoll & Kwolek 2012, section 3.1 and Fig. 6",
    )
    rows: list[tuple[str, ...]] = []
    steps: list[str] = []
    judged: list[Judged] = []
    tests = next(table["rows"] for table in kept["tables"] if table["title"] == "Sign tests")
    for fps in (20, 60):
        number = f"swarm over the filter with Eq. 13, {fps} Hz"
        shown = _number(kept, number)
        counts = next(
            row[1] for row in tests if row[0] == f"swarm, {fps} Hz against annealed, Eq. 13, {fps} Hz"
        )
        nearer, further = map(int, counts.split(" : "))
        ours, theirs = (
            _number(kept, f"mean error, {name}, {fps} Hz")["ours"] for name in ("swarm", "annealed, Eq. 13")
        )
        ratio = ours / theirs
        rows.append(
            (
                f"{fps}",
                f"{ours:g}",
                f"{theirs:g}",
                f"{nearer}",
                f"{further}",
                f"{ratio:.4f}",
                f"{shown['ours']:g}",
            )
        )
        chance = both_sides(nearer, further)
        differs = chance <= SURE
        steps.append(
            f"*{fps} frames a second.* Each seed is nearer with either tracker: 2^{nearer + further} = "
            f"{2 ** (nearer + further)} ways. So uneven a split, to either side, has "
            f"{round(chance * 2 ** (nearer + further))} of them: p = {_in_words(chance)}, "
            f"{'at most' if differs else 'more than'} {SURE:g}."
        )
        if fps == 20:
            here = "undecided" if not differs else "reproduced" if nearer > further else "not reproduced"
            steps.append(
                "Claimed is *significantly better*: "
                f"{'a difference is shown' if differs else 'no difference is shown'}, and the swarm is nearer in "
                f"{nearer} of {nearer + further}. **{here.capitalize()}**."
            )
        else:
            near = 1.0 / MARGIN <= ratio <= MARGIN
            here = "undecided" if near or not differs else "not reproduced"
            steps.append(
                f"Claimed is *equally well*. No interval around {ratio:.3f} lies within {1 / MARGIN:.3f} to "
                f"{MARGIN:g}, so equality cannot be shown; and by the signs the two differ. **{here.capitalize()}**: "
                "better refutes equal."
                if not near and differs
                else f"Claimed is *equally well*, of which signs alone cannot tell. **{here.capitalize()}**."
            )
        judged.append(Judged(kept["name"], number, here, shown["verdict"]))
    steps.append(
        "The studio judges the interval of the ratio ("
        + " and ".join(
            _interval((_number(kept, one.number)["low"], _number(kept, one.number)["high"])) for one in judged
        )
        + "). It cannot be made again from this file, which has no seed's own error: the signs are another way to the "
        "same question."
    )
    heads = (
        "frames a second", "swarm (mm)", "filter, Eq. 13 (mm)", "seeds: swarm nearer", "seeds: filter nearer",
        "ratio of the means", "the studio's ratio",
    )  # fmt: skip
    body = (
        "Mean error of ten seeds, and in how many of these each tracker is nearer.",
        _table(heads, rows),
        _steps(steps),
    )
    return _section("A sign test over seeds: swarm against filter", "sign test", kept, quote, body, judged)


def both_sides(nearer: int, further: int) -> float:
    """The probability of so uneven a split or a more uneven one, to either side: every outcome is counted."""
    count, most = nearer + further, max(nearer, further)
    uneven = sum(max(sum(signs), count - sum(signs)) >= most for signs in product((0, 1), repeat=count))
    return uneven / 2**count


# A share of the seeds.


def _losing_track(kept: Kept) -> Recomputed:
    quote = (
        "Even with 5000 particles evaluations, they [Condensation and annealing] both quickly loose track … Our "
        "algorithm, however, maintains a good overall accuracy with only 1000 particles. A momentary tracking "
        "failure … is automatically detected and recovered from …",
        "Caillette, Galata & Howard 2007, section 7.3 and Fig. 11",
    )
    rows: list[tuple[str, ...]] = []
    steps = [
        "The rule: it is counted in how many of n seeds that holds which the paper shows. *Reproduced* where so "
        f"many or more come with a probability of at most {SURE:g} if either were as likely; *not reproduced* where "
        "so few or fewer do; else *undecided*.",
    ]
    judged: list[Judged] = []
    in_the_paper = {
        "Condensation, 5000": True,
        "annealed, 5 × 1000": True,
        "printed, 1000, memory 20, with its recovery": False,
    }
    for name, loses in in_the_paper.items():
        number = f"{name}: seeds that lose track"
        shown = _number(kept, number)
        count = shown["seeds"]
        lose = round(shown["ours"] * count)
        as_printed = lose if loses else count - lose
        many, few = _at_least(as_printed, count), _at_least(count - as_printed, count)
        here = "reproduced" if many <= SURE else "not reproduced" if few <= SURE else "undecided"
        span = _interval(interval_of_share(lose, count))
        rows.append(
            (
                name,
                f"{count}",
                f"{lose}",
                "yes" if loses else "no",
                f"{as_printed}",
                span,
                f"{shown['low']:g} to {shown['high']:g}",
            )
        )
        decided = (
            f"{as_printed} or more of {count}: {_in_words(many)}; {as_printed} or fewer: {_in_words(few)}."
        )
        steps.append(f"*{name}.* {decided} **{here.capitalize()}**.")
        judged.append(Judged(kept["name"], number, here, shown["verdict"]))
    steps.append(
        "The interval (Clopper & Pearson) has no bearing on the verdict. Its ends are the shares with which so many "
        "or more, and so few or fewer, come with 2.5 %: with ten of ten the lower is 0.025^(1/10) = "
        f"{0.025 ** (1 / 10):.4f}."
    )
    heads = (
        "tracker", "seeds", "lose track", "does so in the paper", "seeds as in the paper", "share that lose track",
        "the studio's",
    )  # fmt: skip
    body = (
        "To lose track is to be off by more than 150 mm RMS for a second at a stretch.",
        _table(heads, rows),
        _steps(steps),
    )
    return _section("A share of the seeds: who loses track", "share", kept, quote, body, judged)


def _at_least(wins: int, count: int) -> float:
    """The probability of so many heads or more of `count` fair coins."""
    return sum(math.comb(count, heads) for heads in range(wins, count + 1)) / 2**count


def interval_of_share(wins: int, count: int) -> Span:
    """Clopper & Pearson's 95 % interval, by halving."""

    def more_than(share: float, least: int) -> float:
        return sum(
            math.comb(count, one) * share**one * (1 - share) ** (count - one)
            for one in range(least, count + 1)
        )

    def share_where(least: int, wanted: float) -> float:
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if more_than(middle, least) < wanted else (low, middle)
        return low

    return (
        share_where(wins, 0.025) if wins else 0.0,
        share_where(wins + 1, 0.975) if wins < count else 1.0,
    )


# The shape of a curve: the mean at each place with its interval is kept.


def _longer_memory(kept: Kept) -> Recomputed:
    quote = (
        "With a longer memory, the propagation of the particles is more focused, and the overall accuracy is "
        "improved.",
        "Caillette, Galata & Howard 2007, section 7.3 and Fig. 13",
    )
    chart = next(
        chart for chart in kept["charts"] if chart["title"].startswith("Error over memory, limb direction")
    )
    rows: list[tuple[str, ...]] = []
    steps = [
        "The rule: the error of the longest memory over that of one frame is *reproduced* as smaller where its "
        f"whole interval lies below 1; *not reproduced* where it begins at 1 / {MARGIN:g} or above, so that at most "
        "as much is gained as counts as equal; else *undecided*.",
    ]
    judged: list[Judged] = []
    for evidence in ("whole evidence", "occluded evidence"):
        series = next(one for one in chart["series"] if one["name"] == f"as printed, {evidence}")
        memories = [round(value) for value in series["x"]]
        points = [
            _number(kept, f"limb direction, RMS: as printed, {evidence}, memory {memory}")
            for memory in memories
        ]
        rows += [
            (
                evidence,
                f"{memory}",
                f"{one['ours']:g}",
                f"{one['low']:g} to {one['high']:g}",
                f"{low:g} to {high:g}",
            )
            for memory, one, low, high in zip(memories, points, series["low"], series["high"], strict=True)
        ]
        first, last = points[0], points[-1]
        span = last["low"] / first["high"], last["high"] / first["low"]
        number = f"as printed, {evidence}: memory {memories[-1]} over memory 1, limb direction"
        shown = _number(kept, number)
        pairs = shown["low"], shown["high"]
        apart, paired = _smaller(span), _smaller(pairs)
        here = paired if apart == "undecided" else apart
        judged.append(Judged(kept["name"], number, here, shown["verdict"]))
        errors = [one["ours"] for one in points]
        rising, orders, rank = rank_correlation(errors)
        steps += [
            f"*{evidence.capitalize()}.* {last['ours']:g} / {first['ours']:g} = {last['ours'] / first['ours']:.3f}; "
            f"the studio shows {shown['ours']:g}. The ends of the two intervals over each other: {last['low']:g} / "
            f"{first['high']:g} = {span[0]:.3f} at least, {last['high']:g} / {first['low']:g} = {span[1]:.3f} at "
            "most. Each interval misses its mean in at most 5 of 100 cases, so that both hold in 90. "
            + (
                f"That is too wide to tell. The studio pairs the seeds, which gives {_interval(pairs)}: "
                f"**{here.capitalize()}**."
                if apart == "undecided"
                else f"**{here.capitalize()}**. (The studio pairs the seeds, which gives a narrower one: "
                f"{_interval(pairs)}.)"
            ),
            f"The shape: the error is smallest with a memory of {memories[errors.index(min(errors))]}. Between the "
            f"errors' order and the memories' Spearman's ρ = 1 - 6 Σd² / (n (n² - 1)) = {rank:.3f}, where the claim "
            f"has it negative. Of all {orders} orders of {len(errors)} errors {rising} rise as much or more "
            f"({rising / orders:.3f}).",
        ]
    heads = ("evidence", "memory (frames)", "error (°)", "95 % interval", "lowest to highest seed")
    automaton = next(
        table["rows"][-1] for table in kept["tables"] if table["title"].startswith("What the automaton")
    )
    body = (
        "RMS error of the limbs' directions, 200 particles, the tracker as printed, ten seeds; no seed's own error "
        f"is kept. With a memory of {automaton[0]} the automaton has {automaton[1]:g} states here, in the paper "
        "2890.",
        _table(heads, rows),
        _steps(steps),
    )
    return _section("The shape of a curve: longer memories", "curve", kept, quote, body, judged)


def _smaller(span: tuple[float, float]) -> str:
    """The verdict on a ratio that is claimed to be below 1, by its interval."""
    return "reproduced" if span[1] < 1.0 else "not reproduced" if span[0] >= 1.0 / MARGIN else "undecided"


def rank_correlation(values: Sequence[float]) -> tuple[int, int, float]:
    """Of how many orders Spearman's ρ with 1, 2, … is as large as that of the values or larger, of how many, and it."""
    count = len(values)
    ranks = tuple(sorted(values).index(value) for value in values)

    def squares(order: Iterable[int]) -> int:
        return sum((place - rank) ** 2 for place, rank in enumerate(order))

    own = squares(ranks)
    orders = [squares(order) for order in permutations(range(count))]
    return sum(one <= own for one in orders), len(orders), 1.0 - 6.0 * own / (count * (count**2 - 1))


# The page.


def _section(
    title: str, kind: str, kept: Kept, quote: tuple[str, str], body: Iterable[str], judged: Iterable[Judged]
) -> Recomputed:
    """quote : what the paper says, and where. body : the numbers and the steps, a block each."""
    every = tuple(judged)
    verdicts = "\n".join(
        f"- {one.number}. Here: **{one.here}**. The studio: **{one.shown}**. "
        f"{'They agree' if one.agrees else 'They do not agree'}."
        for one in every
    )
    words, place = quote
    origin = f"Kept in `{kept['name']}.json`, measured {kept['measured'][:10]} at commit {', '.join(kept['commits'])}."
    parts = (f"\n## {title}", f"> {words}\n>\n> {place}", origin, *body, verdicts)
    return Recomputed(kind, every, "\n\n".join(parts))


def _steps(steps: Iterable[str]) -> str:
    return "\n".join(f"{place}. {step}" for place, step in enumerate(steps, 1))


def _number(kept: Kept, name: str) -> Kept:
    return next(number for number in kept["numbers"] if number["name"] == name)


def _interval(span: Span) -> str:
    return f"{span[0]:.3g} to {span[1]:.3g}"


def _in_words(probability: float) -> str:
    return f"{probability:.4f}" if probability >= 0.001 else f"{probability:.2g}"


def _yes(holds: bool) -> str:
    return "Yes" if holds else "No"


def _table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


if __name__ == "__main__":
    sys.stdout.write(page(guide_folder()))
