"""Searches whose particles stay on a card: in Numba's simulator against NumPy, and what the processor does."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from simulated_card import run_simulated
from simulated_search import COUNT, LAST, OF_FRAMES, PLAN, SEEDS, SETTINGS, last_set, problem_of

from studio.foundations import numba_on_devices
from studio.foundations.errors import RunError, StudioError
from studio.search.trackers import device_runs, frame_loop
from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.annealing import anneal
from studio.search.trackers.condensation import Condensation
from studio.search.trackers.counted_numbers import as_normals, as_share, random_words
from studio.search.trackers.frame_loop import FrameSearch, search_frame
from studio.search.trackers.particle_kernels import places
from studio.search.trackers.settings import AnnealedSettings, CondensationSettings
from studio.search.trackers.tracker import start_of

HERE = Path(__file__).parent
BETA, SURVIVAL = 0, 1
OF_RUN, OF_PARENTS, OF_CUTS, OF_NOISE = 0, 1, 2, 16


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """What searches on a simulated card give."""
    place = tmp_path_factory.mktemp("search") / "found.npz"
    run_simulated(HERE / "simulated_search.py", place)
    with np.load(place) as found:
        return dict(found)


def words_of(run, particle, place):
    return random_words(
        np.uint64(SEEDS[run]), np.uint64(7), np.uint64(2), np.uint64(particle), np.uint64(place)
    )


def drawn(weights, mark):
    cumulated = np.cumsum(weights)
    return min(int(np.searchsorted(cumulated / cumulated[-1], mark, side="right")), len(weights) - 1)


@pytest.fixture(scope="module")
def problem():
    return problem_of("cpu")


@pytest.mark.parametrize("run", [0, 1])
def test_a_frame_begins_with_those_that_weigh_spread_by_sigma(simulated, problem, run):
    """Eq. 9 with survivors carried over, from the same counted numbers."""
    _, space, poses = problem
    last, begun = last_set(poses, run), simulated["both.begun"][:, run * COUNT : (run + 1) * COUNT].T
    common = as_share(words_of(run, 0, OF_RUN)[0])
    for n in range(COUNT):
        source = drawn(np.exp(last.log_weights), (n + common) / COUNT)
        normals = noise_of(run, n, len(space.names))
        expected = last.poses[source] + space.sigma * normals
        np.testing.assert_allclose(begun[n], np.clip(expected, space.lower, space.upper), atol=2e-6)


def noise_of(run, particle, size):
    found = []
    for d in range(0, size, 4):
        a, b, c, e = words_of(run, particle, OF_NOISE + d)
        found += [*as_normals(a, b), *as_normals(c, e)]
    return np.array(found[:size], dtype=np.float64)


@pytest.mark.parametrize("run", [0, 1])
def test_a_layer_is_the_papers(simulated, problem, run):
    """Weights, β and α (Eq. 3, 11, 12), survivors, children of two (Eq. 19) and noise by their covariance (Eq. 18)."""
    weighting, space, _ = problem
    rows = slice(run * COUNT, (run + 1) * COUNT)
    begun = simulated["both.begun"][:, rows].T.astype(np.float64)
    weights = simulated["both.weights"][:, rows]
    np.testing.assert_allclose(weights[1], weighting.log_likelihood(begun), atol=1e-3)
    np.testing.assert_allclose(weights[0], weighting.fitness(begun), atol=1e-3)
    expected = anneal(weights[1], PLAN.survival)
    found = simulated["both.annealed"][run]
    np.testing.assert_allclose(found[[BETA, SURVIVAL]], [expected.beta, expected.survival], rtol=1e-5)
    shares = np.exp(expected.log_weights)
    cumulated = simulated["both.cumulated"][rows]
    np.testing.assert_allclose(np.diff(cumulated, prepend=0.0) / cumulated[-1], shares, atol=1e-6)
    moments = simulated["both.moments"][:, run]
    mean = shares @ begun
    np.testing.assert_allclose(moments[0], begun.mean(axis=0), atol=1e-6)
    np.testing.assert_allclose(moments[1], begun.var(axis=0), rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(moments[2], mean, atol=1e-5)
    np.testing.assert_allclose(moments[3], shares @ (begun - mean) ** 2, rtol=1e-4, atol=1e-9)
    survivors = simulated["both.survivors"][:, rows].T.astype(np.float64)
    parents = simulated["both.parents"][:, rows]
    common, limb = as_share(words_of(run, 0, OF_RUN)[0]), places(space.limb)
    for n in range(COUNT):
        own, cuts = words_of(run, n, OF_PARENTS), words_of(run, n, OF_CUTS)
        parent, other = drawn(shares, (n + common) / COUNT), drawn(shares, as_share(own[1]))
        child, used = begun[parent].copy(), False
        if as_share(own[2]) < PLAN.crossed:
            one, two = (1 + int(as_share(cut) * limb[-1]) for cut in cuts[:2])
            taken = (limb > min(one, two)) & (limb <= max(one, two))
            child[taken], used = begun[other][taken], taken.any()
        np.testing.assert_array_equal(survivors[n], child)
        assert parents[:, n].tolist() == [parent, other if used else -1]
    np.testing.assert_allclose(moments[4], survivors.mean(axis=0), atol=1e-6)
    variance = survivors.var(axis=0)
    np.testing.assert_allclose(moments[5], variance, rtol=1e-4, atol=1e-9)
    root = np.tril(simulated["both.root"][run])
    correlations = np.corrcoef(survivors.T)
    np.testing.assert_allclose(root @ root.T, correlations, atol=1e-4)
    following = simulated["both.following"][:, rows].T
    for n in range(COUNT):
        noise = root @ noise_of(run, n, len(space.names))
        middle = survivors.mean(axis=0)
        pose = (
            middle + PLAN.noise.kept * (survivors[n] - middle) + PLAN.noise.scale * np.sqrt(variance) * noise
        )
        np.testing.assert_allclose(following[n], np.clip(pose, space.lower, space.upper), atol=1e-5)
    np.testing.assert_allclose(moments[6], following.mean(axis=0), atol=1e-6)


def test_a_run_beside_others_is_the_run_alone(simulated):
    """Bit for bit, all that a layer makes."""
    for name in ("begun", "weights", "cumulated", "parents", "survivors", "following"):
        beside = simulated[f"both.{name}"][..., COUNT:]
        np.testing.assert_array_equal(beside, simulated[f"one.{name}"], err_msg=name)
    np.testing.assert_array_equal(simulated["both.annealed"][1:], simulated["one.annealed"])
    np.testing.assert_array_equal(np.tril(simulated["both.root"][1:]), np.tril(simulated["one.root"]))


def test_a_frame_is_searched_on_the_card_and_goes_on_elsewhere(simulated, problem):
    weighting, _, _ = problem
    poses, log_weights = simulated["search.poses"], simulated["search.log_weights"]
    assert poses.shape == (SETTINGS.layers, COUNT, 4)
    np.testing.assert_allclose(log_weights[1], weighting.log_likelihood(poses[1]), atol=1e-3)
    np.testing.assert_array_equal(simulated["search.resumed"], poses[-1])
    np.testing.assert_array_equal(simulated["search.carried"], poses[-1])
    shares = np.exp(simulated["search.carried_weights"])
    assert shares.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(simulated["search.estimate"], shares @ poses[-1])
    assert simulated["search.evaluations"] == SETTINGS.layers * COUNT
    np.testing.assert_allclose(simulated["search.variances"][0], poses[1].var(axis=0), rtol=1e-4)
    np.testing.assert_allclose(simulated["search.weighed"][1], poses[1].var(axis=0), rtol=1e-4)


def test_a_frame_is_the_processors_but_for_rounding(simulated, problem):
    """The same seed is the same search: every particle of every layer, in a run's first two frames, which cross
    by limbs and by parameters.
    """
    weighting, space, poses = problem
    found, previous = [], start_of(tuple(poses[0]))
    for frame in range(2):
        done = search_frame(
            AnnealedParticleFilter(),
            weighting,
            previous,
            space,
            seed=5,
            frame=frame,
            settings_source=lambda settings=OF_FRAMES[frame]: (0, settings),
            repeats=2 - frame,
            on_layer=found.append,
        )
        previous = done.carried
    assert len(found) == 3 * SETTINGS.layers
    np.testing.assert_allclose(
        simulated["frames.poses"], np.stack([record.poses for record in found]), atol=2e-5
    )
    np.testing.assert_array_equal(
        simulated["frames.parents"], np.stack([record.parents for record in found if record.parents.size])
    )


def test_condensation_is_the_processors_but_for_rounding(simulated, problem):
    weighting, space, poses = problem
    found, previous = [], start_of(tuple(poses[0]))
    for frame in range(2):
        settings = CondensationSettings(particles=COUNT, scale_frames=1)
        done = search_frame(
            Condensation(),
            weighting,
            previous,
            space,
            seed=5,
            frame=frame,
            settings_source=lambda settings=settings: (0, settings),
            on_layer=found.append,
        )
        previous = done.carried
    np.testing.assert_allclose(
        simulated["condensation.poses"], np.stack([record.poses for record in found]), atol=2e-5
    )


@pytest.mark.parametrize("name", ["annealed", "condensation"])
def test_frames_of_runs_side_by_side_are_those_of_the_runs_alone(simulated, name):
    """Bit for bit, all layers of two frames, whose runs differ by seed, σ0 and what they carry."""
    for run in range(2):
        for part in ("poses", "numbers", "carried", "estimate"):
            beside, alone = (simulated[f"{name}.{way}.{run}.{part}"] for way in ("both", "one"))
            np.testing.assert_array_equal(beside, alone, err_msg=f"{run} {part}")
    assert not np.array_equal(simulated[f"{name}.both.0.poses"], simulated[f"{name}.both.1.poses"])


def test_condensation_keeps_the_scale_that_its_first_frame_chose(simulated):
    first, second = simulated["condensation.betas"]
    assert first == pytest.approx(second)
    np.testing.assert_allclose(simulated["condensation.scales"], np.log(first))


class Failing:
    """In place of a search on a card: it fails in the layer given."""

    fails, evaluated = 0, COUNT

    def __init__(self, *_):
        self.layer = 0

    def begin(self, *_):
        pass

    def step(self, layer, *_):
        if layer == self.fails:
            raise RuntimeError("[719] unspecified launch failure")
        return [SimpleNamespace()]

    def particles(self):
        raise RuntimeError("[719] unspecified launch failure")


class Carded:
    """A frame that a card weighs until it fails. asked : whether the card was asked for."""

    def __init__(self, problem, asked=False):
        self.problem, self.asked, self.given_up = problem, asked, 0

    def __getattr__(self, name):
        return getattr(self.problem, name)

    def on_device(self):
        return None if self.given_up else object()

    def give_up_device(self, error):
        if self.asked:
            raise StudioError(f"The card failed: {error}.")
        self.given_up += 1


def searched(problem, space, poses, settings):
    search = FrameSearch(AnnealedParticleFilter(), start_of(tuple(poses[0])), space, seed=5, frame=0)
    return [search.step(problem, 0, settings) for _ in range(settings.layers)]


def test_a_card_that_fails_leaves_the_search_to_the_processor(monkeypatch, problem):
    weighting, space, poses = problem
    monkeypatch.setattr(AnnealedParticleFilter, "device_module", __name__)
    monkeypatch.setitem(globals(), "DeviceSearch", Failing)
    carded = Carded(weighting)
    found, expected = (searched(one, space, poses, SETTINGS) for one in (carded, weighting))
    assert carded.given_up == 1
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.poses, other.poses)
    with pytest.raises(StudioError, match="unspecified launch failure"):
        searched(Carded(weighting, asked=True), space, poses, SETTINGS)
    monkeypatch.setattr(Failing, "fails", 1)
    monkeypatch.setattr(frame_loop.dataclasses, "replace", lambda record, **_: record)
    with pytest.raises(RunError, match="layer 2 of frame 0"):
        searched(Carded(weighting), space, poses, SETTINGS)


@pytest.mark.parametrize(
    "knobs", [{"constraints": "redraw"}, {"constraints": "reject"}, {"limbs_apart": True}]
)
def test_what_a_card_does_not_do_the_processor_does(monkeypatch, problem, knobs):
    weighting, space, poses = problem
    monkeypatch.setattr(AnnealedParticleFilter, "device_module", "studio.search.no_such_search")
    settings = AnnealedSettings(layers=2, particles=COUNT, **knobs)
    found, expected = (searched(one, space, poses, settings) for one in (Carded(weighting), weighting))
    np.testing.assert_array_equal(found[-1].poses, expected[-1].poses)


@pytest.mark.parametrize("recorded", [True, False])
def test_launches_are_recorded_at_their_second_time_and_hold_no_frame(monkeypatch, recorded):
    made, again = [], (lambda: made.append("again")) if recorded else None
    monkeypatch.setattr(device_runs, "record_launches", lambda launch, stream: again)
    runs = SimpleNamespace(_arrays={}, _stream=None)
    for frame in range(4):
        device_runs.DeviceRuns._launch(runs, ("a layer",), lambda frame=frame: made.append(frame))
    assert made == ([0, "again", "again", "again"] if recorded else [0, 1, 2, 3])


def test_launches_that_cannot_be_recorded_are_made_one_by_one(monkeypatch):
    """Without the driver's bindings, and where the driver refuses at any step."""
    made = []
    stream = SimpleNamespace(handle=1)
    steps = ("cuStreamBeginCapture", "cuStreamEndCapture", "cuGraphInstantiate")
    for refused in (None, *steps):
        answers = {step: (1 if step == refused else 0, step) for step in steps}
        driver = SimpleNamespace(
            CUstreamCaptureMode=SimpleNamespace(CU_STREAM_CAPTURE_MODE_RELAXED=2),
            cuGraphLaunch=lambda graph, handle: (made.append((graph, handle)) or 0,),
            **{step: lambda *_, answer=answer: answer for step, answer in answers.items()},
        )
        monkeypatch.setattr(numba_on_devices.importlib, "import_module", lambda name, driver=driver: driver)
        again = numba_on_devices.record_launches(lambda: None, stream)
        assert (again is None) == (refused is not None)
        if again is not None:
            again()
            assert made == [("cuGraphInstantiate", 1)]

    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(numba_on_devices.importlib, "import_module", missing)
    assert numba_on_devices.record_launches(lambda: None, stream) is None
    assert LAST < COUNT
