"""Ready-made settings, by name. Each is a handful of knobs; the others stay as they are.

A preset is offered where the tracker and weighting in use have every knob that it sets.
"""

from collections.abc import Collection
from dataclasses import dataclass

from studio.tracking.settings import AnnealedSettings
from studio.tracking.swarm_settings import SwarmSettings

Value = bool | int | float | str


@dataclass(frozen=True, slots=True)
class Preset:
    """name : words on screen. help : what it is for, one sentence. values : knobs by flat name."""

    name: str
    help: str
    values: dict[str, Value]


# What makes the improved filter is the tracker's own default.
_IMPROVED: dict[str, Value] = {
    name: getattr(AnnealedSettings(), name)
    for name in (
        "survival",
        "adaptive_diffusion",
        "diffusion_form",
        "diffusion_fraction",
        "crossover",
        "crossover_by",
    )
}

# So are the swarm paper's figures.
_PAPERS_SWARM: dict[str, Value] = {
    name: getattr(SwarmSettings(), name)
    for name in (
        "stage1_particles",
        "stage1_iterations",
        "stage2_particles",
        "stage2_iterations",
        "c_first",
        "c_last",
        "partition",
        "start_velocity",
        "position_divisor",
        "constraints",
        "limbs_apart",
    )
}

PRESETS = (
    Preset(
        "the studio's own",
        "The improved filter, 10 × 100, and each frame refined on its silhouettes.",
        _IMPROVED | {"layers": 10, "particles": 100, "refine_frames": True},
    ),
    Preset(
        "improved filter",
        "Adaptive diffusion with shrinkage and crossover by limbs, 10 × 200, nothing refined.",
        _IMPROVED | {"layers": 10, "particles": 200, "refine_frames": False},
    ),
    Preset(
        "paper, Eq. 13",
        "The annealed filter without its improvements: a fixed plan of noise, no crossover, 10 × 200.",
        {
            "adaptive_diffusion": False,
            "diffusion_decay": "variance",
            "crossover": 0.0,
            "survival": 0.5,
            "layers": 10,
            "particles": 200,
            "refine_frames": False,
        },
    ),
    Preset(
        "paper, Eq. 18 and 19",
        "Adaptive diffusion without shrinkage and crossover by parameters, as the paper writes them.",
        {
            "adaptive_diffusion": True,
            "diffusion_form": "paper",
            "crossover": 0.5,
            "crossover_by": "parameters",
            "survival": 0.5,
            "layers": 10,
            "particles": 200,
            "refine_frames": False,
        },
    ),
    Preset(
        "paper, swarm",
        "The swarm as its paper has it: Table 1, two soft stages, impossible poses drawn again.",
        _PAPERS_SWARM | {"refine_frames": False},
    ),
    Preset("fast preview", "A quarter of the work: 5 × 50.", _IMPROVED | {"layers": 5, "particles": 50}),
    Preset(
        "careful",
        "Six times the work, in more layers: 15 × 400.",
        _IMPROVED | {"layers": 15, "particles": 400},
    ),
)


def offered(knob_names: Collection[str]) -> tuple[Preset, ...]:
    """The presets whose knobs all exist among `knob_names`."""
    return tuple(preset for preset in PRESETS if all(name in knob_names for name in preset.values))
