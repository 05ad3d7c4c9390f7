"""Archives are read one at a time: NumPy's reading of heads is not safe in several threads. Runs and rows."""

import io
import os
import threading
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from studio import arrays
from studio.arrays import read_archive

LOAD = np.load


def test_names_and_values_come_back_from_a_path_and_a_stream(tmp_path: Path) -> None:
    wanted = {"one": np.arange(6.0).reshape(2, 3), "two": np.array(["a", "b"])}
    np.savez(tmp_path / "both.npz", **wanted)
    for source in (tmp_path / "both.npz", io.BytesIO((tmp_path / "both.npz").read_bytes())):
        found = read_archive(source)
        assert found.keys() == wanted.keys()
        assert all(np.array_equal(found[name], wanted[name]) for name in wanted)


def test_archives_are_never_read_by_two_threads_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    inside, most = [], []

    class Watched:
        """An archive whose reading takes a while."""

        def __init__(self, source: io.BytesIO, **how: bool) -> None:
            self.archive = LOAD(source, **how)

        def __enter__(self) -> object:
            inside.append(threading.get_ident())
            most.append(len(inside))
            time.sleep(0.01)
            return self.archive

        def __exit__(self, *_: object) -> None:
            inside.pop()

    monkeypatch.setattr(arrays.np, "load", Watched)
    stream = io.BytesIO()
    np.savez(stream, values=np.arange(5.0))
    with ThreadPoolExecutor(4) as threads:
        read = list(threads.map(lambda _: read_archive(io.BytesIO(stream.getvalue())), range(12)))
    assert all(np.array_equal(arrays["values"], np.arange(5.0)) for arrays in read)
    assert most == [1] * 12


def test_a_damaged_archive_does_not_stay_open(tmp_path: Path) -> None:
    place = tmp_path / "damaged.npz"
    np.savez(place, one=np.arange(6.0))
    place.write_bytes(place.read_bytes()[:-20])
    with pytest.raises(zipfile.BadZipFile):
        read_archive(place)
    assert str(place) not in [
        os.path.realpath(f"/proc/self/fd/{number}") for number in os.listdir("/proc/self/fd")
    ]


def test_runs_of_a_mask_and_rows_evenly_spread() -> None:
    mask = np.array([True, True, False, True, False, False, True])
    assert arrays.runs_of(mask) == [(0, 2), (3, 4), (6, 7)]
    assert arrays.runs_of(np.zeros(4, dtype=bool)) == []
    assert arrays.evenly_spread(10, 4).tolist() == [0, 3, 6, 9]
    assert arrays.evenly_spread(3, 10).tolist() == [0, 1, 2]
