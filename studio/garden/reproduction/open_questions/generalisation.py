"""Accuracy of each tracker on footage that it was not tuned to: the suite of rendered clips, by halves.

Defaults are chosen on the first half; the second is used only for reporting. A tracker knows of a clip only what a
session gives: the lengths of the bones, or, for one candidate, the person's height alone.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import numpy as np

from studio.garden.drawn_recipes import CHOOSING, HALVES, KINDS, clip_name
from studio.garden.reproduction.caillette.training_set import Training, model_file
from studio.garden.reproduction.drawing import heat_chart
from studio.garden.reproduction.experiment import Part, each_seed, listed
from studio.garden.reproduction.tracking import Candidate, Runs, by_group, lost_percent, named_percent
from studio.results.comparison.findings import Plain, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import Tracked, TrackingTrial, track
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.drawing_footage.recipes import SUBJECT_OF_HEIGHT
from studio.runs.setup.shape_on_the_way import FIRST_FRAMES
from studio.runs.setup.things_in_front import find_things_in_front
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING
from studio.sessions.background_files import EVIDENCE_NAME, use_found_in_front
from studio.sessions.session import Session

EVALUATIONS = 1000
NEAR_MM = 24.0
"""A clip with a smaller mean error counts as near."""
QUICK_FRAMES, QUICK_KINDS = 24, ("walk", "walk-20hz", "kick", "hard")
WALKS = ("walk", "walk-20hz", "turns", "hard")
"""Kinds of clips that the behaviour model, learnt from walks alone, fits."""
TRAINING = Training(("walk", "walk-with-turns", "circle-three-cameras"), performances=2, body="human31")
THREE_TERMS, PAPERS_TERMS = "edge-region-silhouette", "edge-region"
REFINED, SEARCH_ALONE = {"refine_frames": True}, {"refine_frames": False}
PAPER = {
    "adaptive_diffusion": True,
    "diffusion_form": "paper",
    "crossover": 0.5,
    "crossover_by": "parameters",
    "survival": 0.5,
}
"""Deutscher & Reid's filter as in the paper, weighed by edges and region."""
AS_A_RUN = {"shape_frames": FIRST_FRAMES}
"""A run begins with the shape that its first frames show."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A candidate of the suite. kinds : clips that it tracks, () for all. fields : of its attempts. training : of its
    behaviour model.
    """

    candidate: Candidate
    kinds: tuple[str, ...] = ()
    fields: Mapping[str, Any] = field(default_factory=dict[str, Any])
    training: Training | None = None

    @property
    def name(self) -> str:
        """The candidate's name."""
        return self.candidate.name


def _usual(name: str, tracker: str = DEFAULT_TRACKER, weighting: str = "") -> Candidate:
    """A tracker with the studio's defaults, "" for the usual weighting."""
    return Candidate(name, tracker, weighting or DEFAULT_WEIGHTING, REFINED)


ENTRIES = (
    Entry(_usual("annealed, default"), fields=AS_A_RUN),
    *(
        Entry(_usual(f"annealed, {weighting}", "annealed", weighting), fields=AS_A_RUN)
        for weighting in (PAPERS_TERMS, THREE_TERMS)
        if weighting != DEFAULT_WEIGHTING
    ),
    Entry(Candidate("annealed, three terms, search alone", "annealed", THREE_TERMS, SEARCH_ALONE)),
    Entry(Candidate("annealed, as the paper", "annealed", PAPERS_TERMS, {**PAPER, **SEARCH_ALONE})),
    Entry(_usual("swarm", "swarm"), fields=AS_A_RUN),
    Entry(_usual("condensation", "condensation"), fields=AS_A_RUN),
    Entry(_usual("behaviour", "behaviour"), kinds=WALKS, fields=AS_A_RUN, training=TRAINING),
    Entry(_usual("annealed, default, height alone"), fields={**AS_A_RUN, "subject": SUBJECT_OF_HEIGHT}),
)
"""The candidates; knobs to switch on or off are among a candidate's changes."""


def _mean(of: Callable[[Tracked], float]) -> Callable[[Runs], float]:
    return lambda runs: float(np.mean([of(run) for run in runs]))


MEAN, WORST = _mean(lambda run: run.mean_mm), _mean(lambda run: run.worst_mm)
LOST = _mean(lost_percent)
COLUMNS: Mapping[str, Callable[[Runs], float]] = {
    "mean (mm)": MEAN,
    "highest seed (mm)": lambda runs: max(run.mean_mm for run in runs),
    "mean of worst frames (mm)": WORST,
    "largest (mm)": lambda runs: max(run.worst_mm for run in runs),
    "frames with a limb lost (%)": LOST,
    "highest seed (%)": lambda runs: max(map(lost_percent, runs)),
    "named of frames with a limb lost (%)": partial(named_percent, lost=True),
    "named of other frames (%)": partial(named_percent, lost=False),
    "search (ms a frame)": lambda runs: (
        1000.0 * float(np.mean([run.seconds / max(1, len(run.frames) - 1) for run in runs]))
    ),
}
"""Columns of the long tables: statistics over all seeds of a clip."""


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every candidate on every clip with every seed, clip by clip so that a clip's evidence is computed once."""
    planned: list[Trial] = []
    for clip, kind in ((clip_name(half, kind), kind) for half in HALVES for kind in KINDS):
        last = QUICK_FRAMES if scale.quick else KINDS[kind].frames
        for entry in ENTRIES:
            if kind in (entry.kinds or KINDS) and (kind in QUICK_KINDS or not scale.quick):
                arguments = partial(_arguments, entry, clip, last)
                planned += each_seed(f"{entry.name} on {clip}", scale.seeds, arguments)
    return tuple(planned)


