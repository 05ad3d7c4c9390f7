"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: what a card's frames are measured by, in Numba's simulator
of one. Writes the figures to the file named."""

import json
import sys
from pathlib import Path

from simulated_search import problem_of
from threads_in_turn import take_threads_in_turn

from studio.garden.benchmarks import card_measures
from studio.search.trackers import (
    device_search,
    device_search_kernels,
    device_swarm,
    device_swarm_kernels,
    device_tempered,
    device_tempered_kernels,
)
from studio.search.trackers.settings import AnnealedSettings, TemperedSettings
from studio.search.trackers.swarm_settings import SwarmSettings

SMALL = SwarmSettings(
    stage1_particles=2, stage1_iterations=3, stage2_particles=2, stage2_iterations=3, limbs_apart=False
)

if __name__ == "__main__":
    take_threads_in_turn()
    for module in (device_search_kernels, device_search, device_swarm_kernels, device_swarm):
        module.SUMMING = 2
    for module in (device_tempered_kernels, device_tempered):
        module.SUMMING = module.MIXING = 2
    problem, space, poses = problem_of("gpu")
    filter_of_four = AnnealedSettings(layers=2, particles=4)
    found = {
        "swarm": card_measures.swarm_time(problem, space, poses[0], SMALL, 1),
        "tempered": card_measures.tempered_time(
            problem, space, poses[0], TemperedSettings(layers=2, particles=2), 1
        ),
        "seeds": card_measures.seeds_together(problem, space, poses[0], filter_of_four, 3, 1),
    }
    Path(sys.argv[1]).write_text(json.dumps(found))
