"""What the papers set their trackers against: conclusions from made-up outcomes, and the searches themselves."""

from dataclasses import asdict
from itertools import pairwise

import numpy as np
import pytest
from made_up_outcomes import concluded

from studio.body.catalogue import load_body
from studio.garden.reproduction import swarms
from studio.garden.reproduction.deutscher_reid import rivals
from studio.garden.reproduction.deutscher_reid.arms import silhouette, template_arm, true_pose
from studio.garden.reproduction.deutscher_reid.particles_needed import Fewest
from studio.results.comparison.tracked import Tracked
from studio.results.comparison.trials import Scale, Trial
from studio.runs.hierarchy import hierarchy_of
from studio.search.trackers.partitions import stages_of
from studio.search.trackers.swarm_settings import SwarmSettings
from studio.search.trackers.tracker import FilterState, ParticleSet, SearchSpace


def tracked(error: float, seed: int) -> dict:
    errors = error * (1.0 + 0.01 * seed) + np.random.default_rng(seed).normal(0.0, 0.1, 20)
    return asdict(
        Tracked(
            frames=list(range(20)),
            per_frame_mm=errors.tolist(),
            lost=[[] for _ in errors],
            mean_mm=float(errors.mean()),
            worst_mm=float(errors.max()),
            lost_frames=0,
            lost_limbs=[],
            evaluations=1000,
            seconds=1.0,
        )
    )


def of_errors(error_of):
    return lambda trial: tracked(error_of(trial.label), trial.arguments["seed"])


def needing(filter_growth, partition: float = 1.0):
    """A particle filter that needs `filter_growth(seed)` times more for each joint, a partition `partition` times."""

    def made(trial: Trial) -> dict:
        seed = trial.arguments["seed"]
        if "survival" in trial.arguments:
            return {"survival": [0.1, 0.02, 0.005, 0.002]}
        growth = {rivals.ONE_WEIGHTING: filter_growth(seed), rivals.PARTITIONED: partition}
        times = growth.get(trial.arguments["search"], 1.5) ** (trial.arguments["joints"] - 1)
        return asdict(Fewest(32.0 * times, "", [[32, 2, 2]]))

    return made


def test_a_particle_filter_must_need_more_than_in_proportion_to_dimensions() -> None:
    name = "deutscher-dimensions"
    good = concluded(name, needing(lambda seed: 6.0 + 0.1 * seed))
    assert good.verdict == "reproduced"
    power = next(entry for entry in good.numbers if entry.name.startswith("power"))
    assert power.ours == pytest.approx(np.log(0.002) / np.log(0.1))
    assert concluded(name, needing(lambda seed: 1.4)).verdict == "not reproduced"
    assert concluded(name, needing(lambda seed: 6.0, partition=3.0)).verdict == "not reproduced"
    assert concluded(name, needing(lambda seed: 6.0, partition=0.5)).verdict == "not reproduced"
    assert concluded(name, needing(lambda seed: 1.0 if seed % 2 else 2.2)).verdict == "undecided"


def test_a_link_lies_inside_its_own_silhouette() -> None:
    scene = template_arm(rivals.ARM)
    truth = true_pose(scene.space, 3)
    links = rivals.LinksInside(scene, truth)
    assert silhouette(scene.body, scene.camera, truth).any()
    for link in range(rivals.JOINTS):
        turned = truth.copy()
        turned[link] += 0.8 if truth[link] < 0 else -0.8
        right, wrong = links(np.stack([truth, turned]), link)
        assert right == pytest.approx(0.0, abs=0.02)
        assert wrong < -0.2


@pytest.mark.parametrize("search", [rivals.ONE_WEIGHTING, rivals.PARTITIONED, rivals.ANNEALED])
def test_an_arm_is_found_with_many_particles(search: str) -> None:
    scene = template_arm(rivals.ARM)
    truth = true_pose(scene.space, 1)
    pose = rivals.searched_pose(search, scene, truth, 2, 500, np.random.default_rng(0))
    assert pose[2:] == pytest.approx(truth[2:])
    assert np.abs(pose - truth).max() < 0.15


class Bowl:
    """A likelihood that falls with the square of the distance from a pose; the trunk's sees the first two."""

    def __init__(self, middle: np.ndarray) -> None:
        self.middle = middle

    def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        away = (poses - self.middle) ** 2
        return -(away[:, :2] if stage else away).sum(axis=1)


@pytest.mark.parametrize("search", [rivals.layered, rivals.partitioned, rivals.annealed_chain])
def test_each_rival_climbs(search) -> None:
    body_tree = hierarchy_of(template_arm(rivals.ARM).body)
    size = len(body_tree.depth)
    space = SearchSpace(
        tuple("abcd"), np.full(size, -9.0), np.full(size, 9.0), np.ones(size), np.arange(size), body_tree
    )
    start = FilterState(ParticleSet(np.zeros((1, size)), np.zeros(1)))
    middle = np.array([1.0, -1.0, 0.5, 0.5])
    pose, kept = search(np.random.default_rng(0), Bowl(middle), start, space, 0, 0)
    assert np.abs(pose - middle).max() < 0.4
    assert kept.particles is not None
    assert np.exp(kept.particles.log_weights).sum() == pytest.approx(1.0)


