"""Knobs that several trackers have, declared once."""

from dataclasses import dataclass
from typing import Any

from studio.foundations.knobs import knob, new_run_knob, next_frame_knob

CONSTRAINTS = ("redraw", "reject", "clamp", "ignore")
NOISE, BEHAVIOUR = "noise", "behaviour"
PREDICTIONS = (NOISE, BEHAVIOUR)
LEARNT = "learnt"


def dynamics() -> Any:  # noqa: ANN401 - a dataclass field, as `knob` returns it
    return next_frame_knob(
        "none", choices=("none", "constant_velocity"),
        help="Prediction for the next frame (Eq. 10): the last pose, or the last movement continued.",
    )  # fmt: skip


def prediction() -> Any:  # noqa: ANN401
    return next_frame_knob(
        "noise", choices=PREDICTIONS,
        help="How a frame's first set is made: noise about the last one, or predicted from it by a behaviour model.",
    )  # fmt: skip


def resampling() -> Any:  # noqa: ANN401
    return knob(
        "systematic", choices=("systematic", "multinomial"),
        help="How survivors are drawn: evenly spaced (least noise) or one by one as the paper writes it.",
    )  # fmt: skip


def start_repeats(default: int = 2) -> Any:  # noqa: ANN401
    """The knob `start_repeats`: how often the first frame is searched, each time from where the last search ended."""
    return new_run_knob(
        default, 1, 20, 1, label="searches of the first frame",
        help="Searches of the first frame, each starting where the one before ended.",
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """The knobs of every tracker."""

    diffusion_scale: float = knob(
        1.0, 0.1, 5.0, 0.05, label="diffusion scale",
        help="Multiplies σ0, the largest expected movement from one frame to the next (Eq. 9).",
    )  # fmt: skip
    estimate: str = knob(
        "mean", choices=("mean", "mode"),
        help="The pose that is reported: the particles' weighted mean (Eq. 8) or the best of them (Eq. 2).",
    )  # fmt: skip
    # See `constraints`.
    constraints: str = knob(
        "clamp", choices=CONSTRAINTS, label="impossible poses",
        help="A particle that the body cannot take: drawn again, rejected, set to its limits, or kept.",
    )  # fmt: skip
    limbs_apart: bool = knob(
        False, label="limbs apart",
        help="Whether a pose with one limb inside another counts as impossible, beside the joint limits.",
    )  # fmt: skip
    start_repeats: int = start_repeats()


@dataclass(frozen=True, slots=True)
class GuidedSettings(SearchSettings):
    """The knobs of every tracker that a behaviour model may guide (Caillette, Galata & Howard 2007)."""

    attenuation: float = next_frame_knob(
        0.3, 0.0, 1.0, 0.05,
        help="λ: how much of a motion cluster's own spread is added to a particle that stays in it (behaviour, Eq. 4).",
    )  # fmt: skip
    # See `search.behaviour.prediction.propagate`.
    entering: str = next_frame_knob(
        "resample", choices=("resample", "blend"), label="entering a cluster",
        help="A particle that enters a motion cluster is drawn from it (5.1), or blended with where it was going.",
    )  # fmt: skip
    root_prediction: str = next_frame_knob(
        LEARNT, choices=(LEARNT, NOISE), label="root's prediction",
        help="How position and orientation move beside a model: as they did in the particle's motion cluster when it "
        "was learnt, with noise; or by noise alone (5.2).",
    )  # fmt: skip
    # See `guided_particles.propagated`; what it was chosen by stands in `reproduce caillette-root-spread`.
    root_spread: float = next_frame_knob(
        2.0, 0.1, 5.0, 0.1, label="spread of learnt root motion",
        help="Multiplies the standard deviations of the root's learnt movement in a motion cluster, because other "
        "people move differently than those who were learnt from.",
    )  # fmt: skip
    global_scale: float = next_frame_knob(
        1.0, 0.02, 2.0, 0.02, label="root's noise",
        help="Multiplies σ0 of position and orientation, which no model covers, of particles that a model moves (5.2).",
    )  # fmt: skip
    automaton_share: float = next_frame_knob(
        0.8, 0.0, 1.0, 0.05, label="automaton's share",
        help="Share of the particles that change cluster by the automaton's probabilities alone, without Eq. 3's "
        "density; 0 is the paper's Eq. 3.",
    )  # fmt: skip
    model_free_share: float = next_frame_knob(
        0.2, 0.0, 1.0, 0.05, label="model-free share",
        help="Share of the particles that are spread by σ0 instead of the behaviour model, for motion never learnt.",
    )  # fmt: skip
    model_free_grows: bool = next_frame_knob(
        True, label="model-free share grows",
        help="Whether the model-free share grows while its particles weigh more than those that the model moves.",
    )  # fmt: skip
    online_learning: bool = new_run_knob(
        False, label="online learning",
        help="Whether the run adds its well tracked frames to its behaviour model at regular intervals.",
    )  # fmt: skip
    # The true pose's silhouettes overlap with the masks by 0.87 on both test dances; with joints off by 10 degrees
    # (limbs by 16) by 0.76, by 20 degrees (limbs by 33) by 0.68.
    learning_overlap: float = new_run_knob(
        0.75, 0.0, 1.0, 0.01, label="overlap to learn",
        help="Least overlap of the pose's silhouettes with the masks (f_s) of a frame that online learning uses; 0 "
        "takes all that are well tracked beside the rest of their run.",
    )  # fmt: skip
    learning_interval: int = new_run_knob(
        60, 10, 2000, 10, label="frames between lessons",
        help="Frames between two updates of the model from the poses tracked so far (online learning).",
    )  # fmt: skip
