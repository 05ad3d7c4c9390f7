"""Knobs that several trackers have, declared once."""

from typing import Any

from studio.knobs import knob

CONSTRAINTS = ("redraw", "reject", "clamp", "ignore")


def diffusion_scale(default: float = 1.0) -> Any:  # noqa: ANN401 - a dataclass field, as `knob` returns it
    """Multiplies σ0."""
    return knob(
        default, 0.1, 5.0, 0.05, label="diffusion scale", takes_effect="next layer",
        help="Multiplies σ0, the largest expected movement from one frame to the next (Eq. 9).",
    )  # fmt: skip


def dynamics() -> Any:  # noqa: ANN401
    """What a frame expects."""
    return knob(
        "none", choices=("none", "constant_velocity"), takes_effect="next frame",
        help="What a frame expects before it looks (Eq. 10): the last pose, or the last movement going on.",
    )  # fmt: skip


def estimate() -> Any:  # noqa: ANN401
    """The reported pose of a filter."""
    return knob(
        "mean", choices=("mean", "mode"), takes_effect="next layer",
        help="The pose that is reported: the particles' weighted mean (Eq. 8) or the best of them (Eq. 2).",
    )  # fmt: skip


def constraints(default: str) -> Any:  # noqa: ANN401
    """What becomes of a pose that the body cannot take (`hard_priors`)."""
    return knob(
        default, choices=CONSTRAINTS, label="impossible poses", takes_effect="next layer",
        help="A particle that the body cannot take: drawn again, weighs nothing, set on its limits, or let be.",
    )  # fmt: skip


def limbs_apart(default: bool) -> Any:  # noqa: ANN401
    """Whether limbs may be inside one another."""
    return knob(
        default, label="limbs apart", takes_effect="next layer",
        help="Whether a pose with one limb inside another counts as impossible, beside the joint limits.",
    )  # fmt: skip


def resampling() -> Any:  # noqa: ANN401
    """How survivors are drawn."""
    return knob(
        "systematic", choices=("systematic", "multinomial"), takes_effect="next layer",
        help="How survivors are drawn: evenly spaced (least noise) or one by one as the paper writes it.",
    )  # fmt: skip


def start_repeats(default: int = 2) -> Any:  # noqa: ANN401
    """Searches of a run's first frame."""
    return knob(
        default, 1, 20, 1, label="searches of the first frame", takes_effect="new run",
        help="How often the first frame is searched over, each search starting where the one before ended.",
    )  # fmt: skip
