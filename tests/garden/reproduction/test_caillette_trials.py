"""Trials of the third paper's experiments: shared models, true motion, frames given the true pose, runs."""

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import read_trc, write_trc
from studio.foundations.errors import SettingsError, TruthError
from studio.garden.reproduction.caillette import training_set
from studio.garden.reproduction.caillette.following import (
    FITTED,
    PLACED,
    Follow,
    Followed,
    Known,
    Recovering,
    known_problems,
    measure,
    placed_quality,
    problems,
    taught_blobs,
)
from studio.garden.reproduction.caillette.training_set import (
    POINTING,
    Training,
    learnt,
    made_once,
    pointing_poses,
    recorded,
)
from studio.garden.reproduction.caillette.true_motion import joint_errors, true_motion
from studio.results.comparison.footage_cache import FootageCache
from studio.runs.behaviour_models import fitting
from studio.runs.live.following import Following
from studio.runs.search_space import search_space, session_sigma
from studio.search.behaviour.feature_space import feature_space
from studio.search.likelihood.blobs import BlobFrameLikelihood
from studio.search.likelihood.problem import FittedToPoses
from studio.search.settings import changed_settings, default_settings
from studio.search.trackers.guided_particles import spread_over_clusters
from studio.search.trackers.tracker import FilterState
from studio.sessions.process_lock import ProcessLock

SAMPLES = Path(__file__).parents[3] / "sample_sessions"
FEW = {"most_clusters": 8, "reduced_dimensions": 4, "clustering_patience": 3}
WALK = Training(("walk",), frames=45, performances=1, smoothings=2, body="human31", clusters=FEW)
COARSE = {"hull_depth": 5, "blob_starts": 1}
LAST = 3


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """The bundled walk in its own folder, where models can be learnt."""
    folder = tmp_path_factory.mktemp("footage")
    (folder / "walk").symlink_to(SAMPLES / "walk")
    found = FootageCache(folder)
    yield found
    found.close()


def test_data_are_made_once_for_equal_inputs(tmp_path) -> None:
    made = []

    def make(folder: Path) -> None:
        made.append(folder)
        (folder / "file").write_text(str(len(made)))

    cache = FootageCache(tmp_path)
    first = made_once(cache, "thing", {"seed": 1}, make)
    assert made_once(cache, "thing", {"seed": 1}, make) == first
    assert (first / "file").read_text() == "1"
    assert made_once(cache, "thing", {"seed": 2}, make) != first
    assert len(made) == 2


def test_failed_data_are_made_again_and_leave_nothing(tmp_path) -> None:
    cache = FootageCache(tmp_path)

    def fail(folder: Path) -> None:
        (folder / "half").touch()
        raise SettingsError("No.", "Yes.")

    with pytest.raises(SettingsError):
        made_once(cache, "thing", {}, fail)
    place = made_once(cache, "thing", {}, lambda folder: (folder / "whole").touch())
    assert [path.name for path in place.iterdir()] == ["whole"]
    assert not list((tmp_path / training_set.LEARNT).glob(".partial-*"))


def test_a_waiting_process_uses_the_data_of_another(tmp_path, monkeypatch) -> None:
    cache = FootageCache(tmp_path)
    place = made_once(cache, "thing", {}, lambda folder: None)
    place.rmdir()
    held = ProcessLock.take(place.with_name(f"{place.name}.lock"))
    # While we wait the other process finishes.
    monkeypatch.setattr(training_set.time, "sleep", lambda seconds: place.mkdir())
    assert made_once(cache, "thing", {}, lambda folder: pytest.fail("made twice")) == place
    held.free()


