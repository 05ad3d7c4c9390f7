"""A model's file: the same model is read back, and other files are refused."""

import io
import json
import zipfile
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


def rewritten(path: Path, **changes: object) -> None:
    """Changes entries of a model's head in its file."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
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
