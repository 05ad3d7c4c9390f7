"""Weights that choose nothing are said to: the numbers of a frame alone look like any other's."""

import dataclasses

import numpy as np
import pytest
from toy_problems import Bowl, toy_space

from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.condensation import Condensation
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.layer_record import search_notes
from studio.search.trackers.tracker import LayerRecord, SearchSpace, Tracker, start_of

COUNT = 6


def searched(tracker: Tracker, problem: Bowl, space: SearchSpace, **knobs: object) -> list[LayerRecord]:
    """The records of a second frame; the first one is a usual one."""
    settings = dataclasses.replace(tracker.settings_type(), **knobs)
    records: list[LayerRecord] = []
    carried = start_of((0.5,) * COUNT)
    for frame, likelihood in enumerate((Bowl(np.zeros(COUNT)), problem)):
        records.clear()
        result = search_frame(
            tracker,
            likelihood,
            carried,
            space,
            seed=3,
            frame=frame,
            settings_source=lambda: (1, settings),
            on_layer=records.append,
        )
        carried = result.carried
        assert np.isfinite(result.estimate.pose).all()
        assert np.isfinite(result.estimate.log_weight)
    return records


class Spike(Bowl):
    """One pose weighs, the others as good as nothing."""

    def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        return np.where(np.arange(len(poses)) == 2, 0.0, -1e6)


def test_of_a_set_that_is_recorded_in_part_all_particles_count() -> None:
    """Fifty thousand of which two hundred survive, every hundredth recorded."""
    (few,) = searched(Condensation(), Bowl(np.zeros(COUNT)), toy_space(COUNT), particles=500, scale_frames=1)
    few = dataclasses.replace(few, alpha_reached=0.002)
    assert search_notes([few]) == ("One particle held all the weight in layer 1.",)
    assert search_notes([dataclasses.replace(few, rows=np.arange(0, 50_000, 100))]) == ()


def test_one_particle_with_all_the_weight() -> None:
    records = searched(Condensation(), Spike(np.zeros(COUNT)), toy_space(COUNT), particles=50, scale_frames=1)
    assert search_notes(records) == ("One particle held all the weight in layer 1.",)


def test_annealing_shares_even_such_weights_out() -> None:
    """β becomes small enough for the wanted rate (Eq. 12)."""
    records = searched(
        AnnealedParticleFilter(), Spike(np.zeros(COUNT)), toy_space(COUNT), particles=50, layers=3
    )
    assert search_notes(records) == ()
    assert [record.alpha_reached for record in records] == pytest.approx(
        [record.alpha_wanted for record in records]
    )


@pytest.mark.parametrize("covariance", ["diagonal", "full"])
def test_a_cloud_of_one_pose_has_a_singular_covariance(covariance: str) -> None:
    """Noise in proportion to it is none: the search stays, finite, and says so."""
    space = toy_space(COUNT)
    still = dataclasses.replace(space, sigma=np.zeros_like(space.sigma))
    records = searched(
        AnnealedParticleFilter(),
        Bowl(np.zeros(COUNT)),
        still,
        particles=40,
        layers=3,
        diffusion_covariance=covariance,
    )
    assert search_notes(records) == ("All particles were one pose in layers 1, 2, 3: nothing was searched.",)


@pytest.mark.parametrize("covariance", ["diagonal", "full"])
def test_a_flat_cloud_is_searched_within_its_plane(covariance: str) -> None:
    """A covariance without full rank, not zero."""
    space = toy_space(COUNT)
    flat = dataclasses.replace(space, sigma=space.sigma * (np.arange(COUNT) < 2))
    records = searched(
        AnnealedParticleFilter(),
        Bowl(np.zeros(COUNT)),
        flat,
        particles=40,
        layers=3,
        diffusion_covariance=covariance,
    )
    assert search_notes(records) == ()
    assert all(np.isfinite(record.poses).all() for record in records)
    assert all((record.poses[:, 2:] == 0.5).all() for record in records)
