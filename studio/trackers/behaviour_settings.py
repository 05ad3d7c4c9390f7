"""The knobs of the tracker that is guided by a behaviour model (Caillette, Galata & Howard 2007)."""

from dataclasses import dataclass

from studio.knobs import knob, next_frame_knob
from studio.trackers import shared_knobs


@dataclass(frozen=True, slots=True)
class BehaviourSettings:
    """Knobs of the tracker by behaviour (sections 3.3, 5.1, 5.2 and 6.3; what is beyond the paper is marked)."""

    title = "Guided by behaviour"

    particles: int = next_frame_knob(
        1000, 2, 200000, 50, help="N: particles, each weighed once (section 7.3)."
    )
    attenuation: float = shared_knobs.attenuation(0.5)
    entering: str = shared_knobs.entering()
    model_free_share: float = shared_knobs.model_free_share(0.1)
    model_free_grows: bool = shared_knobs.model_free_grows()
    selection: str = knob(
        "survival", choices=("survival", "weights"), takes_effect="next layer",
        help="How peaked the weights are: so that a chosen share survives, or as the likelihood gives them (3.3).",
    )  # fmt: skip
    survival: float = knob(
        0.4, 0.005, 0.98, 0.005, label="survival rate",
        help="Share of the particles that survive a frame, where the selection is by survival.",
    )  # fmt: skip
    expected_support: float = next_frame_knob(
        0.05, 0.0, 0.5, 0.01, label="support of a cluster",
        help="Least share of the particles in a motion cluster whose mean the blobs are fitted from (6.3).",
    )  # fmt: skip
    expected_most: int = next_frame_knob(
        4, 1, 20, 1, label="clusters fitted",
        help="From how many clusters' means the blobs are fitted at most (6.3).",
    )  # fmt: skip
    diffusion_scale: float = shared_knobs.diffusion_scale()
    root_prediction: str = shared_knobs.root_prediction()
    root_spread: float = shared_knobs.root_spread()
    global_scale: float = shared_knobs.global_scale(1.0)
    automaton_share: float = shared_knobs.automaton_share()
    estimate: str = knob(
        "mode", choices=("mode", "mean"), takes_effect="next layer",
        help="The pose that is reported: the particle with the highest weight (3.3), or the weighted mean.",
    )  # fmt: skip
    constraints: str = shared_knobs.constraints("clamp")
    limbs_apart: bool = shared_knobs.limbs_apart(False)
    resampling: str = shared_knobs.resampling()
    online_learning: bool = shared_knobs.online_learning()
    learning_overlap: float = shared_knobs.learning_overlap()
    learning_interval: int = shared_knobs.learning_interval()
    start_repeats: int = shared_knobs.start_repeats()
