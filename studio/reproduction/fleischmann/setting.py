"""What all experiments of Fleischmann et al. (2012), section 3, have in common.

The footage is the Lee-walk twin: the real dataset is not complete here, so a walk is rendered for its cameras with
a person of its subject's dimensions who is not the tracker's model. Frames 330 to 430 stand still, as in the paper.
At 20 frames a second the twin is rendered anew; σ0 is three times as large (after Eq. 1).

The tracker's body has the subject's dimensions and, unlike the paper's ten cones, hands and feet, for without them
forearms and shins slide over hands and feet (Table 2 shows what that costs).
"""

from studio.reproduction.tracking import Contender

SOURCE = "Fleischmann, Austvoll & Kwolek 2012"
TWIN, TWIN_20 = "lee-walk-twin", "lee-walk-twin-20hz"
FRAMES = 450
QUICK_FRAMES = 90
TEN_CONES = "subject_shape.toml"
"""The subject without hands and feet, beside the twin's own."""
STANDING = (330.0, 430.0, "standing still")
EVALUATIONS = 1000
FITNESS = "edge-silhouette"
RATES = {60: TWIN, 20: TWIN_20}

# The hard priors of section 2.3, for every tracker that is compared.
PRIORS = {"constraints": "redraw", "limbs_apart": True}

SWARM = Contender("swarm", "swarm", FITNESS, PRIORS)
# The filter of the paper's Fig. 6 is HumanEva's: noise planned by the survival rate, no crossover (Eq. 13).
EQ13 = Contender(
    "annealed, Eq. 13",
    "annealed",
    FITNESS,
    {**PRIORS, "adaptive_diffusion": False, "crossover": 0.0, "survival": 0.5},
)
IMPROVED = Contender("annealed, improved", "annealed", FITNESS, PRIORS)


def last_frame(fps: int, quick: bool) -> int:
    """The end of the footage that is tracked, in frames of its own rate."""
    return (QUICK_FRAMES if quick else FRAMES) * fps // 60
