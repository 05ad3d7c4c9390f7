"""A swarm on a device, in Numba's simulator, against the same written out in NumPy from the same counted numbers; and a
frame whose swarm stays there, goes to the processor and comes back.
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simulated_swarm as made
from compiled_card import FLAG, GENERATIONS, LONG, compiled, kernels_of, needs_compilers, of_type
from simulated_card import found_simulated
from simulated_weighing import scene_of

from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.trackers import device_swarm_kernels
from studio.search.trackers.constraints import MOST_REDRAWS
from studio.search.trackers.counted_numbers import as_normals, as_share, random_words
from studio.search.trackers.device_search_kernels import BEST, MOST
from studio.search.trackers.device_swarm_kernels import (
    OF_TRIES,
    OF_TRY,
    OF_VELOCITIES,
    POSSIBLE,
    VALUE,
)
from studio.search.trackers.particle_swarm import (
    BEST_POSES,
    BEST_POSSIBLE,
    BEST_VALUES,
    FREEDOM,
    LEADER,
    LEADER_POSSIBLE,
    LEADER_VALUE,
    VELOCITIES,
    ParticleSwarm,
    constriction,
)
from studio.search.trackers.swarm_settings import SwarmSettings

INNER = (np.float32(made.SPACE.lower), np.float32(made.SPACE.upper))
INNER[1][2] = np.nextafter(INNER[1][2], np.float32(0.0))
EXACT = {"rtol": 3e-7, "atol": 2e-7}
"""Some roundings of single precision: NumPy's sums are in another order."""


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What swarms do in a process whose device is simulated."""
    return found_simulated(Path(made.__file__), tmp_path_factory)


class Written:
    """One run of a scenario, written out for one particle and one parameter at a time."""

    def __init__(self, scenario: made.Scenario, run: int) -> None:
        self.scenario, self.seed, self.pull = scenario, run + (1 << 40), made.PULLS[run]
        self.limited = scenario.constraints != "ignore"
        self.most = 1 + MOST_REDRAWS if scenario.constraints == "redraw" else 1
        self.tried: list[int] = []

    def possible(self, pose: np.ndarray) -> bool:
        return not self.limited or bool(np.all((INNER[0] <= pose) & (pose <= INNER[1])))

    def sample(self, layer: int, start: np.ndarray, sigma: np.ndarray, count: int) -> None:
        """x ← N(x̂, Σ), v ← U(-σ, σ) or zero."""
        velocities = np.zeros((count, made.SIZE), np.float32)
        if self.scenario.moving:
            for n in range(count):
                for d in range(made.SIZE):
                    word = random_words(self.seed, 7, layer, n, OF_VELOCITIES + d // 4 * 4)[d % 4]
                    velocities[n, d] = (2.0 * as_share(word) - 1.0) * sigma[d]

        def sampled(n: int, d: int, words: list[int]) -> tuple[float, float]:
            normal = as_normals(words[0], words[1])[d % 2]
            return float(start[d]) + sigma[d] * float(normal), float(velocities[n, d])

        self.constrain(layer, sampled, np.repeat(start[None], count, axis=0))
        self.bests, self.leader = self.places.copy(), start.copy()
        self.reached = [(False, -np.inf)] * count
        self.standing = (False, -np.inf)

    def move(self, layer: int, sigma: np.ndarray) -> None:
        """v ← χ (v + c ε1 (p_i - x) + c ε2 (p_g - x)), within 2 σ."""
        places, velocities, c = self.places.copy(), self.velocities.copy(), self.pull

        def moved(n: int, d: int, words: list[int]) -> tuple[float, float]:
            one, other = (as_share(words[2 * (d % 2) + k]) for k in range(2))
            x = float(places[n, d])
            own, leader = float(self.bests[n, d]) - x, float(self.leader[d]) - x
            v = constriction(c) * (float(velocities[n, d]) + c * one * own + c * other * leader)
            v = min(max(v, -2.0 * sigma[d]), 2.0 * sigma[d])
            return x + v, v

        self.constrain(layer, moved, places)

    def constrain(self, layer: int, proposed: Any, came_from: np.ndarray) -> None:  # noqa: ANN401
        """Places and velocities after what the scenario does beyond a limit."""
        count = len(came_from)

        def tried(n: int, attempt: int) -> tuple[np.ndarray, np.ndarray]:
            pairs = []
            for d in range(made.SIZE):
                place = OF_TRIES + OF_TRY * attempt + d // 2 * 2
                pairs.append(proposed(n, d, list(random_words(self.seed, 7, layer, n, place))))
            return np.float32([x for x, _ in pairs]), np.float32([v for _, v in pairs])

        first = [tried(n, 0) for n in range(count)]
        found, wrong, self.tried = list(first), [], []
        for n in range(count):
            if self.scenario.constraints == "clamp":
                x, v = first[n]
                inside = np.clip(x, *INNER)
                found[n] = inside, np.where(inside == x, v, np.float32(0.0))
            elif self.scenario.constraints == "redraw":
                attempts = (tried(n, attempt) for attempt in range(self.most))
                number, good = next(
                    ((k, pair) for k, pair in enumerate(attempts) if self.possible(pair[0])),
                    (self.most, None),
                )
                self.tried.append(number)
                found[n] = good or (came_from[n], np.zeros(made.SIZE, np.float32))
                wrong += [n] if good is None else []
        if len(wrong) == count and not any(self.possible(pose) for pose in came_from):
            found = first
        self.places, self.velocities = (np.stack(part) for part in zip(*found, strict=True))

    def learn(self, values: np.ndarray) -> int:
        """p_i and p_g brought up to date; which particle is best now."""
        ranks = [(self.possible(pose), value) for pose, value in zip(self.places, values, strict=True)]
        for n, rank in enumerate(ranks):
            if rank > self.reached[n]:
                self.reached[n], self.bests[n] = rank, self.places[n]
        first = max(range(len(values)), key=lambda n: (self.reached[n], -n))
        if self.reached[first] > self.standing:
            self.standing, self.leader = self.reached[first], self.bests[first].copy()
        return max(range(len(values)), key=lambda n: (ranks[n], -n))

    def compare(self, there: dict[str, np.ndarray], run: int) -> None:
        """With the set that the device has; goes on from that, so that roundings do not add up."""
        own = slice(run * len(self.places), (run + 1) * len(self.places))
        found = [there[name][:, own].T.copy() for name in ("places", "velocities", "bests")]
        for one, other in zip(found, (self.places, self.velocities, self.bests), strict=True):
            np.testing.assert_allclose(one, other, **EXACT)
        np.testing.assert_allclose(there["leaders"][:, run], self.leader, **EXACT)
        assert [tuple(pair) for pair in there["reached"][[POSSIBLE, VALUE]][:, own].T] == self.reached
        assert tuple(there["standing"][run, [POSSIBLE, VALUE]]) == self.standing
        self.places, self.velocities, self.bests = found
        self.leader = there["leaders"][:, run]


@pytest.mark.parametrize("run", range(2))
@pytest.mark.parametrize("name", made.SCENARIOS)
def test_the_devices_swarm_is_the_one_written_out(simulated: dict[str, Any], name: str, run: int) -> None:
    scenario = made.SCENARIOS[name]
    sets, plain = simulated["sets"][name], Written(scenario, run)
    start = np.float32(scenario.start if name == "redrawn outside" else np.clip(scenario.start, *INNER))
    plain.sample(made.FIRST, start, made.SIGMA, made.COUNT)
    plain.compare(sets[0], run)
    tried = [plain.tried]
    for layer in range(4):
        own = slice(run * len(plain.places), (run + 1) * len(plain.places))
        values = made.values_of(plain.places.astype(float), made.TRUNK if layer < 3 else made.ALL)[0]
        assert np.array_equal(sets[layer + 1]["weights"][0, own], values)
        weighed, best = plain.places.astype(float), plain.learn(values)
        bests = plain.bests.astype(float)
        record = sets[layer + 1]["records"][run]
        np.testing.assert_array_equal(record.poses, weighed)
        np.testing.assert_array_equal(record.log_weights, values)
        np.testing.assert_array_equal(record.best, weighed[best])
        assert record.best_log_weight == values[best]
        np.testing.assert_allclose(record.mean, weighed.mean(axis=0), rtol=0, atol=1e-12)
        np.testing.assert_allclose(record.variance_weighed, weighed.var(axis=0), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(record.variance_resampled, bests.var(axis=0), rtol=1e-9, atol=1e-12)
        if layer < 2:
            plain.move(layer, made.SIGMA)
        elif layer == 2:
            plain.sample(layer, plain.leader, made.NEXT_SIGMA, made.NEXT_COUNT)
            np.testing.assert_array_equal(sets[3]["starts"][:, run], plain.leader)
        following = plain.places.astype(float).var(axis=0) if layer < 3 else record.variance_resampled
        np.testing.assert_allclose(record.variance_diffused, following, rtol=1e-6, atol=1e-12)
        plain.compare(sets[layer + 1], run)
        tried.append(plain.tried)
    flat = np.concatenate([np.array(part) for part in tried])
    if name == "redrawn":
        assert (flat > 0).any(), "some steps are drawn again"
        assert (flat <= MOST_REDRAWS).any()
    if name == "redrawn outside":
        assert (np.array(tried[0]) == plain.most).all(), "x2 is fixed beyond its limit"
        assert not sets[0]["places"][2].max() <= INNER[1][2]
        assert sets[0]["velocities"].any(), "where none can stay, the first steps are taken"
    if name == "clamped":
        assert any((one["velocities"] == 0.0)[[0, 1, 3]].any() for one in sets), "some pass a limit"


def test_velocities_stay_within_two_sigma(simulated: dict[str, Any]) -> None:
    fastest = 0.0
    for sets in simulated["sets"].values():
        for one in sets[1:3]:
            share = np.abs(one["velocities"][made.SIGMA > 0]) / (2.0 * made.SIGMA[made.SIGMA > 0, None])
            fastest = max(fastest, share.max())
            assert not one["velocities"][2].any()
    assert fastest == pytest.approx(1.0, abs=1e-6)


def test_a_run_beside_others_is_the_run_alone(simulated: dict[str, Any]) -> None:
    beside = simulated["sets"]["redrawn outside"]
    for run, alone in simulated["alone"].items():
        for one, among in zip(alone, beside, strict=True):
            for name in ("places", "velocities", "bests", "reached", "leaders", "starts"):
                own = np.split(among[name], made.RUNS, axis=1)[run]
                np.testing.assert_array_equal(one[name], own)
            known = [VALUE, POSSIBLE, MOST, BEST] if "weights" in one else [VALUE, POSSIBLE]
            np.testing.assert_array_equal(one["standing"][0, known], among["standing"][run, known])
    places = np.split(beside[1]["places"], made.RUNS, axis=1)
    assert not np.array_equal(places[0], places[1])


def equal_records(one: Any, other: Any) -> None:  # noqa: ANN401
    for name in (
        "poses",
        "log_weights",
        "best",
        "mean",
        "variance_weighed",
        "variance_resampled",
        "variance_diffused",
    ):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("name", ["frame", "stages of one size"])
def test_a_frame_resumed_after_any_layer_is_the_frame(simulated: dict[str, Any], name: str) -> None:
    frame, resumed = simulated[name]
    assert len(frame["records"]) == 14
    for one, other in zip(frame["records"], resumed["records"], strict=True):
        equal_records(one, other)
    for array, value in frame["result"].carried.particles.extra.items():
        np.testing.assert_array_equal(value, resumed["result"].carried.particles.extra[array])


@pytest.mark.parametrize("name", ["frame", "stages of one size"])
def test_a_frame_is_the_processors_but_for_rounding(simulated: dict[str, Any], name: str) -> None:
    """The same seed is the same search: every particle of every iteration of both searches."""
    particles = made.SETTINGS.stage1_particles if name == "stages of one size" else 5
    settings = dataclasses.replace(made.SETTINGS, stage2_particles=particles)
    there, here = simulated[name][0]["records"], made.searched(settings, (False,) * 14)["records"]
    for one, other in zip(there, here, strict=True):
        np.testing.assert_allclose(one.poses, other.poses, atol=3e-6)
        np.testing.assert_array_equal(one.log_weights, other.log_weights)


@pytest.mark.parametrize("constraints", ["clamp", "redraw"])
def test_limits_without_room_for_single_precision_leave_poses_possible(
    simulated: dict[str, Any], constraints: str
) -> None:
    """A parameter that is fixed at 0.1, which a card does not have: its number nearest to it is within the limits
    there, and 0.1 itself is what goes on elsewhere.
    """
    there, here = simulated["without room"][constraints], made.without_room(constraints, there=False)
    for one, other in zip(there["records"], here["records"], strict=True):
        np.testing.assert_array_equal(one.poses[:, -2], np.float32(made.NO_ROOM))
        np.testing.assert_allclose(one.poses, other.poses, atol=3e-6)
        assert one.variance_weighed[-2] == one.variance_diffused[-2] == 0.0
    last = there["result"].carried.particles
    assert last.extra[BEST_POSSIBLE].all()
    assert last.extra[LEADER_POSSIBLE].all()
    for poses in (last.poses, last.extra[BEST_POSES], last.extra[LEADER][None]):
        np.testing.assert_array_equal(poses[:, -2], made.NO_ROOM)


def test_frames_of_runs_side_by_side_are_those_of_the_runs_alone(simulated: dict[str, Any]) -> None:
    beside, alone = simulated["together"]
    for run in range(3):
        assert len(beside[run]) == 14
        for one, other in zip(beside[run], alone[run], strict=True):
            equal_records(one, other)
    assert not np.array_equal(beside[0][0].poses, beside[1][0].poses)


def test_records_are_those_of_all_stages(simulated: dict[str, Any]) -> None:
    frame, _ = simulated["frame"]
    assert frame["result"].evaluations == 2 * (4 * 3 + 5 * 4)
    assert [len(record.poses) for record in frame["records"]] == 2 * ([4] * 3 + [5] * 4)
    assert [record.layer for record in frame["records"]] == list(range(14))
    assert all(np.isnan(record.beta) for record in frame["records"])


def test_the_last_set_is_the_processors_kind(simulated: dict[str, Any]) -> None:
    frame, _ = simulated["frame"]
    result, records = frame["result"], frame["records"][-4:]
    particles = result.carried.particles
    weighed = np.concatenate([record.poses for record in records])
    values = made.values_of(weighed)[0]
    possible = made.ToyProblem().feasible(weighed)
    assert possible.all()
    assert result.estimate.log_weight == values.max() == particles.extra[LEADER_VALUE][0]
    np.testing.assert_array_equal(result.estimate.pose, weighed[int(np.argmax(values))])
    np.testing.assert_array_equal(result.estimate.mean, particles.extra[BEST_POSES].mean(axis=0))
    np.testing.assert_array_equal(
        made.values_of(particles.extra[BEST_POSES])[0], particles.extra[BEST_VALUES]
    )
    np.testing.assert_array_equal(particles.raw_log_weights, made.values_of(particles.poses)[0])
    np.testing.assert_array_equal(particles.log_weights, np.full(5, -np.log(5)))
    assert particles.poses.dtype == np.float64
    # The next frame's first stage moves the root alone, about the pose that this one reported.
    following = simulated["next frame"]["records"][0].poses
    np.testing.assert_array_equal(following[:, 1:], np.tile(result.estimate.pose[1:], (4, 1)))
    assert np.ptp(following[:, 0]) > 0.0


@pytest.mark.parametrize("name", ["in turns", "begun by the processor"])
def test_processor_and_device_go_on_from_each_other(simulated: dict[str, Any], name: str) -> None:
    found = simulated[name]
    records, sets = found["records"], found["sets"]
    for layer, (record, after) in enumerate(zip(records, sets, strict=True)):
        if layer < 13 and layer != 6:
            np.testing.assert_allclose(records[layer + 1].poses, after.poses, rtol=0, atol=1e-6)
        if layer in (*range(3), *range(7, 10)):
            values = made.values_of(record.poses, made.TRUNK if name == "in turns" else made.ALL)[0]
        else:
            values = made.values_of(record.poses)[0]
        if not (name == "begun by the processor" and layer in range(7, 10)):
            np.testing.assert_array_equal(record.log_weights, values)
        limit = 2.0 * made.SPACE.sigma * after.extra[FREEDOM]
        assert (np.abs(after.extra[VELOCITIES]) <= limit * 1.000001).all()
        assert made.ToyProblem().feasible(after.poses).all()
    for stage in (slice(0, 2), slice(3, 7), slice(7, 9), slice(10, 14)):
        leaders = [float(one.extra[LEADER_VALUE][0]) for one in sets[stage]]
        assert leaders == sorted(leaders)
        for one in sets[stage]:
            assert one.extra[LEADER_VALUE][0] == one.extra[BEST_VALUES].max()
            assert (one.extra[LEADER] == one.extra[BEST_POSES]).all(axis=1).any()


def test_a_frame_is_weighed_by_the_devices_kernels(simulated: dict[str, Any]) -> None:
    found = simulated["weighed there"]
    body, cameras, evidence, _ = scene_of("planar_arm4")
    settings = EdgeRegionSilhouetteSettings(**made.SAMPLES)
    here = EdgeRegionSilhouetteLikelihood(body, cameras, settings).problem(evidence)
    assert [len(record.poses) for record in found["records"]] == [2] * 3 + [3] * 3
    for record in found["records"]:
        np.testing.assert_allclose(record.log_weights, here.fitness(record.poses), rtol=0, atol=2e-3)
    best = max(found["records"][3:], key=lambda record: record.best_log_weight)
    np.testing.assert_array_equal(found["leader"], best.best)
    limbs, trunk, ranked = found["trunk"]
    np.testing.assert_array_equal(trunk, limbs)
    assert ranked == 0
    assert found["two"] == (None, 1), "edges and region have no fitness but the log-weight"


@pytest.mark.parametrize(
    ("knobs", "fits"),
    [
        ({"limbs_apart": False}, True),
        ({"limbs_apart": False, "constraints": "clamp"}, True),
        ({"constraints": "ignore"}, True),
        ({}, False),
        ({"limbs_apart": False, "constraints": "reject"}, False),
    ],
)
def test_joint_limits_alone_are_kept_there(knobs: dict[str, Any], fits: bool) -> None:
    assert ParticleSwarm().fits_device(0, made.SPACE, SwarmSettings(**knobs), {}) == fits


@needs_compilers
@pytest.mark.parametrize("capability", GENERATIONS)
def test_every_kernel_compiles_for_a_card(
    monkeypatch: pytest.MonkeyPatch, capability: tuple[int, int]
) -> None:
    f4, f8, u8 = (of_type(kind, 2) for kind in ("f4", "f8", "u8"))
    signatures = {
        "find_bests": (f4, f8, LONG, f8, LONG, f4, f8, f4, f8),
        "line_up": (f4, f8, u8, LONG, f4, f4, f8, f4, f8),
        "step_swarm": (f4, f4, f4, f4, f8, u8, f8, FLAG, FLAG, LONG, f4, f4),
    }
    assert kernels_of(device_swarm_kernels) == set(signatures)
    kernels = {name: (getattr(device_swarm_kernels, name), types) for name, types in signatures.items()}
    assert set(compiled(monkeypatch, capability, kernels)) == set(signatures)
