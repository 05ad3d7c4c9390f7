"""The views by name: what each answers, what of the selection it uses, and its tables."""

from dataclasses import dataclass

from studio.errors import NotFoundError
from studio.inspection.tables import Column, TableKind

FRAME, LAYER = Column("frame", "Frame"), Column("layer", "Layer")
PARAMETER, LIMB, UNIT = Column("parameter", "Parameter"), Column("limb", "Limb"), Column("unit", "Unit")
PARTICLE, CAMERA, TERM = Column("particle", "Particle"), Column("camera", "Camera"), Column("term", "Term")
LOG_WEIGHT = Column("log_weight", "Log weight", "nats")


def _columns(*entries: Column | tuple[str, ...]) -> tuple[Column, ...]:
    return tuple(entry if isinstance(entry, Column) else Column(*entry) for entry in entries)


@dataclass(frozen=True, slots=True)
class View:
    """One way of looking into a run. question : what it answers. uses : entries of the selection that it reads.

    tables : those of a frame and, `of_run`, those of the whole run. evaluates : it evaluates the likelihood again.
    is_job : its numbers are computed by a job (verb `seeds`); until one has ended its tables are empty.
    """

    name: str
    title: str
    question: str
    uses: tuple[str, ...]
    tables: tuple[TableKind, ...]
    evaluates: bool = False
    is_job: bool = False

    @property
    def frame_tables(self) -> tuple[TableKind, ...]:
        """The tables of one frame."""
        return tuple(kind for kind in self.tables if not kind.of_run)

    @property
    def run_tables(self) -> tuple[TableKind, ...]:
        """The tables of the whole run."""
        return tuple(kind for kind in self.tables if kind.of_run)


