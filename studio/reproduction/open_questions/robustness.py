"""How much of what goes wrong in practice each tracker stands: a heat map a question, error over degree of damage.

Questions that the papers leave open. All trackers get the same damaged evidence, σ0 and number of evaluations; the
footage is the Lee-walk twin (for cameras a rendered walk with eight of them). One degree of every question is none, so
that each row begins with what the tracker reaches undamaged.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from studio.comparison.findings import Chart, Findings, Heat, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.tracked import Attempt, Tracked, track
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.experiment import Experiment
from studio.reproduction.fleischmann.setting import EQ13, EVALUATIONS, IMPROVED, SWARM, TWIN
from studio.reproduction.open_questions.damage import DAMAGES
from studio.reproduction.tracking import Contender, by_group

EIGHT = "eight-cameras"
FRAMES, QUICK_FRAMES = 90, 30
ALL_TERMS = "edge-region-silhouette"
MOST_SEEDS = 5
"""A cell of a heat map is a colour: more seeds than this change no colour, and there are 140 cells."""
STANDS_MM, STANDS_LOST = 60.0, 0.05
"""A tracker stands a degree if the mean over seeds stays below this error, and this share of frames with "
"a loss."""

CONTENDERS = (
    replace(IMPROVED, name="annealed, all terms", weighting=ALL_TERMS),
    IMPROVED,
    EQ13,
    replace(SWARM, name="swarm, all terms", weighting=ALL_TERMS),
    SWARM,
    Contender("Condensation", "condensation", SWARM.weighting, SWARM.changes),
)


@dataclass(frozen=True, slots=True)
class Question:
    """One heat map. degrees : from none to much. damage : of DAMAGES. fields : a degree as fields of an attempt,
    where no evidence is damaged but less of it is given.
    """

    name: str
    title: str
    axis: str
    claim: str
    degrees: tuple[float, ...]
    footage: str = TWIN
    damage: str = "none"
    fields: Callable[[float], dict[str, Any]] = lambda degree: {}

    def shown(self, degree: float) -> str:
        """The degree on the axis."""
        return f"{degree:g}"


def fewer_cameras(count: float) -> dict[str, Any]:
    """So many of the eight, spread as evenly as can be (two neighbours would see the same side)."""
    order = (1, 5, 3, 7, 2, 6, 4, 8)
    return {"cameras": tuple(sorted(f"cam{number}" for number in order[: int(count)]))}


def slower(step: float) -> dict[str, Any]:
    """Only every so many frames are seen."""
    return {"every": int(step)}


@dataclass(frozen=True, slots=True)
class Rates(Question):
    """Degrees are steps between the frames seen; shown as frames a second."""

    def shown(self, degree: float) -> str:
        """Frames a second."""
        return f"{60.0 / degree:g}"


QUESTIONS = (
    Question(
        "mask-damage",
        "Damaged silhouettes",
        "damaged pixels, share of the person's",
        "How much of the silhouettes may be wrong (holes and blobs, new in every frame)?",
        (0.0, 0.1, 0.2, 0.4, 0.8),
        damage="mask",
    ),
    Question(
        "background-clutter",
        "Background clutter",
        "edge pixels, share of the picture's",
        "How many edges of a cluttered background may there be?",
        (0.0, 0.02, 0.05, 0.1, 0.2),
        damage="clutter",
    ),
    Question(
        "calibration-error",
        "Wrong calibration",
        "pixels off in the picture's middle",
        "How far may the cameras look elsewhere than the calibration says?",
        (0.0, 2.0, 5.0, 10.0, 20.0),
        damage="calibration",
    ),
    Question(
        "fewer-cameras",
        "Few cameras",
        "cameras",
        "How few cameras are enough?",
        (8.0, 6.0, 4.0, 3.0, 2.0, 1.0),
        footage=EIGHT,
        fields=fewer_cameras,
    ),
    Rates(
        "fewer-frames",
        "Few frames a second",
        "frames a second",
        "How few frames a second are enough?",
        (1.0, 2.0, 3.0, 4.0, 6.0, 10.0),
        fields=slower,
    ),
)


def group(contender: Contender, question: Question, degree: float) -> str:
    """The words for a cell."""
    return f"{contender.name}, {question.shown(degree)}"


