"""Learning from recordings: training and test material, and the models' files."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from toy_behaviour import FPS, SETTINGS, waves

from studio.body.catalogue import load_body
from studio.foundations.errors import BehaviourError, StudioError
from studio.foundations.knobs import changed
from studio.operations.model_repository import list_models, place_for_model
from studio.runs.learning.learning import learn, parted
from studio.runs.learning.oversampling import OversamplingSettings
from studio.runs.learning.recordings import Recording
from studio.search.behaviour.model_file import read_model, write_model
from studio.sessions.names import NameRefused
from studio.sessions.workspace import Workspace

BODY = load_body("planar_arm4")
PLAIN = changed(OversamplingSettings(), {"smoothings": 2})
RECORDINGS = [Recording(f"wave-{seed}", FPS, waves(seed, kind=seed % 2)) for seed in range(4)]


def test_the_last_fifth_of_each_recording_is_the_test() -> None:
    short = Recording("short", FPS, waves(9, frames=15), bad_frames=(3,))
    long = dataclasses.replace(RECORDINGS[0], bad_frames=(2, 170))
    training, test = parted([long, short])
    assert [entry.frame_count for entry in training] == [160, 15]
    assert [entry.frame_count for entry in test] == [40]
    np.testing.assert_array_equal(test[0].poses, RECORDINGS[0].poses[160:])
    assert (training[0].bad_frames, test[0].bad_frames, training[1].bad_frames) == ((2,), (10,), (3,))


def test_a_model_is_learnt_and_measured() -> None:
    model, learnt = learn(RECORDINGS, BODY, SETTINGS, PLAIN, seed=4)
    assert (learnt.recorded_frames, learnt.test_frames) == (640, 160)
    assert learnt.frames == model.making.frames == 4 * (160 + 159)
    assert (learnt.clusters, learnt.states) == (model.clusters, model.states)
    assert learnt.clusters > 2
    _, test = parted(RECORDINGS)
    assert learnt.entropy_test == pytest.approx(model.entropy([entry.poses for entry in test]))
    assert learnt.entropy_train == model.making.entropy_train
    assert model.making.entropy_test == learnt.entropy_test
    assert model.making.sources == tuple(name for k in range(4) for name in [f"wave-{k}"] * 2)
    same, _ = learn(RECORDINGS, BODY, SETTINGS, PLAIN, seed=4)
    np.testing.assert_array_equal(same.mixture.means, model.mixture.means)


def test_a_separate_test_leaves_the_training_whole() -> None:
    _, learnt = learn(RECORDINGS[:2], BODY, SETTINGS, PLAIN, RECORDINGS[2:])
    assert (learnt.recorded_frames, learnt.test_frames) == (400, 400)
    _, untested = learn(RECORDINGS[:2], BODY, SETTINGS, PLAIN, [])
    assert np.isnan(untested.entropy_test)


def test_recordings_at_different_rates_are_refused() -> None:
    other = dataclasses.replace(RECORDINGS[1], fps=50.0)
    with pytest.raises(StudioError, match="different frame rates"):
        learn([RECORDINGS[0], other], BODY, SETTINGS, PLAIN)


def test_models_are_kept_listed_and_not_overwritten(tmp_path: Path) -> None:
    workspace = Workspace()
    assert list_models(workspace) == ()
    model, learnt = learn(RECORDINGS, BODY, SETTINGS, PLAIN)
    place = place_for_model("waving", workspace)
    assert place == workspace.root / "models" / "waving.behaviour"
    write_model(model, place)
    (workspace.root / "models" / "broken.behaviour").write_bytes(b"no model")
    broken, waving = list_models(workspace)
    assert (broken.name, waving.name) == ("broken", "waving")
    assert broken.problem
    assert (waving.body, waving.fps, waving.frames) == ("planar_arm4", FPS, learnt.frames)
    assert (waving.clusters, waving.states, waving.memory) == (
        learnt.clusters,
        learnt.states,
        SETTINGS.memory,
    )
    assert waving.entropy_test == learnt.entropy_test
    assert waving.sources == tuple(f"wave-{k}" for k in range(4))
    with pytest.raises(BehaviourError, match="already"):
        place_for_model("waving", workspace)
    assert place_for_model("waving", workspace, replace=True) == place
    elsewhere = place_for_model(str(tmp_path / "mine"), workspace)
    write_model(model, elsewhere)
    assert read_model(tmp_path / "mine.behaviour").clusters == model.clusters
    for name in ("../up", ".", "a b", ""):
        with pytest.raises((NameRefused, BehaviourError)):
            place_for_model(name, workspace) if name != "../up" else place_for_model(
                "no/such/folder", workspace
            )
