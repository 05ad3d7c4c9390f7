"""How right each tracker is on footage that it was not tuned to: the suite of drawn clips, its two halves apart.

Defaults are chosen by the first half; the second is looked at only to report. Nothing of a clip is known to a tracker
but what a session gives: the lengths of the bones, or, where a contender says so, the person's height alone.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from studio.comparison.findings import Chart, Findings, Heat, Number, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number
from studio.comparison.tracked import Attempt, Tracked, track
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.caillette.training_set import Training, model_file
from studio.reproduction.experiment import Experiment
from studio.reproduction.tracking import Contender, by_group
from studio.runs.shape_on_the_way import FIRST_FRAMES
from studio.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING
from studio.synthesis.drawn_recipes import CHOOSING, HALVES, KINDS, clip_name
from studio.synthesis.recipes import SUBJECT_OF_HEIGHT

EVALUATIONS = 1000
NEAR_MM = 24.0
"""A clip with a smaller mean error counts as near."""
QUICK_FRAMES, QUICK_KINDS = 24, ("walk", "walk-20hz", "kick", "hard")
WALKS = ("walk", "walk-20hz", "turns", "hard")
"""What the behaviour model, learnt from walks alone, fits."""
TAUGHT = Training(("walk", "walk-with-turns", "circle-three-cameras"), performances=2, body="human31")
THREE_TERMS, PAPERS_TERMS = "edge-region-silhouette", "edge-region"
REFINED, SEARCH_ALONE = {"refine_frames": True}, {"refine_frames": False}
PAPER = {
    "adaptive_diffusion": True,
    "diffusion_form": "paper",
    "crossover": 0.5,
    "crossover_by": "parameters",
    "survival": 0.5,
}
"""Deutscher & Reid's filter as they write it, weighed by edges and region."""
AS_A_RUN = {"shape_frames": FIRST_FRAMES}
"""A run begins with the shape that its first frames show."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A contender of the suite. kinds : clips that it tracks, () for all. fields : of its attempts. training : what
    its behaviour model is learnt from.
    """

    contender: Contender
    kinds: tuple[str, ...] = ()
    fields: Mapping[str, Any] = field(default_factory=dict)
    training: Training | None = None

    @property
    def name(self) -> str:
        """The contender's."""
        return self.contender.name


def _usual(name: str, tracker: str = DEFAULT_TRACKER, weighting: str = "") -> Contender:
    """A tracker with the studio's defaults, "" for the usual weighting."""
    return Contender(name, tracker, weighting or DEFAULT_WEIGHTING, REFINED)


ENTRIES = (
    Entry(_usual("annealed, default"), fields=AS_A_RUN),
    *(
        Entry(_usual(f"annealed, {weighting}", "annealed", weighting), fields=AS_A_RUN)
        for weighting in (PAPERS_TERMS, THREE_TERMS)
        if weighting != DEFAULT_WEIGHTING
    ),
    Entry(Contender("annealed, three terms, search alone", "annealed", THREE_TERMS, SEARCH_ALONE)),
    Entry(Contender("annealed, as the paper", "annealed", PAPERS_TERMS, {**PAPER, **SEARCH_ALONE})),
    Entry(_usual("swarm", "swarm"), fields=AS_A_RUN),
    Entry(_usual("condensation", "condensation"), fields=AS_A_RUN),
    Entry(_usual("behaviour", "behaviour"), kinds=WALKS, fields=AS_A_RUN, training=TAUGHT),
    Entry(
        _usual("annealed, default, height alone"),
        fields={**AS_A_RUN, "subject": SUBJECT_OF_HEIGHT},
    ),
)
"""One line each; a knob that is to be switched on or off is one of the contender's changes."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of the long tables: what is taken of all seeds of a clip."""

    head: str
    of: Callable[[Sequence[Tracked]], float]


def lost_percent(run: Tracked) -> float:
    """Frames with a limb lost, per cent."""
    return 100.0 * run.lost_frames / len(run.frames)


