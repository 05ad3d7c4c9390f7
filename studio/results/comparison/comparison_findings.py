"""A comparison as an experiment's findings (drawn in the same way), as plain JSON, CSV and text."""

from typing import Any

from studio.foundations.csv_text import as_csv
from studio.foundations.words import counted
from studio.results.comparison.findings import Chart, Findings, Series, Table
from studio.results.comparison.plan import Comparison, PairTest, TrackerResult
from studio.results.comparison.statistics import SignTest, number
from studio.results.inspection.error_parts import BODY, LIKELIHOOD, SEARCH
from studio.search.settings import values

SIGNIFICANT = 0.05
COLUMNS = (
    "tracker", "evaluations a frame", "mean (mm)", "over seeds (mm)", "worst frame (mm)", "frames with a limb lost",
    "runs without loss", "search (ms a frame)",
)  # fmt: skip
NOT_INDEPENDENT = (
    "Consecutive frames are correlated, so the frames' p is too small: it describes, it does"
    " not prove. Seeds are independent."
)


def findings(comparison: Comparison) -> Findings:
    """Mean errors with their intervals over the seeds, the table, error curves, the sign tests as text."""
    return Findings(
        verdict="answered",
        words=in_words(comparison),
        numbers=tuple(
            number(f"{result.tracker}: mean error", result.means, "mm") for result in comparison.trackers
        ),
        tables=(_table(comparison), _tests(comparison)) if comparison.pairs else (_table(comparison),),
        charts=(error_chart(comparison), seeds_chart(comparison), *parts_charts(comparison)),
        settings=_settings(comparison),
    )


def error_chart(comparison: Comparison) -> Chart:
    """Error over frames: every seed thin, each tracker's mean over the seeds thick."""
    frames = tuple(float(frame) for frame in comparison.frames)
    series: list[Series] = []
    for result in comparison.trackers:
        if len(result.seeds) > 1:
            series += [
                Series(
                    f"{result.tracker}, seed {seed}",
                    frames,
                    tuple(run.per_frame_mm),
                    group=result.tracker,
                    thin=True,
                )
                for seed, run in zip(comparison.plan.seeds, result.seeds, strict=True)
            ]
        series.append(Series(result.tracker, frames, tuple(result.curve), group=result.tracker))
    return Chart("Error over the frames", "lines", "frame", "mean error of the markers (mm)", tuple(series))


def seeds_chart(comparison: Comparison) -> Chart:
    """Each seed's mean error, the trackers beside one another as the sign test pairs them."""
    names = tuple(str(seed) for seed in comparison.plan.seeds)
    series = tuple(
        Series(
            result.tracker,
            tuple(float(at) for at in range(len(names))),
            tuple(result.means),
            group=result.tracker,
        )
        for result in comparison.trackers
    )
    return Chart("Mean error of each seed", "bars", "seed", "mean error (mm)", series, categories=names)


def parts_charts(comparison: Comparison) -> tuple[Chart, ...]:
    """Whose fault the errors are, a bar a tracker; none where they were not split."""
    split = [result for result in comparison.trackers if result.parts_mm]
    places = tuple(map(float, range(len(split))))
    series = tuple(
        Series(part, places, tuple(result.parts_mm[part] for result in split), group=part)
        for part in (BODY, LIKELIHOOD, SEARCH)
    )
    chart = Chart(
        "Whose fault the error is, before refinement", "bars", "tracker", "mean error (mm)", series,
        categories=tuple(result.tracker for result in split), stacked=True,
    )  # fmt: skip
    return (chart,) if split else ()


def document(comparison: Comparison) -> dict[str, Any]:
    """The JSON of `studio compare --json`: `trackers` with their seeds, the sign tests; without single frames."""
    plan = comparison.plan
    return {
        "session": plan.session,
        "frames": [plan.first, plan.last],
        "fps": plan.fps,
        "body": plan.body,
        "evaluations": plan.evaluations,
        "seeds": list(plan.seeds),
        "trackers": [_plain_tracker(result, plan.seeds) for result in comparison.trackers],
        "settings": {candidate.name: candidate.chosen for candidate in plan.candidates},
        "sign_tests": [
            {
                "first": pair.first,
                "second": pair.second,
                "frames": pair.frames._asdict(),
                "seeds": pair.seeds._asdict(),
            }
            for pair in comparison.pairs
        ],
    }


def frames_csv(comparison: Comparison) -> str:
    """A row a tracker, seed and frame: its error and the limbs lost in it."""
    rows = [
        (result.tracker, seed, frame, f"{error:.3f}", " ".join(lost))
        for result in comparison.trackers
        for seed, run in zip(comparison.plan.seeds, result.seeds, strict=True)
        for frame, error, lost in zip(comparison.frames, run.per_frame_mm, run.lost, strict=True)
    ]
    return as_csv([("tracker", "seed", "frame", "error_mm", "limbs_lost"), *rows])


def in_words(comparison: Comparison) -> str:
    """The ranking, and each pair's sign tests, as sentences."""
    ranked = sorted(comparison.trackers, key=lambda result: result.mean_mm)
    order = ", ".join(f"{result.tracker} {result.mean_mm:.1f} mm" for result in ranked)
    count, seeds = len(comparison.frames), len(comparison.plan.seeds)
    sentences = [f"Mean error over {count} frames and {counted(seeds, 'seed')}, best first: {order}."]
    sentences += [*evidence_words(comparison), *parts_words(comparison)]
    sentences += [pair_words(pair) for pair in comparison.pairs]
    if comparison.pairs:
        sentences.append(NOT_INDEPENDENT)
        if 0.5 ** (seeds - 1) > SIGNIFICANT:
            least = 0.5 ** (seeds - 1)
            sentences.append(f"With {counted(seeds, 'seed')} the seeds' p cannot fall below {least:.2g};")
            sentences[-1] += " six or more can show a difference at 5 %."
    return " ".join(sentences)


