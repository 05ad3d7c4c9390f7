"""Tolerance of each tracker to practical faults: a heat map a question, error over degree of damage.

Questions that the papers leave open. All trackers get the same damaged evidence, σ0 and number of evaluations; the
footage is the Lee-walk twin (for cameras a rendered walk with eight of them). One degree of every question is none, so
that each row begins with the undamaged error.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.garden.reproduction.drawing import heat_chart
from studio.garden.reproduction.experiment import TABLE, Part, each_seed, listed
from studio.garden.reproduction.fleischmann import EQ13, EVALUATIONS, IMPROVED, SWARM, TWIN
from studio.garden.reproduction.tracking import Candidate, by_group
from studio.results.comparison.findings import Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.tracked import Changed, TrackingTrial, track
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.drawing_footage.damage import misplaced

# Kinds of damage to a tracker's input, each of a degree, the same for the same seed.
# Masks and edge maps are damaged in memory, the calibration in the cameras: the session itself is not changed.

HOLE_SHARE = 0.5
"""Share of holes in a mask's damage; the rest are blobs beside the person."""
BLOB_PIXELS = 9.0
"""Radius of holes and blobs, up to twice that: a hand's or a shadow's size in the twin's pictures."""
AROUND = 40
"""Blobs lie within this many pixels of the person."""
CLUTTER_LENGTH = (30.0, 120.0)
CLUTTER_BLUR = 2.0
FOREGROUND = 255


def nothing(degree: float, seed: int) -> Changed:
    """No damage."""
    return Changed()


def mask_damage(degree: float, seed: int) -> Changed:
    """Holes torn into the masks, and blobs set beside the person, new in every frame.

    degree : damaged pixels as a share of the person's.
    """

    def spoil(evidence: FrameEvidence) -> FrameEvidence:
        views = tuple(
            replace(
                view,
                mask=damaged_mask(view.mask, degree, np.random.default_rng((seed, evidence.frame, index))),
            )
            for index, view in enumerate(evidence.views)
        )
        return FrameEvidence(evidence.frame, views)

    return Changed(evidence=spoil)


def damaged_mask(mask: Bytes, degree: float, rng: np.random.Generator) -> Bytes:
    """The mask with round holes and blobs until they cover `degree` of the person's pixels."""
    person = int((mask > 0).sum())
    if degree <= 0.0 or person == 0:
        return mask
    damaged = mask.copy()
    rows, columns = np.nonzero(mask)
    wanted = degree * person
    torn = set_ = 0
    while torn < HOLE_SHARE * wanted:
        place = int(rng.integers(person))
        torn += _paint(damaged, columns[place], rows[place], BLOB_PIXELS * (1.0 + rng.random()), 0)
    # Blobs fall near the person; those that hit it do not count, so the number of tries is bounded.
    for _ in range(10_000):
        if set_ >= (1.0 - HOLE_SHARE) * wanted:
            break
        place = int(rng.integers(person))
        x, y = columns[place] + rng.uniform(-AROUND, AROUND), rows[place] + rng.uniform(-AROUND, AROUND)
        if 0 <= int(y) < mask.shape[0] and 0 <= int(x) < mask.shape[1] and not mask[int(y), int(x)]:
            set_ += _paint(damaged, x, y, BLOB_PIXELS * (1.0 + rng.random()), FOREGROUND)
    return damaged


def _paint(mask: Bytes, x: float, y: float, radius: float, value: int) -> int:
    """Paint a disc; returns how many pixels changed."""
    height, width = mask.shape
    top, bottom = max(0, int(y - radius)), min(height, int(y + radius) + 2)
    left, right = max(0, int(x - radius)), min(width, int(x + radius) + 2)
    window = mask[top:bottom, left:right]
    down, along = np.ogrid[top:bottom, left:right]
    disc = (down - y) ** 2 + (along - x) ** 2 <= radius * radius
    changed = int((disc & (window != value)).sum())
    window[disc] = value
    return changed


