"""Knobs that several trackers have, declared once."""

from typing import Any

from studio.knobs import knob, next_frame_knob

CONSTRAINTS = ("redraw", "reject", "clamp", "ignore")
NOISE, BEHAVIOUR = "noise", "behaviour"
PREDICTIONS = (NOISE, BEHAVIOUR)
LEARNT = "learnt"


def diffusion_scale(default: float = 1.0) -> Any:  # noqa: ANN401 - a dataclass field, as `knob` returns it
    return knob(
        default, 0.1, 5.0, 0.05, label="diffusion scale", takes_effect="next layer",
        help="Multiplies σ0, the largest expected movement from one frame to the next (Eq. 9).",
    )  # fmt: skip


def dynamics() -> Any:  # noqa: ANN401
    return next_frame_knob(
        "none", choices=("none", "constant_velocity"),
        help="Prediction for the next frame (Eq. 10): the last pose, or the last movement continued.",
    )  # fmt: skip


def estimate() -> Any:  # noqa: ANN401
    return knob(
        "mean", choices=("mean", "mode"), takes_effect="next layer",
        help="The pose that is reported: the particles' weighted mean (Eq. 8) or the best of them (Eq. 2).",
    )  # fmt: skip


def constraints(default: str) -> Any:  # noqa: ANN401
    """How impossible poses are handled (`hard_priors`)."""
    return knob(
        default, choices=CONSTRAINTS, label="impossible poses", takes_effect="next layer",
        help="A particle that the body cannot take: drawn again, rejected, set to its limits, or kept.",
    )  # fmt: skip


def limbs_apart(default: bool) -> Any:  # noqa: ANN401
    return knob(
        default, label="limbs apart", takes_effect="next layer",
        help="Whether a pose with one limb inside another counts as impossible, beside the joint limits.",
    )  # fmt: skip


def resampling() -> Any:  # noqa: ANN401
    return knob(
        "systematic", choices=("systematic", "multinomial"), takes_effect="next layer",
        help="How survivors are drawn: evenly spaced (least noise) or one by one as the paper writes it.",
    )  # fmt: skip


def start_repeats(default: int = 2) -> Any:  # noqa: ANN401
    return knob(
        default, 1, 20, 1, label="searches of the first frame", takes_effect="new run",
        help="Searches of the first frame, each starting where the one before ended.",
    )  # fmt: skip


def prediction() -> Any:  # noqa: ANN401
    """Whether a frame's first set is made by noise or by a behaviour model."""
    return next_frame_knob(
        "noise", choices=PREDICTIONS,
        help="How a frame's first set is made: noise about the last one, or predicted from it by a behaviour model.",
    )  # fmt: skip


def attenuation(default: float) -> Any:  # noqa: ANN401
    """λ of Caillette et al. 2007, Eq. 4."""
    return next_frame_knob(
        default, 0.0, 1.0, 0.05,
        help="λ: how much of a motion cluster's own spread is added to a particle that stays in it (behaviour, Eq. 4).",
    )  # fmt: skip


def entering() -> Any:  # noqa: ANN401
    """How a particle enters another cluster (`behaviour.prediction.propagate`)."""
    return next_frame_knob(
        "resample", choices=("resample", "blend"), label="entering a cluster",
        help="A particle that enters a motion cluster is drawn from it (5.1), or blended with where it was going.",
    )  # fmt: skip


def global_scale(default: float) -> Any:  # noqa: ANN401
    return next_frame_knob(
        default, 0.02, 2.0, 0.02, label="root's noise",
        help="Multiplies σ0 of position and orientation, which no model covers, of particles that a model moves (5.2).",
    )  # fmt: skip


def root_prediction() -> Any:  # noqa: ANN401
    return next_frame_knob(
        LEARNT, choices=(LEARNT, NOISE), label="root's prediction",
        help="How position and orientation move beside a model: as they did in the particle's motion cluster when it "
        "was learnt, with noise; or by noise alone (5.2).",
    )  # fmt: skip


def root_spread() -> Any:  # noqa: ANN401
    """See `guided_particles.propagated`; what it was chosen by stands in `reproduce caillette-root-spread`."""
    return next_frame_knob(
        2.0, 0.1, 5.0, 0.1, label="spread of learnt root motion",
        help="Multiplies the standard deviations of the root's learnt movement in a motion cluster, because other "
        "people move differently than those who were learnt from.",
    )  # fmt: skip


def automaton_share() -> Any:  # noqa: ANN401
    """See `behaviour.prediction`."""
    return next_frame_knob(
        0.8, 0.0, 1.0, 0.05, label="automaton's share",
        help="Share of the particles that change cluster by the automaton's probabilities alone, without Eq. 3's "
        "density; 0 is the paper's Eq. 3.",
    )  # fmt: skip


def model_free_share(default: float) -> Any:  # noqa: ANN401
    return next_frame_knob(
        default, 0.0, 1.0, 0.05, label="model-free share",
        help="Share of the particles that are spread by σ0 instead of the behaviour model, for motion never learnt.",
    )  # fmt: skip


def model_free_grows() -> Any:  # noqa: ANN401
    return next_frame_knob(
        True, label="model-free share grows",
        help="Whether the model-free share grows while its particles weigh more than those that the model moves.",
    )  # fmt: skip


def online_learning() -> Any:  # noqa: ANN401
    return knob(
        False, label="online learning", takes_effect="new run",
        help="Whether the run adds its well tracked frames to its behaviour model at regular intervals.",
    )  # fmt: skip


def learning_overlap() -> Any:  # noqa: ANN401
    # The true pose's silhouettes overlap with the masks by 0.87 on both test dances; with joints off by 10 degrees
    # (limbs by 16) by 0.76, by 20 degrees (limbs by 33) by 0.68.
    return knob(
        0.75, 0.0, 1.0, 0.01, label="overlap to learn", takes_effect="new run",
        help="Least overlap of the pose's silhouettes with the masks (f_s) of a frame that online learning uses; 0 "
        "takes all that are well tracked beside the rest of their run.",
    )  # fmt: skip


def learning_interval() -> Any:  # noqa: ANN401
    return knob(
        60, 10, 2000, 10, label="frames between lessons", takes_effect="new run",
        help="Frames between two updates of the model from the poses tracked so far (online learning).",
    )  # fmt: skip