COLUMNS = (
    Column("mean (mm)", lambda runs: float(np.mean([run.mean_mm for run in runs]))),
    Column("highest seed (mm)", lambda runs: max(run.mean_mm for run in runs)),
    Column("mean of worst frames (mm)", lambda runs: float(np.mean([run.worst_mm for run in runs]))),
    Column("largest (mm)", lambda runs: max(run.worst_mm for run in runs)),
    Column("frames with a limb lost (%)", lambda runs: float(np.mean([lost_percent(run) for run in runs]))),
    Column("highest seed (%)", lambda runs: max(lost_percent(run) for run in runs)),
    Column(
        "search (ms a frame)",
        lambda runs: 1000.0 * float(np.mean([run.seconds / max(1, len(run.frames) - 1) for run in runs])),
    ),
)


def group(entry: Entry, clip: str) -> str:
    """The words for a contender on a clip."""
    return f"{entry.name} on {clip}"


def kinds_of(entry: Entry, quick: bool) -> tuple[str, ...]:
    """The clips that a contender tracks."""
    return tuple(
        kind
        for kind in (QUICK_KINDS if quick else KINDS)
        if kind in KINDS and (not entry.kinds or kind in entry.kinds)
    )


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every contender on every clip with every seed, clip by clip so that a clip's evidence is made once."""
    found: list[Trial] = []
    for half in HALVES:
        for kind in KINDS:
            for entry in ENTRIES:
                if kind not in kinds_of(entry, scale.quick):
                    continue
                clip = clip_name(half, kind)
                last = QUICK_FRAMES if scale.quick else KINDS[kind].frames
                for seed in scale.seeds:
                    attempt = entry.contender.attempt(clip, seed, EVALUATIONS, last=last, **entry.fields)
                    arguments: dict[str, Any] = {"attempt": attempt.plain()}
                    if entry.training is not None:
                        arguments["training"] = entry.training.plain()
                    found.append(Trial(f"{group(entry, clip)}, seed {seed}", arguments))
    return tuple(found)