def test_pointing_has_few_clusters_and_memories_share_them(tmp_path) -> None:
    cache = FootageCache(tmp_path)
    pointing = Training((POINTING,), performances=1, smoothings=1, clusters={"most_clusters": 25})
    assert Training.of_plain(json.loads(json.dumps(pointing.plain()))) == pointing
    lesson = learnt(cache, pointing)
    assert 2 <= lesson.model.clusters <= 15
    longer = learnt(cache, dataclasses.replace(pointing, memory=30))
    np.testing.assert_array_equal(longer.model.mixture.means, lesson.model.mixture.means)
    assert longer.model.making.settings.memory == 30
    assert longer.model.states > lesson.model.states
    again = learnt(cache, pointing)
    assert again.seconds == lesson.seconds
    np.testing.assert_array_equal(again.model.automaton.probabilities, lesson.model.automaton.probabilities)


def test_pointing_moves_one_arm_and_comes_back() -> None:
    body = load_body("human25")
    poses = pointing_poses(body, 30.0)
    moved = {body.parameters[place].name for place in np.flatnonzero(np.ptp(poses, axis=0) > 1e-9)}
    assert moved == {"right_shoulder_swing", "right_shoulder_spread", "right_elbow"}
    np.testing.assert_allclose(poses[-1], body.neutral)
    assert np.abs(np.diff(poses, axis=0)).max() < 0.15


@pytest.mark.slow
def test_a_recipe_is_fitted_once_and_from_its_beginning(cache) -> None:
    body = load_body("human31")
    found = recorded(cache, "walk", body, 45)
    assert found.frame_count == 45
    assert found.fps == 30.0
    again = recorded(cache, "walk", body, 45)
    np.testing.assert_array_equal(found.poses, again.poses)


def test_true_motion_lies_on_the_true_markers(cache) -> None:
    session = cache.session("walk")
    body = session.body()
    truth = true_motion(cache, session, LAST)
    assert truth.poses.shape == (LAST, len(body.parameters))
    markers = read_trc(session.truth_path)
    names = [body.markers[place].name for place in truth.markers]
    of_file = markers.positions[:LAST, [markers.names.index(name) for name in names]]
    np.testing.assert_allclose(truth.points, of_file, atol=0.01)
    away = np.linalg.norm(marker_points(body, truth.poses)[:, truth.markers] - truth.points, axis=2)
    assert away.mean() < 25.0


def test_footage_of_another_motion_is_refused(cache, tmp_path) -> None:
    session = cache.session("walk")
    markers = read_trc(session.truth_path)
    moved = dataclasses.replace(markers, positions=markers.positions + 3.0)
    write_trc(tmp_path / "moved.trc", moved)
    fields = {"name": "walk", "body": session.body}
    stale = SimpleNamespace(path=session.path, truth_path=tmp_path / "moved.trc", **fields)
    empty = FootageCache(tmp_path)
    with pytest.raises(TruthError, match="another motion") as refused:
        true_motion(empty, stale, LAST)  # pyright: ignore[reportArgumentType]
    assert "rendered again" in refused.value.hint
    no_recipe = SimpleNamespace(path=tmp_path, truth_path=session.truth_path, **fields)
    with pytest.raises(TruthError, match="not made by a recipe"):
        true_motion(empty, no_recipe, LAST)  # pyright: ignore[reportArgumentType]


def test_errors_are_wrapped_and_over_the_joints_alone(cache) -> None:
    session = cache.session("walk")
    body, truth = session.body(), true_motion(cache, session, LAST)
    columns = feature_space(body, 30.0).columns
    moved = truth.poses.copy()
    moved[:, columns[3]] += 2.0 * np.pi
    names = [entry.name for entry in body.parameters]
    moved[:, names.index("pelvis_x")] += 100.0
    found = joint_errors(body, columns, moved, truth)
    np.testing.assert_allclose(found.angle_deg, 0.0, atol=1e-9)
    np.testing.assert_allclose(found.limb_deg, 0.0, atol=1e-4)
    assert found.position_mm.min() > 70.0
    tipped = truth.poses.copy()
    tipped[:, names.index("pelvis_rz")] += 0.2
    level = joint_errors(body, columns, tipped, truth)
    np.testing.assert_allclose(level.angle_deg, 0.0, atol=1e-9)
    assert 0.0 < level.limb_deg.max() < np.degrees(0.2)
    one = truth.poses.copy()
    one[:, columns[5]] += 0.1
    expected = np.degrees(0.1) / np.sqrt(len(columns))
    np.testing.assert_allclose(joint_errors(body, columns, one, truth).angle_deg, expected)


