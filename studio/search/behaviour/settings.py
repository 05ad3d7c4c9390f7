"""The knobs of learning a behaviour model (Caillette, Galata & Howard 2007, section 4)."""

from dataclasses import dataclass

from studio.foundations.knobs import new_run_knob


@dataclass(frozen=True, slots=True)
class LearningSettings:
    """The settings of learning; the paper's memory is 10, 20 or 30, its ε is not given."""

    title = "Behaviour learning"

    memory: int = new_run_knob(
        10, 0, 100, 1, unit="frames",
        help="Longest history of cluster labels in a state of the automaton; 0 is no memory.",
    )  # fmt: skip
    epsilon: float = new_run_knob(
        0.5, 0.0, 1000.0, 0.01, label="ε",
        help="A longer history is kept where it makes some label 1 + ε times more or less probable than the history "
        "that is one frame shorter; larger keeps fewer.",
    )  # fmt: skip
    least_probability: float = new_run_knob(
        0.001, 0.0, 0.5, 0.0001, label="least probability",
        help="Histories rarer than this share of all training frames are not considered.",
    )  # fmt: skip
    smoothing: float = new_run_knob(
        0.01, 0.0, 0.5, 0.001,
        help="Share of every state's probability that is spread evenly over all labels in the entropy, so that "
        "unseen labels have a finite code length; predictions are not smoothed.",
    )  # fmt: skip
    back_off: float = new_run_knob(
        0.05, 0.0, 1.0, 0.01, label="back-off",
        help="Share of a state's predictions that is taken from shorter histories, down to one label, so that labels "
        "unseen after a long history stay possible. 0 allows only labels seen in the state, as in the paper.",
    )  # fmt: skip
    most_clusters: int = new_run_knob(
        200, 1, 1000, 1, label="most clusters",
        help="Clusters that the search for elementary movements starts with; it removes those without enough "
        "frames.",
    )  # fmt: skip
    covariance: str = new_run_knob(
        "full", choices=("full", "diagonal"),
        help="Shape of the clusters where they are found; a full one needs more frames.",
    )  # fmt: skip
    # On other performances of the training's two exercises (`studio reproduce caillette-cluster-floor`): 24 and 27 % of
    # their frames lie in a cluster without a floor, 80 and 74 % with 0.003, and a frame costs 0.58 and 0.83 nats
    # instead of 1.91 and 1.57 (memory 10), while tracking stays as it was (joint positions 1.00 and 0.99 times). Floors
    # of 0.01 and more describe them better still, but a tracker that they guide loses one exercise or both.
    cluster_floor: float = new_run_knob(
        0.003, 0.0, 0.5, 0.001, label="cluster floor",
        help="Least variance of a cluster where it is found, as a share of that of all frames in each dimension. "
        "0 lets clusters shrink onto the frames that were learnt, so that other performances lie in none.",
    )  # fmt: skip
    reduced_dimensions: int = new_run_knob(
        6, 0, 200, 1, label="reduced dimensions",
        help="Principal components in which clusters are found; 0 takes the whole feature space.",
    )  # fmt: skip
    clustering_patience: int = new_run_knob(
        20, 0, 1000, 1, label="clustering patience",
        help="Clusters removed without a shorter message before the search ends; 0 goes on to a single cluster.",
    )  # fmt: skip