def _arguments(entry: Entry, clip: str, last: int, seed: int) -> dict[str, Any]:
    attempt = entry.candidate.attempt(clip, seed, EVALUATIONS, last=last, **entry.fields)
    extra = {} if entry.training is None else {"training": entry.training.plain()}
    return {"attempt": attempt.plain(), **extra}


@kept_as("open_questions.generalisation.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track a clip; the fields of `Tracked`."""
    plain = dict(arguments["attempt"])
    if "training" in arguments:
        plain["behaviour"] = str(model_file(cache, Training.of_plain(arguments["training"])))
    set_up_things_in_front(cache.session(plain["footage"]))
    return asdict(track(TrackingTrial.of_plain(plain), cache))


def set_up_things_in_front(session: Session) -> None:
    """Find what stands in front of the subject, once for a clip: no masks of a drawn one are set up, which does it."""
    if not (session.path / EVIDENCE_NAME).exists():
        use_found_in_front(session, find_things_in_front(session))


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Both halves' tables, the number of clips in which each candidate is near, and its frames with a limb lost."""
    groups = by_group(outcomes)
    for half in HALVES:
        # By candidate and kind, the runs of the half.
        by_entry: dict[str, dict[str, list[Tracked]]] = {}
        for entry in ENTRIES:
            clips = {kind: groups.get(f"{entry.name} on {clip_name(half, kind)}") for kind in KINDS}
            by_entry[entry.name] = {kind: runs for kind, runs in clips.items() if runs}
        yield from _half(half, by_entry)
    yield {
        "evaluations": EVALUATIONS,
        "near (mm)": NEAR_MM,
        "most frames": max(outcome.trial.arguments["attempt"]["last"] for outcome in outcomes),
        "behaviour learnt from": ", ".join(TRAINING.sources),
    }


def _half(half: str, by_entry: Mapping[str, Mapping[str, Runs]]) -> Iterator[Part]:
    """Of each candidate over its clips: mean, share of near clips, frames with a limb lost, one value a seed; a short
    table (mean / mean of worst frames / % frames with a limb lost), a long one, heat maps, and the nearest of those
    that track all clips.
    """
    called = "Half to choose by" if half == CHOOSING else "Half only reported"
    kinds = [kind for kind in KINDS if any(kind in clips for clips in by_entry.values())]
    for name, clips in by_entry.items():
        by_seed, words = list(zip(*clips.values(), strict=True)), f"{name}, {half}"
        near = [100.0 * float(np.mean([run.mean_mm <= NEAR_MM for run in runs])) for runs in by_seed]
        yield number(f"mean error, {words}", map(MEAN, by_seed), "mm", better="lower")
        yield number(f"clips with a mean of at most {NEAR_MM:.0f} mm, {words}", near, "%", better="higher")
        yield number(f"frames with a limb lost, {words}", map(LOST, by_seed), "%", better="lower")
        for lost, of, better in (
            (True, "frames with a limb lost", "higher"),
            (False, "other frames", "lower"),
        ):
            share = [named_percent(runs, lost=lost) for runs in by_seed]
            yield number(f"named of {of}, {words}", share, "%", better=better)
    means = {
        entry.name: float(np.mean([MEAN(runs) for runs in by_entry[entry.name].values()]))
        for entry in ENTRIES
        if not entry.kinds
    }
    best = min(means, key=means.__getitem__)
    yield f"{called}: {best} is the nearest, {means[best]:.1f} mm on average over {len(kinds)} clips."
    short, long = list[tuple[Plain, ...]](), list[tuple[Plain, ...]]()
    for kind in kinds:
        on_clip = {name: clips.get(kind, ()) for name, clips in by_entry.items()}
        cells = (
            f"{MEAN(runs):.1f} / {WORST(runs):.0f} / {LOST(runs):.0f}" if runs else "–"
            for runs in on_clip.values()
        )
        short.append((f"{kind} ({KINDS[kind].title})", *cells))
        for name, runs in on_clip.items():
            if runs:
                long.append((kind, name, len(runs), *(round(of(runs), 1) for of in COLUMNS.values())))
    title = f"{called}: mean (mm) / mean of worst frames (mm) / frames with a limb lost (%)"
    yield Table(title, ("clip", *by_entry), tuple(short))
    yield Table(f"{called}: over seeds", ("clip", "tracker", "seeds", *COLUMNS), tuple(long))
    for title, of in (("mean error (mm)", MEAN), ("frames with a limb lost (%)", LOST)):
        rows = {
            name: [of(clips[kind]) if kind in clips else float("nan") for kind in kinds]
            for name, clips in by_entry.items()
        }
        yield heat_chart(f"{called}: {title}", "clip", "tracker", kinds, rows)


EXPERIMENTS = (
    listed(
        "generalisation",
        trials,
        measure,
        shown,
        footage=tuple(clip_name(half, kind) for half in HALVES for kind in KINDS),
    ),
)