def clutter(degree: float, seed: int) -> Changed:
    """Static straight edges all over the edge maps, as in a cluttered room.

    degree : pixels on an edge as a share of the picture's.
    """
    kept: dict[tuple[int, tuple[int, ...]], Bytes] = {}

    def spoil(evidence: FrameEvidence) -> FrameEvidence:
        views: list[ViewEvidence] = []
        for index, view in enumerate(evidence.views):
            key = (index, view.edges.shape)
            if key not in kept:
                kept[key] = clutter_edges(view.edges.shape, degree, np.random.default_rng((seed, index)))
            views.append(replace(view, edges=np.maximum(view.edges, kept[key])))
        return FrameEvidence(evidence.frame, tuple(views))

    return Changed(evidence=spoil)


def clutter_edges(shape: tuple[int, ...], degree: float, rng: np.random.Generator) -> Bytes:
    """(H, W) an edge map of random lines, blurred and scaled to 0…255 as the real ones are."""
    height, width = shape
    lines = np.zeros(shape)
    while lines.mean() < degree:
        length, turn = rng.uniform(*CLUTTER_LENGTH), rng.uniform(0.0, np.pi)
        along = np.arange(0.0, length, 0.5)
        x = np.floor(rng.uniform(0, width) + along * np.cos(turn)).astype(int)
        y = np.floor(rng.uniform(0, height) + along * np.sin(turn)).astype(int)
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        lines[y[inside], x[inside]] = 1.0
    if degree <= 0.0:
        return np.zeros(shape, np.uint8)
    soft = gaussian_filter(lines, CLUTTER_BLUR)
    # A single line keeps its full height, as in the evidence's own proximity maps.
    ridge = 1.0 / (CLUTTER_BLUR * np.sqrt(2.0 * np.pi))
    height_of: Array = soft / ridge
    return np.round(255.0 * np.minimum(1.0, height_of)).astype(np.uint8)


def calibration_error(degree: float, seed: int) -> Changed:
    """Cameras whose calibration is rotated.

    degree : pixels by which the picture's middle is off, in a separate direction for each camera.
    """

    def spoil(cameras: tuple[Camera, ...]) -> tuple[Camera, ...]:
        return misplaced(cameras, degree, seed)

    return Changed(cameras=spoil)


DAMAGES: dict[str, Callable[[float, int], Changed]] = {
    "none": nothing,
    "mask": mask_damage,
    "clutter": clutter,
    "calibration": calibration_error,
}


EIGHT = "eight-cameras"
FRAMES, QUICK_FRAMES = 90, 30
ALL_TERMS = "edge-region-silhouette"
STANDS_MM, STANDS_LOST = 60.0, 5.0
"""Limits of tolerance: mean error over seeds, mm, and share of frames with a loss, %."""

CANDIDATES = (
    replace(IMPROVED, name="annealed, all terms", weighting=ALL_TERMS),
    IMPROVED,
    EQ13,
    replace(SWARM, name="swarm, all terms", weighting=ALL_TERMS),
    SWARM,
    Candidate("Condensation", "condensation", SWARM.weighting, SWARM.changes),
)


@dataclass(frozen=True, slots=True)
class Question:
    """One heat map. name : of its experiment. degrees : from none to much. damage : of DAMAGES. fields : of an attempt
    for a degree, where evidence is reduced instead of damaged. shown : a degree on the axis.
    """

    name: str
    axis: str
    degrees: tuple[float, ...]
    footage: str = TWIN
    damage: str = "none"
    fields: Callable[[float], dict[str, Any]] = lambda degree: {}
    shown: Callable[[float], str] = "{:g}".format


def fewer_cameras(count: float) -> dict[str, Any]:
    """`count` of the eight cameras, spread as evenly as possible (two neighbours would see the same side)."""
    order = (1, 5, 3, 7, 2, 6, 4, 8)
    return {"cameras": tuple(sorted(f"cam{number}" for number in order[: int(count)]))}