def evidence_words(comparison: Comparison) -> list[str]:
    """The log evidence of candidates that have one, the highest first, in a sentence."""
    known = [(one.log_evidence, one.tracker) for one in comparison.trackers if one.log_evidence is not None]
    if not known:
        return []
    order = ", ".join(f"{name} {value:.1f}" for value, name in sorted(known, reverse=True))
    return [
        f"Log evidence, nats a frame: {order}; of candidates with one likelihood and scale, the highest explains the"
        " pictures best."
    ]


def parts_words(comparison: Comparison) -> list[str]:
    """Whose fault the errors are, in a sentence; none where they were not split."""
    split = [
        f"{result.tracker} "
        + ", ".join(f"{part} {value:.1f}".replace("-", "\N{MINUS SIGN}") for part, value in parts.items())
        for result in comparison.trackers
        if (parts := result.parts_mm)
    ]
    if not split:
        return []
    count = counted(comparison.plan.split_frames, "frame")
    return [
        f"Whose part of the error it is, mm before refinement, in {count} of each trial: {'; '.join(split)}.",
        "The search's is below zero where a heavier pose is known that is farther off.",
    ]


def pair_words(pair: PairTest) -> str:
    """One pair's sign tests as a sentence."""
    ahead = pair.frames.better >= pair.frames.worse
    winner, other = (pair.first, pair.second) if ahead else (pair.second, pair.first)
    return (
        f"{winner} is nearer than {other} in {_share(pair.frames, ahead)} frames ({p_words(pair.frames.p)}) and in"
        f" {_share(pair.seeds, ahead)} seeds ({p_words(pair.seeds.p)})."
    )


def p_words(p: float) -> str:
    return "p < 0.0001" if p < 1e-4 else f"p = {p:.2g}"


def table_text(comparison: Comparison) -> str:
    rows = [[str(cell) for cell in row] for row in ([*COLUMNS], *_table(comparison).rows)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(COLUMNS))]
    lines = [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    sentences = in_words(comparison).replace(". ", ".\n")
    return "\n".join([*lines, "", sentences])


def _share(test: SignTest, ahead: bool) -> str:
    """ "140 of 150" of the side that is ahead in frames."""
    count = test.better if ahead else test.worse
    return f"{count} of {test.better + test.worse + test.ties}"


def _table(comparison: Comparison) -> Table:
    frames = max(1, comparison.plan.frame_count - 1)
    rows: list[tuple[Any, ...]] = []
    for result in comparison.trackers:
        means = result.means
        clean = sum(seed.lost_frames == 0 for seed in result.seeds)
        count = len(result.seeds)
        rows.append(
            (
                result.tracker,
                result.evaluations,
                round(result.mean_mm, 1),
                f"{min(means):.1f} to {max(means):.1f}",
                round(result.worst_mm, 1),
                f"{result.lost_frames} of {count * len(comparison.frames)}",
                f"{clean} of {count}",
                round(1000.0 * result.seconds / count / frames, 1),
            )
        )
    return Table("All trackers", COLUMNS, tuple(rows))


def _tests(comparison: Comparison) -> Table:
    """The sign tests, a row a pair."""
    columns = ("pair", "nearer in frames", "p over frames", "nearer in seeds", "p over seeds")
    rows = tuple(
        (
            f"{pair.first} against {pair.second}",
            f"{pair.frames.better} : {pair.frames.worse}",
            float(f"{pair.frames.p:.2g}"),
            f"{pair.seeds.better} : {pair.seeds.worse}",
            float(f"{pair.seeds.p:.2g}"),
        )
        for pair in comparison.pairs
    )
    return Table("Sign tests", columns, rows)


def _settings(comparison: Comparison) -> dict[str, Any]:
    plan = comparison.plan
    listed: dict[str, Any] = {
        "session": plan.session,
        "frames": f"{plan.first} to {plan.last - 1} at {plan.fps:g} per second",
        "body": plan.body or "the session's",
        "seeds": ", ".join(str(seed) for seed in plan.seeds),
    }
    for candidate in plan.candidates:
        defaults = values(candidate.settings())
        listed[candidate.name] = ", ".join(
            [
                candidate.weighting,
                *([f"body {candidate.body}"] if candidate.body else []),
                *(f"{knob} {defaults[knob]}" for knob in candidate.changes),
            ]
        )
    return listed


def _plain_tracker(result: TrackerResult, seeds: tuple[int, ...]) -> dict[str, Any]:
    """A tracker's figures and its seeds', without single frames."""
    names = ("evaluations", "mean_mm", "worst_mm", "lost_frames", "seconds")
    runs = [
        {"tracker": result.tracker, **{name: getattr(run, name) for name in names}, "seed": seed}
        for seed, run in zip(seeds, result.seeds, strict=True)
    ]
    fields = {name: getattr(result, name) for name in names}
    rounded: dict[str, float] = {
        "mean_mm": round(result.mean_mm, 4),
        "seconds": round(result.seconds, 4),
    }
    if result.log_evidence is not None:
        rounded["log_evidence"] = round(result.log_evidence, 3)
    split = {"parts_mm": {part: round(value, 3) for part, value in result.parts_mm.items()}}
    return {
        "tracker": result.tracker,
        **fields,
        **rounded,
        **(split if result.parts_mm else {}),
        "seeds": runs,
    }
