"""The knobs of the particle filters; sliders, options, checks and the guide are made from these declarations."""

from dataclasses import dataclass

from studio.foundations.errors import SettingsError
from studio.foundations.knobs import Value, knob, next_frame_knob, with_default
from studio.search.trackers.paper_presets import (
    DEUTSCHER_REID_EQ_13,
    DEUTSCHER_REID_SECTION_6,
    EQ_18_CONSTANT,
    of_the_search,
)
from studio.search.trackers.shared_knobs import (
    BEHAVIOUR,
    GuidedSettings,
    SearchSettings,
    dynamics,
    prediction,
    resampling,
)
from studio.search.trackers.tracker import Preset, Variant


@dataclass(frozen=True, slots=True)
class AnnealedSettings(GuidedSettings):
    """Knobs of the annealed particle filter (Deutscher & Reid 2005, sections 3 and 6)."""

    title = "Annealed particle filter"

    # The paper has 0.5. On the Lee walk's benchmark score and on the bundled walk 0.3 did best (0.2871 against
    # 0.2885 for 0.5, and 28.5 against 30.0 mm over three seeds), with no limb lost.
    survival: float = knob(
        0.3, 0.02, 0.98, 0.01, label="survival rate",
        help="α: share of the particles that survive a layer (Eq. 12); lower is faster and misses more.",
    )  # fmt: skip
    layers: int = next_frame_knob(10, 1, 60, 1, help="M: annealing layers in a frame.")
    particles: int = next_frame_knob(100, 1, 200000, 10, help="N: particles in every layer.")
    crossover: float = knob(
        0.5, 0.0, 1.0, 0.05, label="crossover share",
        help="Share of the particles that are made from two parents (Eq. 19).",
    )  # fmt: skip
    crossover_by: str = knob(
        "limbs", choices=("limbs", "parameters"), label="crossover by",
        help="Where two parents may be cut: between whole limbs, or between any two parameters (Eq. 19).",
    )  # fmt: skip
    adaptive_diffusion: bool = knob(
        True, help="Noise in proportion to what is still uncertain (Eq. 18) instead of a fixed plan (Eq. 13)."
    )
    diffusion_form: str = knob(
        "shrink", choices=("shrink", "paper"), label="adaptive form",
        help="shrink, the studio's own: survivors are drawn towards their mean, so that the cloud never grows; paper: "
        "they only get noise (Eq. 18).",
    )  # fmt: skip
    diffusion_fraction: float = knob(
        0.4, 0.02, 1.0, 0.02, label="adaptive noise",
        help="h: noise as a share of the sample's standard deviation, for the form 'shrink'.",
    )  # fmt: skip
    diffusion_constant: float = knob(
        EQ_18_CONSTANT, 0.001, 2.0, 0.01, label="constant of Eq. 18",
        help="c: P as a multiple of the sample's covariance, for the form 'paper'; 0.1 makes the cloud grow.",
    )  # fmt: skip
    diffusion_covariance: str = knob(
        "diagonal", choices=("diagonal", "full"), label="covariance",
        help="Whether adaptive noise follows each parameter on its own or all of them together, as Eq. 18 prints it.",
    )  # fmt: skip
    diffusion_decay: str = knob(
        "variance", choices=("variance", "deviation", "printed"), label="decay of Eq. 13",
        help="Without adaptive diffusion: what the survival rates of the layers so far multiply, σ0² or σ0; or, as the "
        "product is printed, σ0² by the next layer's rate too.",
    )  # fmt: skip
    survival_per_layer: str = knob(
        "", label="survival of each layer",
        help="Rates of the layers in turn, like 0.6, 0.5, 0.4 (the last holds on); empty: one rate for all.",
    )  # fmt: skip
    carry: str = next_frame_knob(
        "weighted", choices=("weighted", "resampled", "mode"), label="carried over",
        help="Start of the next frame: every particle (Eq. 9), survivors by weight, or the best one.",
    )  # fmt: skip
    dynamics: str = dynamics()
    prediction: str = prediction()
    resampling: str = resampling()

    def __post_init__(self) -> None:
        """Raise SettingsError unless `survival_per_layer` is empty or a list of rates in range."""
        layer_survivals(self, 1)


@dataclass(frozen=True, slots=True)
class CondensationSettings(SearchSettings):
    """Knobs of Condensation, the baseline (Isard & Blake 1996)."""

    title = "Condensation"

    particles: int = next_frame_knob(2000, 1, 200000, 100, help="N: particles, each weighed once.")
    scale_survival: float = knob(
        0.1, 0.05, 0.2, 0.01, label="survival aimed at",
        help="Share of the particles that survive while the first frames choose the likelihood's scale.",
    )  # fmt: skip
    scale_frames: int = next_frame_knob(
        5, 1, 100, 1, label="frames for the scale",
        help="How many weighings choose the likelihood's scale (their geometric mean), which then stays.",
    )  # fmt: skip
    dynamics: str = dynamics()
    resampling: str = resampling()


