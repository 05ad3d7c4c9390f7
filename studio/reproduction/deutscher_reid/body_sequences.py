"""How many particles a whole body needs over 40 frames: the person who walks in a circle before three cameras, with
the paper's body of 29 parameters.

The paper does not say on which footage its factor of 4 was seen (6.3). Every seed tracks another 40 frames, from a
pose laid on the true markers; success is that of `setting`: every frame below 100 mm, no limb lost.
"""

from collections.abc import Mapping
from typing import Any

from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.tracked import Attempt, track
from studio.comparison.trials import Scale, Trial, kept_as
from studio.reproduction.deutscher_reid.fewest_particles import fewest, sizes
from studio.reproduction.deutscher_reid.setting import CIRCLE, WEIGHTING, succeeded

FRAMES, FOOTAGE_FRAMES = 40, 240
# From one seed's first frame to the next one's; no multiple of a stride, so that each begins with another posture.
STRIDE, QUICK_STRIDE = 37, 4
FEWEST, MOST, RUNS = 4, 2048, 3
QUICK_MOST = 1024


def first_frame(seed: int, quick: bool = False) -> int:
    """Where a seed's frames begin; close together for a quick look, so that little has to be rendered."""
    return (seed * (QUICK_STRIDE if quick else STRIDE)) % (FOOTAGE_FRAMES - FRAMES)


def trials(
    scale: Scale, filters: Mapping[str, Mapping[str, Any]], footage: str = CIRCLE
) -> tuple[Trial, ...]:
    """One bisection a filter and seed. filters : knobs by the filter's name."""
    grid = sizes(FEWEST, QUICK_MOST if scale.quick else MOST, 1 if scale.quick else 2)
    return tuple(
        Trial(
            f"{name}, seed {seed}",
            {
                "footage": footage,
                "knobs": dict(knobs),
                "seed": seed,
                "first": first_frame(seed, scale.quick),
                "last": first_frame(seed, scale.quick) + FRAMES,
                "sizes": list(grid),
                "runs": 1 if scale.quick else RUNS,
            },
        )
        for name, knobs in filters.items()
        for seed in scale.seeds
    )


@kept_as("deutscher_reid.body_sequences.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """The fewest particles for one seed."""

    def succeeds(particles: int, run: int) -> bool:
        attempt = Attempt(
            arguments["footage"],
            "annealed",
            WEIGHTING,
            1000 * int(arguments["seed"]) + run,
            {**arguments["knobs"], "particles": particles},
            first=int(arguments["first"]),
            last=int(arguments["last"]),
        )
        return succeeded(track(attempt, shelf))

    return fewest(succeeds, arguments["sizes"], arguments["runs"]).plain()
