"""How much of what goes wrong in practice each tracker stands: a heat map a question, error over degree of damage.

Questions that the papers leave open. All trackers get the same damaged evidence, σ0 and number of evaluations; the
footage is the Lee-walk twin (for cameras a rendered walk with eight of them). One degree of every question is none, so
that each row begins with what the tracker reaches undamaged.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from studio.comparison.findings import Chart, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.tracked import Attempt, Tracked, track
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.drawing import heat_chart
from studio.reproduction.experiment import Experiment, concluding
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
    where no evidence is damaged but less of it is given. shown : a degree on the axis.
    """

    name: str
    title: str
    axis: str
    claim: str
    degrees: tuple[float, ...]
    footage: str = TWIN
    damage: str = "none"
    fields: Callable[[float], dict[str, Any]] = lambda degree: {}
    shown: Callable[[float], str] = "{:g}".format


def fewer_cameras(count: float) -> dict[str, Any]:
    """So many of the eight, spread as evenly as can be (two neighbours would see the same side)."""
    order = (1, 5, 3, 7, 2, 6, 4, 8)
    return {"cameras": tuple(sorted(f"cam{number}" for number in order[: int(count)]))}


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
    Question(
        "fewer-frames",
        "Few frames a second",
        "frames a second",
        "How few frames a second are enough?",
        (1.0, 2.0, 3.0, 4.0, 6.0, 10.0),
        # Only every so many frames are seen.
        fields=lambda step: {"every": int(step)},
        shown=lambda step: f"{60.0 / step:g}",
    ),
)


def group(contender: Contender, question: Question, degree: float) -> str:
    """The words for a cell."""
    return f"{contender.name}, {question.shown(degree)}"


def _trials(question: Question, scale: Scale) -> tuple[Trial, ...]:
    """Every contender at every degree with every seed."""
    found: list[Trial] = []
    last = QUICK_FRAMES if scale.quick else FRAMES
    for contender in CONTENDERS:
        for degree in question.degrees:
            damage = {"damage": question.damage, "degree": degree if question.damage != "none" else 0.0}
            for seed in scale.seeds[:MOST_SEEDS]:
                attempt = contender.attempt(
                    question.footage, seed, EVALUATIONS, last=last, **question.fields(degree)
                )
                label = f"{group(contender, question, degree)}, seed {seed}"
                found.append(Trial(label, {"attempt": attempt.plain(), **damage}))
    return tuple(found)


@kept_as("open_questions.robustness.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Track the damaged footage; the fields of `Tracked`."""
    attempt = Attempt.of_plain(arguments["attempt"])
    spoilt = DAMAGES[arguments["damage"]](float(arguments["degree"]), attempt.seed)
    return asdict(track(attempt, shelf, spoilt=spoilt))


@dataclass(frozen=True, slots=True)
class Cells:
    """What every contender (a row) reached at every degree (a column): mean error, mm, and frames with a loss, %."""

    errors: Mapping[str, list[float]]
    losses: Mapping[str, list[float]]


def _cells(question: Question, outcomes: Sequence[Outcome]) -> Cells:
    runs = by_group(outcomes)

    def means(of: Callable[[Tracked], float], factor: float = 1.0) -> dict[str, list[float]]:
        return {
            entry.name: [
                factor * float(np.mean([of(run) for run in runs[group(entry, question, degree)]]))
                for degree in question.degrees
            ]
            for entry in CONTENDERS
        }

    return Cells(means(lambda run: run.mean_mm), means(lambda run: run.lost_frames / len(run.frames), 100.0))


def _words(question: Question, cells: Cells) -> str:
    last = question.shown(question.degrees[-1])
    best = min(cells.errors, key=lambda name: cells.errors[name][-1])
    stood = " ".join(f"{name} stands {_standing(question, cells, name)}." for name in cells.errors)
    return (
        f"{stood} At the last degree ({last} {question.axis}) {best} is the nearest: "
        f"{cells.errors[best][-1]:.0f} mm. To stand: a mean below {STANDS_MM:.0f} mm and a limb lost in fewer "
        f"than {100 * STANDS_LOST:.0f} % of the frames."
    )


def _standing(question: Question, cells: Cells, name: str) -> str:
    """Up to which degree errors and losses stay small, in words."""
    stood = ""
    for degree, error, loss in zip(question.degrees, cells.errors[name], cells.losses[name], strict=True):
        if error > STANDS_MM or loss > 100.0 * STANDS_LOST:
            break
        stood = question.shown(degree)
    return f"up to {stood} {question.axis}" if stood else "none of it"


def _table(question: Question, cells: Cells) -> Table:
    rows = tuple(
        (name, *(f"{error:.1f} / {loss:.0f}" for error, loss in zip(errors, cells.losses[name], strict=True)))
        for name, errors in cells.errors.items()
    )
    heads = (f"{question.shown(degree)} {question.axis}" for degree in question.degrees)
    return Table("Mean error over seeds (mm), frames with a limb lost (%)", ("tracker", *heads), rows)


def _heat(title: str, question: Question, values: Mapping[str, list[float]]) -> Chart:
    columns = map(question.shown, question.degrees)
    return heat_chart(f"{question.title}: {title}", question.axis, "tracker", columns, values)


def _experiment(question: Question) -> Experiment:
    return Experiment(
        name=f"robustness-{question.name}",
        title=question.title,
        source="an open question",
        claim=question.claim,
        trials=partial(_trials, question),
        measure=measure,
        conclude=concluding(
            partial(_cells, question),
            claims=(),
            words=lambda cells, numbers: _words(question, cells),
            tables=(partial(_table, question),),
            charts=(
                lambda cells: _heat("mean error (mm)", question, cells.errors),
                lambda cells: _heat("frames with a limb lost (%)", question, cells.losses),
            ),
            settings=lambda outcomes: {
                "footage": question.footage,
                "frames": outcomes[0].trial.arguments["attempt"]["last"],
                "evaluations": EVALUATIONS,
            },
        ),
        footage=(question.footage,),
    )


EXPERIMENTS = tuple(_experiment(question) for question in QUESTIONS)
