"""All experiments of `studio reproduce`, in the order of the report."""

import difflib
from collections.abc import Iterable
from types import MappingProxyType

from studio.foundations.errors import NotFoundError
from studio.garden.reproduction import fleischmann, swarms
from studio.garden.reproduction.caillette import (
    cluster_floor,
    clusters_and_states,
    dynamics,
    hulls_and_blobs,
    loss_test,
    models,
    scalability,
    table_1,
)
from studio.garden.reproduction.deutscher_reid import (
    carried_and_crossed,
    layers_of_a_body,
    localisation,
    particles_needed,
    processors,
    rivals,
    tracked_people,
    weight_of_a_knee,
)
from studio.garden.reproduction.experiment import TABLE, Experiment
from studio.garden.reproduction.open_questions import (
    arena,
    defaults,
    effort,
    error_split,
    evaluations,
    generalisation,
    half_widths,
    likelihood_scale,
    other_people,
    planted_losses,
    posterior,
    robustness,
    sampled_posterior,
    shadow_masks,
    start_poses,
    tempered_people,
)

# New experiments are added here, and to the table.
MODULES = (
    layers_of_a_body,
    weight_of_a_knee,
    tracked_people,
    carried_and_crossed,
    particles_needed,
    localisation,
    rivals,
    processors,
    fleischmann,
    swarms,
    clusters_and_states,
    cluster_floor,
    table_1,
    hulls_and_blobs,
    loss_test,
    dynamics,
    models,
    scalability,
    robustness,
    generalisation,
    other_people,
    planted_losses,
    shadow_masks,
    evaluations,
    effort,
    arena,
    posterior,
    sampled_posterior,
    tempered_people,
    likelihood_scale,
    error_split,
    half_widths,
    start_poses,
    defaults,
)

ALL = "all"
# Reserved names: words of the command line, and folders beside the experiments' own.
RESERVED = (ALL, "list", "footage", "trials")


def by_name(experiments: Iterable[Experiment]) -> dict[str, Experiment]:
    """Experiments by name. Raises ValueError for duplicate or reserved names."""
    named: dict[str, Experiment] = {}
    for experiment in experiments:
        if experiment.name in (*named, *RESERVED):
            raise ValueError(f"The name '{experiment.name}' is taken.")
        named[experiment.name] = experiment
    return named


_LISTED = by_name(experiment for module in MODULES for experiment in module.EXPERIMENTS)
EXPERIMENTS = MappingProxyType({name: _LISTED[name] for name in TABLE})


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
