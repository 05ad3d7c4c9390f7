"""All experiments that `studio reproduce` knows, in the order of the report."""

import difflib
from types import MappingProxyType, ModuleType

from studio.errors import NotFoundError
from studio.reproduction.caillette import (
    best_tracker,
    clusters_and_states,
    fig_11,
    fig_12,
    fig_13,
    online_learning,
    scalability,
    table_1,
)
from studio.reproduction.deutscher_reid import (
    adaptive_diffusion,
    crossover,
    fig_3,
    fig_7,
    fig_8,
    fig_16,
    figs_12_to_14,
    figs_17_and_18,
    figs_19_and_20,
    full_body_saving,
    layers_and_particles,
    processors,
    three_cameras,
)
from studio.reproduction.experiment import Experiment
from studio.reproduction.fleischmann import computation_time, figures
from studio.reproduction.open_questions import generalisation, robustness

# One line each: the module's EXPERIMENT, or its EXPERIMENTS. A new module is imported above and named here.
MODULES: tuple[ModuleType, ...] = (
    fig_3,
    fig_7,
    fig_8,
    three_cameras,
    layers_and_particles,
    figs_12_to_14,
    adaptive_diffusion,
    fig_16,
    figs_17_and_18,
    crossover,
    figs_19_and_20,
    full_body_saving,
    processors,
    figures,
    computation_time,
    clusters_and_states,
    table_1,
    fig_11,
    fig_12,
    fig_13,
    scalability,
    online_learning,
    best_tracker,
    robustness,
    generalisation,
)

ALL = "all"
# Words of the command line, and folders beside the experiments' own.
RESERVED = (ALL, "list", "footage", "trials")


def gathered(modules: tuple[ModuleType, ...]) -> dict[str, Experiment]:
    """The experiments of some modules by name. Raises ValueError where two share a name."""
    found: dict[str, Experiment] = {}
    for module in modules:
        own: tuple[Experiment, ...] = getattr(module, "EXPERIMENTS", None) or (module.EXPERIMENT,)
        for experiment in own:
            if experiment.name in (*found, *RESERVED):
                raise ValueError(f"The name '{experiment.name}' of {module.__name__} is taken.")
            found[experiment.name] = experiment
    return found


EXPERIMENTS = MappingProxyType(gathered(MODULES))


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