QUESTIONS = (
    Question(
        "robustness-mask-damage",
        "damaged pixels, share of the person's",
        (0.0, 0.1, 0.2, 0.4, 0.8),
        damage="mask",
    ),
    Question(
        "robustness-background-clutter",
        "edge pixels, share of the picture's",
        (0.0, 0.02, 0.05, 0.1, 0.2),
        damage="clutter",
    ),
    Question(
        "robustness-calibration-error",
        "pixels off in the picture's middle",
        (0.0, 2.0, 5.0, 10.0, 20.0),
        damage="calibration",
    ),
    Question(
        "robustness-fewer-cameras",
        "cameras",
        (8.0, 6.0, 4.0, 3.0, 2.0, 1.0),
        footage=EIGHT,
        fields=fewer_cameras,
    ),
    Question(
        "robustness-fewer-frames",
        "frames a second",
        (1.0, 2.0, 3.0, 4.0, 6.0, 10.0),
        # Frames are skipped.
        fields=lambda step: {"every": int(step)},
        shown=lambda step: f"{60.0 / step:g}",
    ),
)


def _trials(question: Question, scale: Scale) -> tuple[Trial, ...]:
    """Every candidate at every degree with every seed."""
    last = QUICK_FRAMES if scale.quick else FRAMES

    def arguments(candidate: Candidate, degree: float, seed: int) -> dict[str, Any]:
        wanted = {"last": last, **question.fields(degree)}
        attempt = candidate.attempt(question.footage, seed, EVALUATIONS, **wanted)
        damaged = degree if question.damage != "none" else 0.0
        return {"attempt": attempt.plain(), "damage": question.damage, "degree": damaged}

    return tuple(
        trial
        for candidate in CANDIDATES
        for degree in question.degrees
        for trial in each_seed(
            f"{candidate.name}, {question.shown(degree)}", scale.seeds, partial(arguments, candidate, degree)
        )
    )


@kept_as("open_questions.robustness.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track the damaged footage; the fields of `Tracked`."""
    attempt = TrackingTrial.of_plain(arguments["attempt"])
    spoilt = DAMAGES[arguments["damage"]](float(arguments["degree"]), attempt.seed)
    return asdict(track(attempt, cache, spoilt=spoilt))


def _shown(question: Question, outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Mean error (mm) and frames with a limb lost (%) of every candidate at every degree; the tolerance of each."""
    runs, columns = by_group(outcomes), tuple(map(question.shown, question.degrees))
    errors: dict[str, list[float]] = {}
    losses: dict[str, list[float]] = {}
    for entry in CANDIDATES:
        cells = [runs[f"{entry.name}, {degree}"] for degree in columns]
        errors[entry.name] = [float(np.mean([run.mean_mm for run in cell])) for cell in cells]
        losses[entry.name] = [
            100.0 * float(np.mean([run.lost_frames / len(run.frames) for run in cell])) for cell in cells
        ]
    pairs = {name: list(zip(errors[name], losses[name], strict=True)) for name in errors}
    stood: list[str] = []
    for name, cells in pairs.items():
        stands = [error <= STANDS_MM and loss <= STANDS_LOST for error, loss in cells]
        count = [*stands, False].index(False)
        stood.append(f"{name} {columns[count - 1] if count else 'not even the first'}")
    yield (
        f"The hardest that each stands, in {question.axis} (a mean of at most {STANDS_MM:.0f} mm and a limb lost in at "
        f"most {STANDS_LOST:.0f} % of the frames): {'; '.join(stood)}."
    )
    rows = tuple(
        (name, *(f"{error:.1f} / {loss:.0f}" for error, loss in cells)) for name, cells in pairs.items()
    )
    title = f"Mean error over seeds (mm) / frames with a limb lost (%), over {question.axis}"
    yield Table(title, ("tracker", *columns), rows)
    for words, values in (("mean error (mm)", errors), ("frames with a limb lost (%)", losses)):
        yield heat_chart(
            f"{TABLE[question.name]['title']}: {words}", question.axis, "tracker", columns, values
        )
    frames = outcomes[0].trial.arguments["attempt"]["last"]
    yield {"footage": question.footage, "frames": frames, "evaluations": EVALUATIONS}


EXPERIMENTS = tuple(
    listed(
        question.name,
        partial(_trials, question),
        measure,
        partial(_shown, question),
        footage=(question.footage,),
    )
    for question in QUESTIONS
)
