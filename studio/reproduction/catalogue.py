"""All experiments that `studio reproduce` knows, in the order of the report."""

import difflib
from collections.abc import Iterable
from types import MappingProxyType

from studio.errors import NotFoundError
from studio.reproduction.caillette import (
    clusters_and_states,
    dynamics,
    models,
    scalability,
    table_1,
)
from studio.reproduction.deutscher_reid import (
    fig_3,
    fig_7,
    fig_16,
    figs_19_and_20,
    localisation,
    particles_on_arms,
    particles_on_bodies,
    processors,
    tracked_people,
)
from studio.reproduction.experiment import Experiment
from studio.reproduction.fleischmann import computation_time, figures
from studio.reproduction.open_questions import generalisation, robustness

# A new experiment is named here.
LISTED: tuple[Experiment, ...] = (
    fig_3.EXPERIMENT,
    fig_7.EXPERIMENT,
    tracked_people.FIG_8,
    *tracked_people.THREE_CAMERAS,
    particles_on_bodies.MORE_LAYERS,
    tracked_people.ENOUGH_PARTICLES,
    *localisation.EXPERIMENTS,
    particles_on_arms.DIFFUSION,
    fig_16.EXPERIMENT,
    *localisation.EXPERIMENTS_ON_BRANCHES,
    particles_on_arms.CROSSOVER,
    *figs_19_and_20.EXPERIMENTS,
    particles_on_bodies.BOTH_IMPROVEMENTS,
    processors.EXPERIMENT,
    *figures.EXPERIMENTS,
    computation_time.EXPERIMENT,
    clusters_and_states.EXPERIMENT,
    table_1.EXPERIMENT,
    dynamics.FIG_11_EXPERIMENT,
    *dynamics.FIG_12_EXPERIMENTS,
    models.FIG_13,
    scalability.EXPERIMENT,
    models.ONLINE_LEARNING,
    dynamics.BEST_TRACKER,
    *robustness.EXPERIMENTS,
    generalisation.EXPERIMENT,
)

ALL = "all"
# Words of the command line, and folders beside the experiments' own.
RESERVED = (ALL, "list", "footage", "trials")


def by_name(experiments: Iterable[Experiment]) -> dict[str, Experiment]:
    """Experiments by name. Raises ValueError where two share one, or it means something else."""
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