def trials_of(question: Question, scale: Scale) -> tuple[Trial, ...]:
    """Every contender at every degree with every seed."""
    found: list[Trial] = []
    for contender in CONTENDERS:
        for degree in question.degrees:
            for seed in scale.seeds[:MOST_SEEDS]:
                fields = question.fields(degree)
                last = QUICK_FRAMES if scale.quick else FRAMES
                attempt = contender.attempt(question.footage, seed, EVALUATIONS, last=last, **fields)
                damage = {"damage": question.damage, "degree": degree if question.damage != "none" else 0.0}
                label = f"{group(contender, question, degree)}, seed {seed}"
                found.append(Trial(label, {"attempt": attempt.plain(), **damage}))
    return tuple(found)


@kept_as("open_questions.robustness.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Track the damaged footage; the fields of `Tracked`."""
    attempt = Attempt.of_plain(arguments["attempt"])
    spoilt = DAMAGES[arguments["damage"]](float(arguments["degree"]), attempt.seed)
    return asdict(track(attempt, shelf, spoilt=spoilt))


def conclude_of(question: Question, outcomes: Sequence[Outcome]) -> Findings:
    """The heat maps of error and of losses, and up to which degree each contender stands."""
    cells = by_group(outcomes)
    errors = {
        entry.name: [_mean_error(cells[group(entry, question, degree)]) for degree in question.degrees]
        for entry in CONTENDERS
    }
    losses = {
        entry.name: [_lost_share(cells[group(entry, question, degree)]) for degree in question.degrees]
        for entry in CONTENDERS
    }
    columns = tuple(question.shown(degree) for degree in question.degrees)
    rows = tuple(entry.name for entry in CONTENDERS)
    charts = (
        _heat(f"{question.title}: mean error (mm)", question, columns, rows, errors),
        _heat(f"{question.title}: frames with a limb lost (%)", question, columns, rows, losses),
    )
    best = min(rows, key=lambda name: errors[name][-1])
    words = (
        " ".join(f"{name} stands {_standing(question, errors[name], losses[name])}." for name in rows)
        + f" At the last degree ({columns[-1]} {question.axis}) {best} is the nearest: "
        f"{errors[best][-1]:.0f} mm. To stand: a mean below {STANDS_MM:.0f} mm and a limb lost in fewer "
        f"than {100 * STANDS_LOST:.0f} % of the frames."
    )
    table = Table(
        "Mean error over seeds (mm), frames with a limb lost (%)",
        ("tracker", *(f"{column} {question.axis}" for column in columns)),
        tuple(
            (
                name,
                *(
                    f"{error:.1f} / {loss:.0f}"
                    for error, loss in zip(errors[name], losses[name], strict=True)
                ),
            )
            for name in rows
        ),
    )
    settings = {"footage": question.footage, "frames": outcomes[0].trial.arguments["attempt"]["last"]}
    return Findings("answered", words, (), (table,), charts, {**settings, "evaluations": EVALUATIONS})


def _mean_error(runs: Sequence[Tracked]) -> float:
    return float(np.mean([run.mean_mm for run in runs]))


def _lost_share(runs: Sequence[Tracked]) -> float:
    return 100.0 * float(np.mean([run.lost_frames / len(run.frames) for run in runs]))


def _standing(question: Question, errors: list[float], losses: list[float]) -> str:
    """Up to which degree errors and losses stay small, in words."""
    stood = ""
    for degree, error, loss in zip(question.degrees, errors, losses, strict=True):
        if error > STANDS_MM or loss > 100.0 * STANDS_LOST:
            break
        stood = question.shown(degree)
    return f"up to {stood} {question.axis}" if stood else "none of it"


def _heat(
    title: str,
    question: Question,
    columns: tuple[str, ...],
    rows: tuple[str, ...],
    values: dict[str, list[float]],
) -> Chart:
    cells = tuple(tuple(round(value, 2) for value in values[name]) for name in rows)
    return Chart(title, "heat", question.axis, "tracker", heat=Heat(columns, rows, cells))


def _experiment(question: Question) -> Experiment:
    def trials(scale: Scale) -> tuple[Trial, ...]:
        return trials_of(question, scale)

    def conclude(outcomes: Sequence[Outcome]) -> Findings:
        return conclude_of(question, outcomes)

    return Experiment(
        name=f"robustness-{question.name}",
        title=question.title,
        source="an open question",
        claim=question.claim,
        trials=trials,
        measure=measure,
        conclude=conclude,
        footage=(question.footage,),
    )


EXPERIMENTS = tuple(_experiment(question) for question in QUESTIONS)
