"""A model's file: the same model is read back, and other files are refused."""

import io
import json
import zipfile
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from toy_behaviour import recordings, toy_model

from studio.foundations.errors import BehaviourError
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import VERSION, read_model, write_model
from studio.search.behaviour.prediction import propagate, start_states


@pytest.fixture(scope="module")
def model() -> BehaviourModel:
    return toy_model()


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as archive:
        return {name: archive[name] for name in archive.files}


def rewritten(path: Path, **changes: object) -> None:
    """Changes entries of a model's head in its file."""
    arrays = arrays_of(path)
    head = json.loads(arrays.pop("head").tobytes()) | changes
    with path.open("wb") as file:
        np.savez(file, head=np.frombuffer(json.dumps(head).encode(), dtype=np.uint8), **arrays)


def test_round_trip(model: BehaviourModel, tmp_path: Path) -> None:
    path = tmp_path / "models" / "waving.behaviour"
    write_model(model, path)
    assert [entry.name for entry in path.parent.iterdir()] == ["waving.behaviour"]
    back = read_model(path)
    assert back.automaton.contexts == model.automaton.contexts
    assert back.making.settings == model.making.settings
    assert back.making.entropy_train == model.making.entropy_train
    assert np.isnan(back.making.entropy_test)
    assert back.space.names == model.space.names
    for one, other in zip(back.making.labels, model.making.labels, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(back.prototypes.poses, model.prototypes.poses)
    assert back.entropy(recordings()) == model.entropy(recordings())
    moved = []
    for one in (model, back):
        start = start_states(np.random.default_rng(1), one, 50)
        moved.append(
            propagate(np.random.default_rng(2), one, start.states, start.values, start.velocities, 0.3)
        )
    np.testing.assert_array_equal(moved[0].values, moved[1].values)


def test_another_rate_is_kept(model: BehaviourModel, tmp_path: Path) -> None:
    path = tmp_path / "fast.behaviour"
    write_model(model.at_rate(60.0), path)
    back = read_model(path)
    assert (back.fps, back.making.learnt_fps) == (60.0, 25.0)


def test_all_of_a_model_is_kept(model: BehaviourModel, tmp_path: Path) -> None:
    automaton = replace(model.automaton, smoothing=0.02, back_off=0.3)
    making = replace(model.making, sources=("walk", "run"), entropy_test=1.5)
    whole = replace(model, automaton=automaton, making=making)
    write_model(whole, tmp_path / "one.behaviour")
    back = read_model(tmp_path / "one.behaviour")
    assert (back.automaton.smoothing, back.automaton.back_off) == (0.02, 0.3)
    assert (back.making.sources, back.making.entropy_test) == (("walk", "run"), 1.5)
    assert back.making.frames == model.making.frames
    assert back.reduction.kept == model.reduction.kept
    write_model(back, tmp_path / "other.behaviour")
    one, other = arrays_of(tmp_path / "one.behaviour"), arrays_of(tmp_path / "other.behaviour")
    assert one.keys() == other.keys()
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name])


def test_arrays_that_do_not_fit_each_other_are_refused(model: BehaviourModel, tmp_path: Path) -> None:
    path = tmp_path / "odd.behaviour"
    write_model(model, path)
    whole = arrays_of(path)
    # The labels are only what the automaton is learnt from again.
    alone = {"head", "labels", "label_lengths", "mixture_weights", "dynamics_weights", "middle", "turning"}
    alone |= {"prototype_recordings", "prototype_frames", "contexts"}
    for name in whole.keys() - alone:
        for axis in range(whole[name].ndim):
            shorter = np.delete(whole[name], -1, axis)
            with path.open("wb") as file:
                np.savez(file, **(whole | {name: shorter}))
            with pytest.raises(BehaviourError, match="not a behaviour model"):
                read_model(path)
    for state in (-1, model.states):
        states = whole["next_state"].copy()
        states[1, 0] = state
        with path.open("wb") as file:
            np.savez(file, **(whole | {"next_state": states}))
        with pytest.raises(BehaviourError, match="not a behaviour model"):
            read_model(path)
    states[1, 0] = model.states - 1
    with path.open("wb") as file:
        np.savez(file, **(whole | {"next_state": states}))
    assert read_model(path).automaton.next_state[1, 0] == model.states - 1


def test_what_an_older_head_has_not_is_as_if_it_were_not_used(model: BehaviourModel, tmp_path: Path) -> None:
    path = tmp_path / "older.behaviour"
    write_model(replace(model, automaton=replace(model.automaton, smoothing=0.02, back_off=0.3)), path)
    arrays = arrays_of(path)
    head = json.loads(arrays.pop("head").tobytes())
    for name in ("kept", "smoothing", "back_off", "sources", "entropy_train", "entropy_test", "heading"):
        del head[name]
    with path.open("wb") as file:
        np.savez(file, head=np.frombuffer(json.dumps(head).encode(), dtype=np.uint8), **arrays)
    back = read_model(path)
    assert (back.automaton.smoothing, back.automaton.back_off, back.reduction.kept) == (0.0, 0.0, 1.0)
    assert back.making.sources == ()
    assert np.isnan(back.making.entropy_train)
    assert np.isnan(back.making.entropy_test)


def test_a_model_of_before_the_floors_has_clusters_without_one(model: BehaviourModel, tmp_path: Path) -> None:
    path = tmp_path / "old.behaviour"
    write_model(model, path)
    settings = asdict(model.making.settings)
    del settings["cluster_floor"]
    rewritten(path, settings=settings)
    assert read_model(path).making.settings == replace(model.making.settings, cluster_floor=0.0)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(BehaviourError, match=r"no behaviour model 'gone.behaviour'"):
        read_model(tmp_path / "gone.behaviour")


def _zip() -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("hello.txt", "hello")
    return content.getvalue()


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 not really", _zip(), b"\x93NUMPY"])
def test_no_model_at_all(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "odd.behaviour"
    path.write_bytes(content)
    with pytest.raises(BehaviourError, match=r"'odd.behaviour' is not a behaviour model") as refusal:
        read_model(path)
    assert "studio learn" in refusal.value.hint


def test_damaged_files(model: BehaviourModel, tmp_path: Path) -> None:
    path = tmp_path / "torn.behaviour"
    write_model(model, path)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for end in rng.integers(0, len(whole) - 1, 20):
        path.write_bytes(whole[:end])
        with pytest.raises(BehaviourError, match="damaged"):
            read_model(path)
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 0xFF
    path.write_bytes(bytes(flipped))
    with pytest.raises(BehaviourError, match="damaged"):
        read_model(path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"version": VERSION + 1}, f"version {VERSION + 1}; this program reads version {VERSION}"),
        ({"kind": "something else"}, "not a behaviour model"),
        ({"parameters": ["one"]}, "not a behaviour model"),
        ({"settings": {"memory": "long", "unknown": 3}}, "not a behaviour model"),
        ({"fps": "fast"}, "not a behaviour model"),
    ],
)
def test_other_heads(model: BehaviourModel, tmp_path: Path, changes: dict[str, object], words: str) -> None:
    path = tmp_path / "other.behaviour"
    write_model(model, path)
    rewritten(path, **changes)
    with pytest.raises(BehaviourError, match=words):
        read_model(path)


def test_a_place_that_cannot_be_written(model: BehaviourModel, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(BehaviourError, match="cannot be written"):
        write_model(model, tmp_path / "file" / "model.behaviour")