@pytest.mark.slow
def test_frames_are_given_the_truth_once(cache) -> None:
    session = cache.session("walk")
    truth = true_motion(cache, session, LAST).poses
    settings = changed_settings(default_settings("condensation", "blobs"), COARSE)
    of_frame = known_problems(cache, session, settings, truth)
    assert isinstance(of_frame(1), Known)
    assert not isinstance(of_frame(1), FittedToPoses)
    assert isinstance(problems(cache, session, settings, LAST)(1), FittedToPoses)
    assert known_problems(cache, session, settings, truth)(1) is of_frame(1)
    away = truth[1] + np.where(np.arange(truth.shape[1]) < 3, 150.0, 0.0)
    near, far = of_frame(1).log_likelihood(np.stack([truth[1], away]))
    assert near > far
    edges = default_settings("condensation", "edge-region")
    with pytest.raises(SettingsError, match="edge-region"):
        known_problems(cache, session, edges, truth)


def test_a_guided_run_is_measured_and_gives_the_same_again(cache) -> None:
    changes = {"particles": 30, **COARSE}
    wanted = Follow("walk", "behaviour", "blobs", 1, LAST, changes, from_truth=True, training=WALK)
    arguments = json.loads(json.dumps(wanted.plain()))
    assert Follow.of_plain(arguments) == wanted
    first = Followed(**json.loads(json.dumps(measure(arguments, cache), allow_nan=False)))
    again = Followed(**measure(arguments, cache))
    assert dataclasses.replace(first, milliseconds=0.0) == dataclasses.replace(again, milliseconds=0.0)
    assert len(first.angle_deg) == LAST
    assert first.evaluations == 30
    assert first.free
    assert first.mean_mm < 250.0


def test_a_run_without_model_has_no_model_figures(cache) -> None:
    wanted = Follow("walk", "condensation", "blobs", 1, LAST, {"particles": 30, **COARSE})
    found = Followed(**measure(wanted.plain(), cache))
    assert found.free == []
    assert found.mean_mm < 250.0


def test_a_lost_run_resets_the_automaton_and_searches_the_frame_again(cache, monkeypatch) -> None:
    """The paper's recovery: where the fit is poor the particles are spread over the clusters, once for that frame."""
    changes = {"particles": 40, **COARSE}
    wanted = Follow("walk", "behaviour", "blobs", 1, LAST, changes, training=WALK, recovers=True)
    assert Follow.of_plain(json.loads(json.dumps(wanted.plain()))) == wanted
    asked = []

    def lost_in_the_second(self, problem, before, result) -> bool:
        asked.append(result.frame)
        return result.frame == 1

    monkeypatch.setattr(Recovering, "_is_lost", lost_in_the_second)
    spread = []

    def noted(*arguments):
        spread.append(arguments[2])
        return spread_over_clusters(*arguments)

    monkeypatch.setattr("studio.garden.reproduction.caillette.following.spread_over_clusters", noted)
    expected, known = [], BlobFrameLikelihood.expecting

    def expecting(self, poses, memory):
        expected.append((len(poses), self.likelihood.settings.blob_starts))
        return known(self, poses, memory)

    monkeypatch.setattr(BlobFrameLikelihood, "expecting", expecting)
    found = Followed(**measure(wanted.plain(), cache))
    # All clusters that hold a particle are fitted from, however many the knobs allow, and none is left out.
    clusters = learnt(cache, WALK).model.clusters
    assert max(starts for _, starts in expected) == clusters + 2
    assert all(poses <= starts for poses, starts in expected if starts == clusters + 2)
    assert found.resets == [False, True, False]
    assert spread == [40]
    assert asked == [1, 2], "the first frame has none before it"
    assert len(found.limb_deg) == LAST
    plain = Followed(**measure(dataclasses.replace(wanted, recovers=False).plain(), cache))
    assert plain.resets == []
    assert plain.limb_deg[0] == found.limb_deg[0]
    assert plain.limb_deg[1] != found.limb_deg[1]


