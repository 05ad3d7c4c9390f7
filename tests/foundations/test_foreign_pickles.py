"""Pickles of other programs: arrays and plain values come out, nothing of them runs."""

import os
import pickle

import numpy as np
import pytest

from studio.foundations.foreign_pickles import read_plain_pickle

CAMERA = {
    "intrinsicMat": np.arange(9.0).reshape(3, 3),
    "distortion": np.array([[0.1, -0.2, 1e-3, 0.0, 0.0]]),
    "imageSize": np.array([[1920], [1080]]),
    "rotation": np.asfortranarray(np.arange(9.0).reshape(3, 3)),
    "names": np.array(["a", "bc"]),
}


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_arrays_and_plain_values_come_out(protocol: int) -> None:
    found = read_plain_pickle(pickle.dumps({**CAMERA, "one": np.float32(0.5), "two": ("x", 1)}, protocol))
    for name, wanted in CAMERA.items():
        np.testing.assert_array_equal(found[name], wanted)
    assert (found["one"], found["two"]) == (0.5, ["x", 1])


def laughing() -> bytes:
    value: list[object] = ["ha"]
    for _ in range(7):
        value = [value] * 100
    return pickle.dumps(value)


@pytest.mark.parametrize(
    "content",
    [
        pickle.dumps(os.system),
        b"cos\nsystem\n(S'touch /tmp/ran'\ntR.",
        b"cbuiltins\neval\n(S'1'\ntR.",
        b"cnumpy\ndtype\n(S'O8'\ntR.",
        pickle.dumps(np.array([object()], dtype=object).dtype),
        pickle.dumps({"a": np.array([{}], dtype=object)}),
        laughing(),
        pickle.dumps([[[[[[[[[[1]]]]]]]]]]),
        b"",
        b"\x80\x04junk",
        pickle.dumps(CAMERA)[:-20],
        b"(lp0\n" + b"0" * (2 << 20),
    ],
)
def test_anything_else_is_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match=r"pickle|array"):
        read_plain_pickle(content)


def test_an_array_is_of_its_size() -> None:
    content = pickle.dumps(np.zeros(4), 2)
    with pytest.raises(ValueError, match="size"):
        read_plain_pickle(content.replace(b"K\x04\x85", b"K\x05\x85"))