_ALL = (
    View(
        "variance",
        "Variance reduction",
        "Which parameter did which layer settle?",
        ("parameter",),
        (
            TableKind(
                "layers",
                "Variance of every parameter in every layer",
                _columns(
                    PARAMETER,
                    LIMB,
                    UNIT,
                    LAYER,
                    ("weighed", "As weighed"),
                    ("before", "Before noise"),
                    ("after", "After noise"),
                ),
            ),
            TableKind(
                "settled",
                "Layer that settled each parameter",
                _columns(
                    PARAMETER,
                    LIMB,
                    UNIT,
                    LAYER,
                    ("first", "First variance"),
                    ("last", "Last variance"),
                    ("reduction", "First / last"),
                ),
            ),
            TableKind(
                "first", "Variance of the first set, by frame", _columns(FRAME), of_run=True, each="parameter"
            ),
            TableKind(
                "last", "Variance of the last set, by frame", _columns(FRAME), of_run=True, each="parameter"
            ),
            TableKind(
                "parameter",
                "One parameter by layer and frame",
                _columns(
                    FRAME,
                    LAYER,
                    ("weighed", "As weighed"),
                    ("before", "Before noise"),
                    ("after", "After noise"),
                ),
                of_run=True,
            ),
        ),
    ),
    View(
        "schedule",
        "Schedule",
        "Did annealing proceed as asked?",
        ("layer",),
        (
            TableKind(
                "layers",
                "Exponent and survival of every layer",
                _columns(
                    LAYER,
                    ("beta", "β"),
                    ("alpha_wanted", "α wanted"),
                    ("alpha_reached", "α reached"),
                    ("effective", "Effective number"),
                    ("particles", "Particles"),
                    ("largest", "Largest weight"),
                    ("best_log_weight", "Best log weight", "nats"),
                    ("milliseconds", "Time", "ms"),
                    ("settings_version", "Settings version"),
                    ("alarm", "Alarm"),
                ),
            ),
            TableKind(
                "frames",
                "Schedule by frame",
                _columns(
                    FRAME,
                    ("beta_first", "β of the first layer"),
                    ("beta_last", "β of the last layer"),
                    ("least_alpha", "Least α reached"),
                    ("least_effective", "Least effective number"),
                    ("alarms", "Layers with an alarm"),
                ),
                of_run=True,
            ),
        ),
    ),
    View(
        "genealogy",
        "Genealogy",
        "Which ancestors survive?",
        ("layer", "particle"),
        (
            TableKind(
                "particles",
                "Particles and their parents",
                _columns(
                    LAYER,
                    PARTICLE,
                    ("parent", "Parent"),
                    ("second_parent", "Second parent"),
                    ("ancestor", "First ancestor"),
                    ("children", "Children"),
                    ("survives", "Has descendants in the last layer"),
                    LOG_WEIGHT,
                    ("weight", "Weight"),
                ),
            ),
            TableKind(
                "ancestors",
                "Distinct ancestors by layer",
                _columns(
                    LAYER,
                    ("particles", "Particles"),
                    ("ancestors", "Distinct ancestors in the first set"),
                    ("with_descendants", "Particles with descendants in the last set"),
                    ("crossed", "Children of two"),
                ),
            ),
        ),
    ),
    View(
        "weights",
        "Weight concentration",
        "Is the estimate one lucky particle?",
        ("layer",),
        (
            TableKind(
                "sorted",
                "Weights of a layer, largest first",
                _columns(
                    LAYER,
                    ("rank", "Rank"),
                    PARTICLE,
                    ("weight", "Weight"),
                    ("cumulated", "Cumulated"),
                    LOG_WEIGHT,
                ),
            ),
            TableKind(
                "layers",
                "Concentration by layer",
                _columns(
                    LAYER,
                    ("largest", "Largest weight"),
                    ("k_hat", "Pareto k̂"),
                    ("effective", "Effective number"),
                    ("particles", "Particles"),
                    ("for_90", "Particles that hold 90 %"),
                ),
            ),
        ),
    ),
    View(
        "clouds",
        "First and last cloud",
        "What did the frame learn?",
        ("parameter", "limb", "track"),
        (
            TableKind(
                "summary",
                "Clouds by parameter and layer",
                _columns(
                    PARAMETER,
                    LIMB,
                    UNIT,
                    LAYER,
                    ("weighted", "Weighted (else as drawn)"),
                    ("mean", "Mean"),
                    ("deviation", "Deviation"),
                    ("q05", "5 %"),
                    ("q25", "25 %"),
                    ("median", "Median"),
                    ("q75", "75 %"),
                    ("q95", "95 %"),
                ),
            ),
            TableKind(
                "ridges",
                "Densities by parameter and layer",
                _columns(
                    PARAMETER,
                    LAYER,
                    ("weighted", "Weighted (else as drawn)"),
                    ("value", "Value"),
                    ("density", "Density"),
                ),
            ),
            TableKind(
                "marks",
                "Limits, estimate and truth",
                _columns(
                    PARAMETER,
                    LIMB,
                    UNIT,
                    ("lower", "Lower limit"),
                    ("upper", "Upper limit"),
                    ("estimate", "Estimate"),
                    ("truth", "Truth"),
                ),
            ),
        ),
    ),
    View(
        "coupling",
        "Coupling",
        "Which parameters trade off?",
        ("layer", "parameter"),
        (
            TableKind(
                "matrix",
                "Correlations, in the order of settling",
                _columns(
                    ("first", "Parameter"), ("second", "Other parameter"), ("correlation", "Correlation")
                ),
            ),
            TableKind(
                "order",
                "Order of settling",
                _columns(
                    ("place", "Place"), PARAMETER, LIMB, UNIT, LAYER, ("deviation", "Deviation in this layer")
                ),
            ),
            TableKind(
                "particles",
                "Particles of the layer",
                _columns(PARTICLE, ("weight", "Weight")),
                each="parameter",
            ),
        ),
    ),
    View(
        "survivors",
        "Survivors and dead",
        "What did the dead have wrong?",
        ("layer",),
        (
            TableKind(
                "particles",
                "Particles of the layer",
                _columns(
                    PARTICLE,
                    ("rank", "Rank"),
                    LOG_WEIGHT,
                    ("weight", "Weight"),
                    ("children", "Children"),
                    ("survives", "Survives"),
                ),
                each="parameter",
            ),
            TableKind(
                "difference",
                "Survivors against dead",
                _columns(
                    PARAMETER,
                    LIMB,
                    UNIT,
                    ("survivors", "Mean of the survivors"),
                    ("dead", "Mean of the dead"),
                    ("difference", "Difference in deviations"),
                    ("p_value", "Kolmogorov-Smirnov p"),
                ),
            ),
        ),
    ),
    View(
        "landscape",
        "Landscape",
        "What does the likelihood look like here?",
        ("layer", "parameter", "second", "towards", "particle", "track"),
        (
            TableKind(
                "slice",
                "Log weight along the line",
                _columns(("at", "Place"), UNIT, LOG_WEIGHT, ("possible", "Within the limits")),
            ),
            TableKind(
                "terms",
                "Terms along the line",
                _columns(("at", "Place"), CAMERA, TERM, ("value", "Log-likelihood", "nats")),
            ),
            TableKind(
                "tempered",
                "Density at each layer's β",
                _columns(LAYER, ("beta", "β"), ("at", "Place"), ("density", "Density")),
            ),
            TableKind(
                "plane",
                "Log weight over two parameters",
                _columns(("at", "Place"), ("second", "Second parameter"), LOG_WEIGHT),
            ),
            TableKind(
                "rug",
                "Particles on the line",
                _columns(LAYER, PARTICLE, ("at", "Place"), ("second", "Second parameter"), LOG_WEIGHT),
            ),
            TableKind(
                "marks",
                "Estimate, truth and best particle",
                _columns(("name", "Name"), ("at", "Place"), ("second", "Second parameter"), LOG_WEIGHT),
            ),
            TableKind(
                "ends",
                "Poses at the line's ends (place 0 and 1, or the first and last value)",
                _columns(PARAMETER, UNIT, ("from", "First"), ("to", "Last")),
            ),
        ),
        evaluates=True,
    ),
    View(
        "blame",
        "Blame",
        "Which camera and term pulls where?",
        ("limb", "camera", "track"),
        (
            TableKind(
                "matrix",
                "Log-likelihood by camera, term and limb",
                _columns(
                    CAMERA,
                    TERM,
                    LIMB,
                    ("value", "At the pose", "nats"),
                    ("reference", "At the reference pose", "nats"),
                    ("difference", "Pose less reference", "nats"),
                ),
            ),
            TableKind(
                "left_out",
                "Change when one camera or term counts less",
                _columns(
                    CAMERA,
                    TERM,
                    ("factor", "Counts"),
                    ("log_weight", "At the pose", "nats"),
                    ("reference", "At the reference pose", "nats"),
                    ("preference", "Preference of the pose", "nats"),
                    ("change", "Change of preference", "nats"),
                ),
            ),
            TableKind(
                "pulls",
                "Where each camera and term pulls each parameter",
                _columns(PARAMETER, LIMB, UNIT, CAMERA, TERM, ("pull", "Log-likelihood a deviation", "nats")),
            ),
            TableKind(
                "areas",
                "Areas of silhouette and body",
                _columns(
                    CAMERA,
                    LIMB,
                    ("outside", "Body outside the silhouette (B)", "mm²"),
                    ("bare", "Silhouette without body (R)", "mm²"),
                    ("area", "Area of the limb", "mm²"),
                ),
            ),
            TableKind(
                "samples",
                "Samples of one camera",
                _columns(CAMERA, LIMB, TERM, ("x", "x", "px"), ("y", "y", "px"), ("cost", "Cost, 0 to 1")),
            ),
        ),
        evaluates=True,
    ),
    View(
        "modes",
        "Modes",
        "Is there a second answer?",
        ("layer",),
        (
            TableKind(
                "modes",
                "Clusters of the layer",
                _columns(
                    ("mode", "Mode"),
                    ("mass", "Share of the weight"),
                    ("particles", "Particles"),
                    ("best_log_weight", "Best log weight", "nats"),
                    ("distance", "Distance from the heaviest mode", "mm"),
                    ("farthest", "Farthest limb"),
                    ("exchanged", "Limbs exchanged with the heaviest mode"),
                    ("error", "Distance from the truth", "mm"),
                ),
            ),
            TableKind(
                "layers",
                "Share of the weight by layer",
                _columns(
                    LAYER, ("mode", "Mode"), ("mass", "Share of the weight"), ("particles", "Particles")
                ),
            ),
            TableKind(
                "poses",
                "Mean pose of each mode",
                _columns(("mode", "Mode")),
                each="parameter",
            ),
            TableKind(
                "frames",
                "Modes by frame",
                _columns(
                    FRAME,
                    ("modes", "Modes"),
                    ("first_mass", "Share of the heaviest"),
                    ("distance", "Distance of the two heaviest", "mm"),
                    ("farthest", "Farthest limb"),
                ),
                of_run=True,
            ),
        ),
    ),
    View(
        "seeds",
        "Seeds",
        "Would another seed agree?",
        ("limb",),
        (
            TableKind(
                "limbs",
                "Spread within and between seeds",
                _columns(
                    LIMB,
                    ("within", "Within a seed", "mm"),
                    ("between", "Between seeds: Monte-Carlo error of one", "mm"),
                    ("error", "Monte-Carlo error of their mean", "mm"),
                    ("r_hat", "R̂"),
                ),
            ),
            TableKind(
                "seeds",
                "Each seed's result",
                _columns(
                    ("seed", "Seed"), LOG_WEIGHT, ("evaluations", "Evaluations"), ("error", "Error", "mm")
                ),
            ),
            TableKind(
                "ranks",
                "Ranks of each seed's particles among all",
                _columns(
                    PARAMETER, ("seed", "Seed"), ("bin", "Bin"), ("count", "Weight"), ("expected", "Expected")
                ),
            ),
            TableKind(
                "poses",
                "Each seed's estimate",
                _columns(("seed", "Seed")),
                each="parameter",
            ),
        ),
        is_job=True,
    ),
    View(
        "coverage",
        "Coverage",
        "Does spread predict error?",
        ("limb", "track"),
        (
            TableKind(
                "frames",
                "Spread and error by frame and limb",
                _columns(
                    FRAME,
                    LIMB,
                    ("spread", "Spread of the last set", "mm"),
                    ("error", "Error", "mm"),
                ),
                of_run=True,
            ),
            TableKind(
                "correlation",
                "Does spread rank as error does?",
                _columns(LIMB, ("frames", "Frames"), ("rho", "Spearman's ρ"), ("p_value", "p")),
                of_run=True,
            ),
            TableKind(
                "pit",
                "Rank of the truth in the last set",
                _columns(
                    LIMB,
                    ("bin", "Bin"),
                    ("count", "Share"),
                    ("expected", "Expected"),
                    ("lower", "Band, lower"),
                    ("upper", "Band, upper"),
                ),
                of_run=True,
            ),
        ),
    ),
    View(
        "why",
        "Why",
        "Why did this frame fail?",
        ("track",),
        (
            TableKind(
                "findings",
                "What was found",
                _columns(("kind", "Kind"), ("words", "In words"), LIMB, LAYER, CAMERA, TERM),
            ),
            TableKind(
                "nearest",
                "Distance of the nearest particle from the reference pose",
                _columns(
                    LAYER,
                    LIMB,
                    ("nearest", "Nearest particle", "mm"),
                    ("median", "Median particle", "mm"),
                    ("reach", "Noise of the layer", "mm"),
                    ("inside", "Reference inside the cloud"),
                ),
            ),
            TableKind(
                "limbs",
                "Error or disagreement by frame and limb",
                _columns(
                    FRAME,
                    LIMB,
                    ("error", "Error", "mm"),
                    ("disagreement", "Disagreement with the silhouettes"),
                    ("lost", "Lost"),
                ),
                of_run=True,
            ),
        ),
        evaluates=True,
    ),
)
VIEWS = {view.name: view for view in _ALL}


def view_named(name: str) -> View:
    """A view. Raises NotFoundError."""
    if name not in VIEWS:
        raise NotFoundError(f"There is no view '{name[:40]}'.", f"There are: {', '.join(VIEWS)}.")
    return VIEWS[name]
