"""How many poses a tracker weighs in a frame, and knobs that make it weigh about a wanted number.

Evaluations are what trackers are compared by: they cost nearly all of a frame's time (Fleischmann et al. 2012,
section 3).
"""

from typing import Any

from studio.errors import NotFoundError, SettingsError
from studio.knobs import changed
from studio.tracking import partitions
from studio.tracking.catalogue import TRACKERS

# Table 1: 10 particles × 20 iterations, then 20 × 40.
STAGE1_ITERATIONS, STAGE2_ITERATIONS = 20, 40
# A particle alone has nobody to learn from.
SMALLEST_SWARM = 2
ONE_LAYER = ("condensation", "behaviour")


def knobs_for_evaluations(tracker: str, evaluations: int, layers: int = 10) -> dict[str, int]:
    """Knobs by flat name with which a tracker weighs about `evaluations` poses a frame.

    annealed: `layers` layers of evaluations / layers particles. condensation, behaviour: all particles in the
    one layer. swarm: Table 1 of Fleischmann et al. 2012 in proportion. The paper prints the table for 1000 evaluations
    only; our choice is that the iterations stay and the particles of both stages scale (n2 = 2 n1 as nearly as
    the total allows), so that every total that is a multiple of 20 is met exactly. Raises SettingsError where
    the number is too small or too large, NotFoundError for an unknown tracker.
    """
    if tracker == "annealed":
        knobs = {"layers": layers, "particles": round(evaluations / max(layers, 1))}
    elif tracker in ONE_LAYER:
        knobs = {"particles": evaluations}
    elif tracker == "swarm":
        knobs = _swarm_knobs(evaluations)
    else:
        raise NotFoundError(f"There is no tracker '{tracker}'.", f"Known: {', '.join(sorted(TRACKERS))}.")
    smallest = {"annealed": 2 * layers, "swarm": _smallest_swarm()}.get(tracker, 2)
    if evaluations < smallest:
        raise SettingsError(
            f"{evaluations} evaluations a frame are too few for the tracker '{tracker}'.",
            f"Give it {smallest} or more.",
        )
    changed(TRACKERS[tracker].settings_type(), knobs)
    return knobs


def evaluations_of(tracker: str, settings: Any) -> int:  # noqa: ANN401 - any tracker's own settings
    """Poses that a tracker weighs in a frame (of the first frame: in each of its searches)."""
    if tracker == "annealed":
        return settings.layers * settings.particles
    if tracker in ONE_LAYER:
        return settings.particles
    if tracker == "swarm":
        return partitions.evaluations(settings)
    raise NotFoundError(f"There is no tracker '{tracker}'.", f"Known: {', '.join(sorted(TRACKERS))}.")


def _swarm_knobs(evaluations: int) -> dict[str, int]:
    """n1 and n2 with 20 n1 + 40 n2 as close to the total as can be, n2 as close to 2 n1 as can be."""
    twenties = round(evaluations / STAGE1_ITERATIONS)
    first = max(round(twenties / 5), SMALLEST_SWARM)
    # What is left over must be divisible by two, as the second stage has twice the iterations.
    first += (twenties - first) % 2
    second = (twenties - first) // 2
    return {
        "stage1_particles": first,
        "stage1_iterations": STAGE1_ITERATIONS,
        "stage2_particles": second,
        "stage2_iterations": STAGE2_ITERATIONS,
    }


def _smallest_swarm() -> int:
    return SMALLEST_SWARM * (STAGE1_ITERATIONS + STAGE2_ITERATIONS)