def test_layered_and_partitioned_sampling_must_be_worse() -> None:
    name = "deutscher-rivals"

    def others_at(error: float, chain: float = 50.0):
        def error_of(label: str) -> float:
            return 40.0 if label.startswith(rivals.FILTER) else chain if rivals.CHAIN in label else error

        return concluded(name, of_errors(error_of))

    assert others_at(60.0).verdict == "reproduced"
    assert others_at(40.0).verdict == "not reproduced"
    assert others_at(30.0).verdict == "not reproduced"
    # What simulated annealing does is no claim of the paper.
    assert others_at(60.0, chain=20.0).verdict == "reproduced"
    wide = concluded(
        name,
        lambda trial: tracked(
            40.0 if trial.label.startswith(rivals.FILTER) else (30.0, 90.0)[trial.arguments["seed"] % 2],
            trial.arguments["seed"],
        ),
    )
    assert wide.verdict == "undecided"


def test_each_part_of_the_swarm_must_be_needed() -> None:
    name = "fleischmann-parts"

    def run(**error: float):
        errors = {swarms.ONE_SIDE: 60.0, **{getattr(swarms, key): value for key, value in error.items()}}
        return concluded(name, of_errors(lambda label: errors.get(label.rpartition(", seed")[0], 40.0)))

    assert run().verdict == "reproduced"
    assert run(UNLIMITED=60.0).verdict == "reproduced"
    assert run(ONE_SIDE=40.0).verdict == "not reproduced"
    assert run(ONE_SIDE=30.0).verdict == "not reproduced"
    assert run(UNDIVIDED=30.0).verdict == "not reproduced"
    # The torso's edges alone are a question, and how the studio's own swarm does is shown beside.
    assert run(WHOLE_EDGES=20.0, STUDIO=20.0).verdict == "reproduced"


def test_two_stages_must_do_what_six_do() -> None:
    name = "fleischmann-other-swarms"

    def run(six: float, pool: float):
        errors = {swarms.SIX_STAGES: six, swarms.GLAPSO: pool}
        return concluded(name, of_errors(lambda label: errors.get(label.rpartition(", seed")[0], 40.0)))

    assert run(40.0, 30.0).verdict == "reproduced"
    assert run(30.0, 30.0).verdict == "not reproduced"
    assert run(40.0, 40.0).verdict == "not reproduced"
    assert run(40.0, 50.0).verdict == "not reproduced"
    few = concluded(name, of_errors(lambda label: 30.0 if swarms.GLAPSO in label else 40.0), Scale((0, 1)))
    assert few.verdict == "undecided"


def test_every_swarm_evaluates_as_many_poses() -> None:
    tree = hierarchy_of(load_body("human31"))
    for name, swarm in swarms.SWARMS.items():
        stages = swarm.stages(tree)
        assert sum(one.particles * one.iterations for one in stages) == 1000, name
    six = swarms.six_stages(tree)
    for before, after in pairwise(six):
        assert np.all(after.freedom >= before.freedom)
        assert after.freedom.sum() > before.freedom.sum()
    assert six[-1].freedom.all()


def test_the_loop_has_the_stages_of_the_studios_swarm() -> None:
    tree, knobs = hierarchy_of(load_body("human31")), SwarmSettings()
    for stages, partition in ((swarms.soft(tree), "soft"), (swarms.global_local(tree), "global-local")):
        for ours, theirs in zip(stages, stages_of(tree, SwarmSettings(partition=partition)), strict=True):
            assert np.array_equal(ours.freedom, theirs.freedom)
            assert (ours.particles, ours.iterations, ours.looks_at) == (
                theirs.particles,
                theirs.iterations,
                theirs.looks_at,
            )
    assert (
        knobs.c_first,
        knobs.c_last,
        knobs.position_divisor,
    ) == (swarms.C_FIRST, swarms.C_LAST, swarms.DIVISOR)


def test_a_pool_of_leaders_holds_all_of_the_best_step() -> None:
    search = swarms.SwarmSearch(swarms.Swarm(pool=True), None, np.random.default_rng(0))
    bests, values = np.arange(8.0).reshape(4, 2), np.array([1.02, 1.04, 0.9, 0.2])
    assert {row[0] for row in search._leaders(np.repeat(bests, 9, axis=0), np.repeat(values, 9), 0.0)} == {
        0.0,
        2.0,
    }
    assert {row[0] for row in search._leaders(np.repeat(bests, 9, axis=0), np.repeat(values, 9), 1.0)} == {
        2.0
    }