@dataclass(frozen=True, slots=True)
class BehaviourSettings(GuidedSettings):
    """Knobs of the tracker by behaviour (Caillette, Galata & Howard 2007, sections 3.3, 5.1, 5.2 and 6.3)."""

    title = "Guided by behaviour"

    particles: int = next_frame_knob(
        1000, 2, 200000, 50, help="N: particles, each weighed once (section 7.3)."
    )
    attenuation: float = with_default(GuidedSettings, "attenuation", 0.5)
    model_free_share: float = with_default(GuidedSettings, "model_free_share", 0.1)
    selection: str = knob(
        "survival", choices=("survival", "weights"),
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
    estimate: str = knob(
        "mode", choices=("mode", "mean"),
        help="The pose that is reported: the particle with the highest weight (3.3), or the weighted mean.",
    )  # fmt: skip
    resampling: str = resampling()


@dataclass(frozen=True, slots=True)
class TemperedSettings(SearchSettings):
    """Knobs of tempered sequential Monte Carlo."""

    title = "Tempered sequential Monte Carlo"

    # The annealed filter's later layers take its cloud beyond σ0; a prior's density does not. On five clips of the
    # choosing half 1.5 errs as much as 1 or less (43 -> 32 mm on the kick), with more evidence where motion is fast.
    diffusion_scale: float = with_default(SearchSettings, "diffusion_scale", 1.5)
    layers: int = next_frame_knob(
        16, 2, 1000, 1, help="Layers in a frame: those that climb the ladder, and moves at its end."
    )
    particles: int = next_frame_knob(320, 2, 200000, 10, help="N: particles in every layer.")
    likelihood_scale: float = knob(
        150.0, 0.001, 100000.0, 1.0, label="likelihood's scale",
        help="T: the posterior's exponent of the likelihood, in which each pixel counts as if it erred alone.",
    )  # fmt: skip
    survival: float = knob(
        0.5, 0.02, 0.98, 0.01, label="survival rate",
        help="Share of the particles that stays effective in a layer of the ladder (Eq. 11, 12).",
    )  # fmt: skip
    crossover: float = knob(
        0.1, 0.0, 1.0, 0.05, label="crossover share",
        help="Share of the particles that propose to exchange limbs with another (Eq. 19).",
    )  # fmt: skip
    limb_moves: float = knob(
        0.2, 0.0, 1.0, 0.05, label="steps of one limb",
        help="Share of the other particles that propose a step of one limb instead of the whole body.",
    )  # fmt: skip
    constraints: str = knob(
        "reject", choices=("reject", "ignore"), label="impossible poses",
        help="A pose that the body cannot take has no density, or is kept like any other.",
    )  # fmt: skip
    dynamics: str = dynamics()
    resampling: str = resampling()
    start_repeats: int = with_default(SearchSettings, "start_repeats", 1)


def layer_survivals(settings: AnnealedSettings, layers: int) -> tuple[float, ...]:
    """Target α of each of the frame's layers, in the order they run.

    A list shorter than the frame repeats its last rate. Raises SettingsError for text that is no list of numbers,
    or for a rate outside 0.02 … 0.98.
    """
    words = [word for word in settings.survival_per_layer.replace(",", " ").split() if word]
    if not words:
        return (settings.survival,) * layers
    try:
        rates = [float(word) for word in words]
    except ValueError:
        rates = [float("nan")]
    if not all(0.02 <= rate <= 0.98 for rate in rates):
        raise SettingsError(
            f"Setting 'survival_per_layer' cannot be '{settings.survival_per_layer}'.",
            "Write one rate from 0.02 to 0.98 for each layer, separated by commas, or nothing.",
        )
    return tuple(rates[min(index, len(rates) - 1)] for index in range(layers))


def layer_survival(settings: AnnealedSettings, layer: int) -> float:
    """Target α of a layer, counted in the order they run."""
    return layer_survivals(settings, layer + 1)[layer]


# The improved filter is the tracker's own default.
_IMPROVED: dict[str, Value] = {
    name: getattr(AnnealedSettings(), name)
    for name in (
        *("survival", "adaptive_diffusion", "diffusion_form"),
        *("diffusion_fraction", "crossover", "crossover_by"),
    )
}
PRESETS = (
    Preset(
        "the studio's own",
        "The improved filter, 10 × 100, and each frame refined on its silhouettes.",
        _IMPROVED | {"layers": 10, "particles": 100, "refine_frames": True},
        "annealed",
    ),
    Preset(
        "improved filter",
        "Adaptive diffusion with shrinkage and crossover by limbs, 10 × 200, nothing refined.",
        _IMPROVED | {"layers": 10, "particles": 200, "refine_frames": False},
        "annealed",
    ),
    DEUTSCHER_REID_EQ_13,
    DEUTSCHER_REID_SECTION_6,
    Preset(
        "fast preview",
        "A quarter of the work: 5 × 50.",
        _IMPROVED | {"layers": 5, "particles": 50},
        "annealed",
    ),
    Preset(
        "careful",
        "Six times the work, in more layers: 15 × 400.",
        _IMPROVED | {"layers": 15, "particles": 400},
        "annealed",
    ),
)

SAMPLED = (
    Preset(
        "sampled posterior",
        "The last cloud is a sample of the posterior, and nothing is refined, so that it stays one.",
        {"refine_frames": False},
        "tempered",
    ),
)

GUIDED = Variant(
    "first sets predicted by a behaviour model (Caillette et al.), a fifth of the particles without it",
    {"prediction": BEHAVIOUR},
)
VARIANTS = {
    "improved": Variant(
        "adaptive diffusion with shrinkage (Eq. 18) and crossover by limbs (Eq. 19)",
        {"adaptive_diffusion": True, "diffusion_form": "shrink", "crossover": 0.5, "crossover_by": "limbs"},
    ),
    "eq13": Variant(
        "Eq. 13 as Deutscher & Reid print it: planned noise, no crossover, half of the particles surviving",
        of_the_search(DEUTSCHER_REID_EQ_13),
    ),
    "paper": Variant(
        "Eq. 18 and 19 as Deutscher & Reid print them: full covariance, all crossed, half of the particles surviving",
        of_the_search(DEUTSCHER_REID_SECTION_6),
    ),
    "guided": GUIDED,
}