@kept_as("open_questions.generalisation.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Track a clip; the fields of `Tracked`."""
    plain = dict(arguments["attempt"])
    if "training" in arguments:
        plain["behaviour"] = str(model_file(shelf, Training.of_plain(arguments["training"])))
    return asdict(track(Attempt.of_plain(plain), shelf))


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """Both halves' tables, how many clips each contender is near in, and how often it loses a limb."""
    groups = by_group(outcomes)
    tables: list[Table] = []
    charts: list[Chart] = []
    numbers: list[Number] = []
    for half in HALVES:
        found = _half(half, groups)
        tables += [_short(half, found), _long(half, found)]
        charts += _heats(half, found)
        numbers += _numbers(half, found)
    frames = {outcome.trial.arguments["attempt"]["last"] for outcome in outcomes}
    settings = {
        "evaluations": EVALUATIONS,
        "near (mm)": NEAR_MM,
        "most frames": max(frames),
        "behaviour learnt from": ", ".join(TAUGHT.sources),
    }
    return Findings("answered", _words(groups), tuple(numbers), tuple(tables), tuple(charts), settings)


Half = dict[str, dict[str, list[Tracked]]]


def _half(half: str, groups: Mapping[str, list[Tracked]]) -> Half:
    """By contender and kind, the runs of a half."""
    found: Half = {}
    for entry in ENTRIES:
        for kind in KINDS:
            runs = groups.get(group(entry, clip_name(half, kind)))
            if runs:
                found.setdefault(entry.name, {})[kind] = runs
    return found


def _kinds(found: Half) -> tuple[str, ...]:
    return tuple(kind for kind in KINDS if any(kind in clips for clips in found.values()))


def _short(half: str, found: Half) -> Table:
    """A line a clip, a column a contender: mean mm / mean of worst frames / % frames with a limb lost."""
    mean, worst, lost = COLUMNS[0], COLUMNS[2], COLUMNS[4]
    rows = []
    for kind in _kinds(found):
        cells = [
            f"{mean.of(clips[kind]):.1f} / {worst.of(clips[kind]):.0f} / {lost.of(clips[kind]):.0f}"
            if kind in clips
            else "–"
            for clips in found.values()
        ]
        rows.append((f"{kind} ({KINDS[kind].title})", *cells))
    title = f"{_called(half)}: mean (mm) / mean of worst frames (mm) / frames with a limb lost (%)"
    return Table(title, ("clip", *found), tuple(rows))


def _long(half: str, found: Half) -> Table:
    """A line a clip and contender, mean and worst over seeds."""
    rows = tuple(
        (kind, name, len(clips[kind]), *(round(column.of(clips[kind]), 1) for column in COLUMNS))
        for kind in _kinds(found)
        for name, clips in found.items()
        if kind in clips
    )
    columns = ("clip", "tracker", "seeds", *(column.head for column in COLUMNS))
    return Table(f"{_called(half)}: over seeds", columns, rows)


def _heats(half: str, found: Half) -> list[Chart]:
    """Error and losses, contenders by clips."""
    kinds = _kinds(found)
    charts = []
    for title, column in (("mean error (mm)", COLUMNS[0]), ("frames with a limb lost (%)", COLUMNS[4])):
        cells = tuple(
            tuple(round(column.of(clips[kind]), 2) if kind in clips else float("nan") for kind in kinds)
            for clips in found.values()
        )
        heat = Heat(kinds, tuple(found), cells)
        charts.append(Chart(f"{_called(half)}: {title}", "heat", "clip", "tracker", heat=heat))
    return charts


def _numbers(half: str, found: Half) -> list[Number]:
    """Of each contender over its clips: mean, share of near clips, frames with a limb lost; one value a seed."""
    numbers = []
    for name, clips in found.items():
        by_seed = list(zip(*clips.values(), strict=True))
        words = f"{name}, {half}"
        means = [float(np.mean([run.mean_mm for run in runs])) for runs in by_seed]
        near = [100.0 * float(np.mean([run.mean_mm <= NEAR_MM for run in runs])) for runs in by_seed]
        lost = [float(np.mean([lost_percent(run) for run in runs])) for runs in by_seed]
        numbers += [
            number(f"mean error, {words}", means, "mm", better="lower"),
            number(f"clips with a mean of at most {NEAR_MM:.0f} mm, {words}", near, "%", better="higher"),
            number(f"frames with a limb lost, {words}", lost, "%", better="lower"),
        ]
    return numbers


def _words(groups: Mapping[str, list[Tracked]]) -> str:
    """The nearest on each half over the clips that all are tracked on, and the price of the slow cameras."""
    sentences = []
    for half in HALVES:
        found = _half(half, groups)
        all_clips = [entry.name for entry in ENTRIES if not entry.kinds and entry.name in found]
        means = {name: _over_clips(found[name], COLUMNS[0]) for name in all_clips}
        lost = {name: _over_clips(found[name], COLUMNS[4]) for name in all_clips}
        best = min(means, key=lambda name: means[name])
        usual = ENTRIES[0].name
        sentences.append(
            f"{_called(half)}: {best} is the nearest, {means[best]:.1f} mm on average over"
            f" {len(_kinds(found))} clips with a limb lost in {lost[best]:.0f} % of the frames;"
            f" {usual} is {means[usual]:.1f} mm off and loses a limb in {lost[usual]:.0f} %."
        )
        clips = found[usual]
        if "walk" in clips and "walk-20hz" in clips:
            quick, slow = (COLUMNS[0].of(clips[kind]) for kind in ("walk", "walk-20hz"))
            sentences.append(f"The same walk at 20 Hz is {slow:.1f} mm off instead of {quick:.1f}.")
    return " ".join(sentences)


def _over_clips(clips: Mapping[str, Sequence[Tracked]], column: Column) -> float:
    return float(np.mean([column.of(runs) for runs in clips.values()]))


def _called(half: str) -> str:
    return "Half to choose by" if half == CHOOSING else "Half only reported"


EXPERIMENT = Experiment(
    name="generalisation",
    title="Footage that nothing was tuned to",
    source="an open question",
    claim="How far off is each tracker on people, rooms, cameras and motions that its defaults were not chosen by?",
    trials=trials,
    measure=measure,
    conclude=conclude,
    footage=tuple(clip_name(half, kind) for half in HALVES for kind in KINDS),
)
