"""Dropped frames: a guided particle takes a step for each, as a tracker without drops would."""

import dataclasses

import numpy as np
from turning_behaviour import guided_space, turning_angles

from studio.search.trackers.guided_particles import GuidedParticles, columns_of, model_of, propagated
from studio.search.trackers.guided_start import arrived
from studio.search.trackers.settings import BehaviourSettings

COUNT = 4000
STILL = BehaviourSettings(attenuation=0.0, model_free_share=0.0)


def turning(begin: int) -> GuidedParticles:
    """Particles that turn as in the model, all alike."""
    space = guided_space()
    model, columns = model_of(space), columns_of(space)
    angles = turning_angles(len(columns), 2, begin)
    poses = np.zeros((COUNT, len(space.names)))
    poses[:, columns] = angles[1]
    velocity = np.tile(angles[1] - angles[0], (COUNT, 1))
    labels = model.mixture.labels(model.reduction.reduced(np.concatenate([angles[1], velocity[0]])[None]))
    state = model.automaton.state_after(labels)
    return GuidedParticles(poses, np.full(COUNT, state), velocity, np.zeros(COUNT, dtype=np.bool_))


def test_three_steps_at_once_are_three_single_steps() -> None:
    space = guided_space()
    nothing = np.zeros(len(space.names))
    columns = columns_of(space)
    # In the middle of a cluster's dwell nearly all particles stay in it.
    guided = turning(begin=3)
    single = guided
    rng = np.random.default_rng(1)
    for _ in range(3):
        single = propagated(rng, single, space, STILL, nothing)
    at_once = propagated(
        np.random.default_rng(2), guided, dataclasses.replace(space, steps=3), STILL, nothing
    )
    for found in (single, at_once):
        assert np.median(np.abs(found.poses[:, columns] - guided.poses[:, columns]), axis=0).max() > 0.1
    assert np.allclose(np.median(single.poses, axis=0), np.median(at_once.poses, axis=0), atol=1e-9), (
        "without noise those that stay in their cluster move alike"
    )
    shares = [
        np.bincount(found.states, minlength=model_of(space).states) / COUNT for found in (single, at_once)
    ]
    assert np.abs(shares[0] - shares[1]).max() < 0.05


def test_a_movement_over_several_frames_is_kept_per_frame() -> None:
    space = dataclasses.replace(guided_space(), steps=3)
    columns = columns_of(space)
    before = turning(begin=3)
    poses = before.poses.copy()
    poses[:, columns] += 3.0 * before.velocity
    extra = {
        "came_from": before.poses,
        "came_from_state": before.states,
        "came_from_velocity": before.velocity,
    }
    found = arrived(np.random.default_rng(3), poses, extra, space)
    assert np.allclose(found["velocity"], before.velocity)
