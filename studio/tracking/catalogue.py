"""The trackers by name."""

from studio.tracking.annealed_particle_filter import AnnealedParticleFilter
from studio.tracking.behaviour_guided import BehaviourGuided
from studio.tracking.condensation import Condensation
from studio.tracking.particle_swarm import ParticleSwarm
from studio.tracking.tracker import Tracker

TRACKERS: dict[str, Tracker] = {
    "annealed": AnnealedParticleFilter(),
    "behaviour": BehaviourGuided(),
    "condensation": Condensation(),
    "swarm": ParticleSwarm(),
}
