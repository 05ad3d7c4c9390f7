"""Common parts of the experiments of Caillette, Galata & Howard (2007): footage, training, candidates.

Footage: two exercises of real modern dance, performed again by a rendered person of another build (`dance-test-1`,
`dance-test-2`), seen by five cameras of 320 × 240 at 30 Hz as in the paper, and a clip that is in no training
(`dance-unseen`). Training: the exercises as recorded and two more performances of each, each smoothed five times.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from studio.garden.reproduction.caillette.training_set import Training
from studio.garden.reproduction.tracking import Candidate
from studio.results.drawing_footage.recipe_file import find_recipe, read_recipe
from studio.search.trackers.paper_presets import CAILLETTE, NOTHING_ELSE, SIZE

BLOBS = "blobs"
BODY = "human25"
FPS = 30

TEST, TEST_2, UNSEEN = "dance-test-1", "dance-test-2", "dance-unseen"
TEST_640 = "dance-test-1-640"
EXERCISE, EXERCISE_2 = "dance-exercise-1", "dance-exercise-2"
QUICK_FRAMES = 70

MEMORY = 20
"""Memory of the tracking model (Figs. 9 to 11); the paper does not give that of Fig. 12."""
BOTH = Training((EXERCISE, EXERCISE_2))
QUICK_TRAINING = Training((EXERCISE,))

# The dancer turns by 12 degrees a frame and more (360 degrees a second), where the body's σ0 is 6.7: trackers without a
# model get twice that. Measured with 1 to 4 times: less loses them in the first turn, more makes all less accurate.
SIGMA: Mapping[str, Any] = {"diffusion_scale": 2.0}
# As in the paper: no particle is moved without the model, and the best particle is the pose.
AS_PAPER: Mapping[str, Any] = {"model_free_share": 0.0, "model_free_grows": False, "estimate": "mode"}
# The paper's tracker as printed, as the preset has it; its recovery is `following.Recovering`.
AS_PRINTED: Mapping[str, Any] = {
    name: value
    for name, value in CAILLETTE.values.items()
    if name not in (*NOTHING_ELSE, *SIZE, "lost_after", "recovery_interval")
}
LEARNT_AS_PRINTED: Mapping[str, Any] = {
    name: value for entry in CAILLETTE.learning for name, value in entry.sets.items() if name != "memory"
}
"""What the preset says of learning; the memory is each experiment's own."""
LOST_BELOW: Mapping[str, float] = {"fitted": -0.12, "placed": 2.14}
"""Nats a voxel below a body like the blobs at which a frame is lost in the figures, by fitted and by placed blobs: what
`caillette-loss-test` chooses on clips that no figure shows. The fitted ones are mostly likelier than such a body.
"""
GUIDED = "behaviour"
# The annealing of the paper's time: planned noise (Eq. 13 of Deutscher & Reid), half surviving, no crossover.
PLANNED: Mapping[str, Any] = {"adaptive_diffusion": False, "crossover": 0.0, "survival": 0.5}

CONDENSATION = Candidate("Condensation, 5000", "condensation", BLOBS, {"particles": 5000, **SIGMA})
ANNEALED = Candidate(
    "annealed, 5 × 1000", "annealed", BLOBS, {"layers": 5, "particles": 1000, **PLANNED, **SIGMA}
)
IMPROVED = Candidate(
    "annealed, improved, 5 × 1000", "annealed", BLOBS, {"layers": 5, "particles": 1000, **SIGMA}
)


@dataclass(frozen=True, slots=True)
class Learner(Candidate):
    """A tracker that a behaviour model guides. learning : knobs that its model is learnt with, beside the usual."""

    learning: Mapping[str, Any] = field(default_factory=dict[str, Any])


def guided(particles: int, name: str = "", **changes: Any) -> Learner:  # noqa: ANN401 - knobs
    """The studio's tracker on the paper's ground, with some number of particles. changes : further knobs.

    It is not the printed one: most particles change cluster by the automaton alone, the root moves as it did in
    training, survivors are drawn so that a share of 0.4 survives, histories back off to shorter ones, and clusters have
    a floor.
    """
    words = name or f"guided, {particles}"
    return Learner(words, GUIDED, BLOBS, {"particles": particles, **AS_PAPER, **changes})


def printed(
    particles: int,
    name: str = "",
    learning: Mapping[str, Any] = LEARNT_AS_PRINTED,
    **changes: Any,  # noqa: ANN401
) -> Learner:
    """The paper's tracker as it is printed, with some number of particles. changes, learning : what is not."""
    words = name or f"printed, {particles}"
    return Learner(words, GUIDED, BLOBS, {"particles": particles, **AS_PRINTED, **changes}, learning)


def last_frame(footage: str, quick: bool, most: int | None = None) -> int:
    """The end of the tracked part of a footage. most : frames, where not all are needed. Raises StudioError."""
    whole = read_recipe(find_recipe(footage)).frames
    return min(whole, QUICK_FRAMES if quick else most or whole)


def training(quick: bool) -> Training:
    """The training set: both exercises; the first alone for a preview."""
    return QUICK_TRAINING if quick else BOTH


NOTHING: Mapping[str, Any] = {}


def training_with(memory: int, quick: bool, learning: Mapping[str, Any] = NOTHING) -> Training:
    """The training set, for an automaton with a memory. learning : further knobs of learning."""
    usual = training(quick)
    clusters = {name: value for name, value in learning.items() if name != "epsilon"}
    return dataclasses.replace(
        usual, memory=memory, epsilon=learning.get("epsilon", usual.epsilon), clusters=clusters
    )


def training_for(candidate: Candidate, memory: int, quick: bool) -> Training | None:
    """The training set of a candidate's model, None where none guides it."""
    if candidate.tracker != GUIDED and "prediction" not in candidate.changes:
        return None
    return training_with(memory, quick, candidate.learning if isinstance(candidate, Learner) else NOTHING)


def training_words(quick: bool) -> str:
    """The training set as text, for the settings of the findings."""
    return "the first exercise alone" if quick else "both exercises, three performances each"