def test_blobs_that_fit_poorly_are_lost(cache) -> None:
    """A pose far from the hull gives the voxels a poor likelihood once blobs are learnt."""
    wanted = Follow(
        "walk", "behaviour", "blobs", 1, LAST, {"particles": 40, **COARSE, "blob_learning": 1}, training=WALK
    )
    session = cache.session("walk")
    truth = true_motion(cache, session, LAST)
    settings = wanted.settings()
    problem = problems(cache, session, settings, LAST)(1)
    memory = problem.expecting(truth.poses[:1], {}).remembered(truth.poses[0])
    before = FilterState(None, truth.poses[0], None, memory)
    body = session.body()
    model = fitting(learnt(cache, WALK).model, body, session.manifest.fps)
    space = search_space(body, session_sigma(session, body, session.manifest.fps), model)
    following = Recovering(settings, space, before, 0)
    away = truth.poses[1].copy()
    away[:3] += 900.0
    for pose, lost in ((truth.poses[1], False), (away, True)):
        result = SimpleNamespace(estimate=SimpleNamespace(pose=pose))
        assert following._is_lost(problem, before, result) is lost
    # A threshold of one's own, by fitted blobs or by those that the pose places: turned round, blobs fit the hull
    # again, and where the pose puts them they do not.
    turned = truth.poses[1].copy()
    turned[:2] += 150.0
    right, wrong = (placed_quality(problem, pose, memory) for pose in (truth.poses[1], turned))
    fitted = [problem.expecting(pose[None], memory).quality for pose in (truth.poses[1], turned)]
    assert right - wrong > 1.0
    assert right - wrong > 3.0 * abs(fitted[0] - fitted[1])
    result = SimpleNamespace(estimate=SimpleNamespace(pose=turned))
    for by, below, lost in (
        (PLACED, -0.5 * (right + wrong), True),
        (PLACED, -wrong + 1.0, False),
        (FITTED, -fitted[1] - 0.1, True),
        (FITTED, -fitted[1] + 0.1, False),
    ):
        own = Recovering(settings, space, before, 0, lost_by=by, lost_below=below)
        assert own._is_lost(problem, before, result) is lost, (by, below)


def test_blobs_are_taught_from_the_true_poses_before_the_first_frame(cache) -> None:
    knobs = {"particles": 40, **COARSE, "blob_learning": 2}
    wanted = Follow("walk", "behaviour", "blobs", 1, LAST, knobs, training=WALK, taught=True)
    session = cache.session("walk")
    truth, settings = true_motion(cache, session, LAST), wanted.settings()
    memory = taught_blobs(problems(cache, session, settings, LAST), truth.poses, settings)
    assert set(memory) == {"blobs"}
    seen = []
    known = Following.step

    def step(self, frame, problem, picture=None):
        seen.append(dict(self.carried.memory))
        return known(self, frame, problem, picture)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Following, "step", step)
        measure(wanted.plain(), cache)
    assert np.array_equal(seen[0]["blobs"], memory["blobs"], equal_nan=True)
    assert all(np.array_equal(one["blobs"], memory["blobs"], equal_nan=True) for one in seen)
    plain = dataclasses.replace(wanted, taught=False).plain()
    assert "taught" not in plain
    assert "lost_by" not in plain
    assert "lost_below" not in plain
    assert Follow.of_plain(wanted.plain()) == wanted
