"""All experiments of `studio reproduce`, in the order of the report."""

import difflib
from collections.abc import Iterable
from types import MappingProxyType

from studio.errors import NotFoundError
from studio.reproduction import fleischmann
from studio.reproduction.caillette import (
    cluster_floor,
    clusters_and_states,
    dynamics,
    models,
    scalability,
    table_1,
)
from studio.reproduction.deutscher_reid import (
    carried_and_crossed,
    layers_of_a_body,
    localisation,
    particles_needed,
    processors,
    tracked_people,
    weight_of_a_knee,
)
from studio.reproduction.experiment import Experiment
from studio.reproduction.open_questions import (
    effort,
    evaluations,
    generalisation,
    posterior,
    robustness,
    start_poses,
)

# New experiments are added here.
LISTED: tuple[Experiment, ...] = (
    layers_of_a_body.FIG_3,
    weight_of_a_knee.FIG_7,
    tracked_people.FIG_8,
    *tracked_people.THREE_CAMERAS,
    *carried_and_crossed.EXPERIMENTS,
    particles_needed.MORE_LAYERS,
    tracked_people.ENOUGH_PARTICLES,
    *localisation.EXPERIMENTS,
    particles_needed.DIFFUSION,
    localisation.FIG_16,
    *localisation.EXPERIMENTS_ON_BRANCHES,
    particles_needed.CROSSOVER,
    layers_of_a_body.FIG_19,
    layers_of_a_body.FIG_20,
    particles_needed.BOTH_IMPROVEMENTS,
    processors.EXPERIMENT,
    *fleischmann.EXPERIMENTS,
    fleischmann.COMPUTATION_TIME,
    clusters_and_states.EXPERIMENT,
    cluster_floor.EXPERIMENT,
    table_1.EXPERIMENT,
    dynamics.FIG_11_EXPERIMENT,
    *dynamics.FIG_12_EXPERIMENTS,
    dynamics.AS_PRINTED_EXPERIMENT,
    dynamics.ROOT_SPREAD_EXPERIMENT,
    models.FIG_13,
    scalability.EXPERIMENT,
    models.ONLINE_LEARNING,
    dynamics.BEST_TRACKER,
    *robustness.EXPERIMENTS,
    generalisation.EXPERIMENT,
    evaluations.EXPERIMENT,
    effort.EXPERIMENT,
    posterior.EXPERIMENT,
    start_poses.EXPERIMENT,
)

ALL = "all"
# Reserved names: words of the command line, and folders beside the experiments' own.
RESERVED = (ALL, "list", "footage", "trials")


def by_name(experiments: Iterable[Experiment]) -> dict[str, Experiment]:
    """Experiments by name. Raises ValueError for duplicate or reserved names."""
    found: dict[str, Experiment] = {}
    for experiment in experiments:
        if experiment.name in (*found, *RESERVED):
            raise ValueError(f"The name '{experiment.name}' is taken.")
        found[experiment.name] = experiment
    return found


EXPERIMENTS = MappingProxyType(by_name(LISTED))


def find_experiments(
    name: str, among: "MappingProxyType[str, Experiment] | dict[str, Experiment]" = EXPERIMENTS
) -> tuple[Experiment, ...]:
    """The experiment of that name, or all for "all". Raises NotFoundError with the nearest names."""
    if name == ALL:
        return tuple(among.values())
    if name in among:
        return (among[name],)
    near = difflib.get_close_matches(name, among, n=3, cutoff=0.4)
    near = near or [known for known in among if name.lower() in known][:3]
    words = f"Did you mean {' or '.join(near)}? " if near else ""
    raise NotFoundError(
        f"There is no experiment '{name}'.", f"{words}'studio reproduce list' names all of them."
    )
