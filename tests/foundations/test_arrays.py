"""Archives of bounded size, whose heads are parsed one at a time: NumPy's reading of them is not safe in several
threads. Runs and rows.
"""

import io
import os
import threading
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from studio.foundations import arrays
from studio.foundations.arrays import read_archive


def test_names_and_values_come_back_from_a_path_and_a_stream(tmp_path: Path) -> None:
    wanted = {"one": np.arange(6.0).reshape(2, 3), "two": np.array(["a", "b"])}
    np.savez(tmp_path / "both.npz", **wanted)
    for source in (tmp_path / "both.npz", io.BytesIO((tmp_path / "both.npz").read_bytes())):
        found = read_archive(source)
        assert found.keys() == wanted.keys()
        assert all(np.array_equal(found[name], wanted[name]) for name in wanted)


def test_heads_are_never_parsed_by_two_threads_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    inside, most = [], []
    parse = np.lib.format.read_array_header_1_0

    def watched(stream: io.BytesIO) -> object:
        inside.append(threading.get_ident())
        most.append(len(inside))
        time.sleep(0.01)
        found = parse(stream)
        inside.pop()
        return found

    monkeypatch.setattr(np.lib.format, "read_array_header_1_0", watched)
    stream = io.BytesIO()
    np.savez(stream, values=np.arange(5.0))
    with ThreadPoolExecutor(4) as threads:
        read = list(threads.map(lambda _: read_archive(io.BytesIO(stream.getvalue())), range(12)))
    assert all(np.array_equal(arrays["values"], np.arange(5.0)) for arrays in read)
    assert most == [1] * 12


def test_sizes_and_names_are_checked_before_anything_is_read(tmp_path: Path) -> None:
    place = tmp_path / "large.npz"
    np.savez_compressed(place, values=np.zeros(3_000_000))
    assert place.stat().st_size < 100_000
    with pytest.raises(ValueError, match="MB"):
        read_archive(place, 20 << 20)
    assert read_archive(place, 30 << 20)["values"].shape == (3_000_000,)
    with zipfile.ZipFile(place, "w") as packed:
        head = "{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000,), }".ljust(117) + "\n"
        packed.writestr("claims.npy", b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode())
    with pytest.raises(ValueError, match="not an array of its size"):
        read_archive(place)
    with zipfile.ZipFile(place, "w") as packed:
        for number in range(arrays.MOST_ARRAYS + 1):
            packed.writestr(f"{number}.npy", b"")
    with pytest.raises(ValueError, match="arrays"):
        read_archive(place)


def test_arrays_are_those_that_numpy_reads(tmp_path: Path) -> None:
    wanted = {
        "by_column": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "empty": np.zeros((0, 4)),
        "text": np.array("words"),
        "flags": np.array([True, False]),
    }
    np.savez_compressed(tmp_path / "all.npz", **wanted)
    found = read_archive(tmp_path / "all.npz")
    assert all(np.array_equal(found[name], wanted[name]) for name in wanted)
    assert all(found[name].dtype == wanted[name].dtype and found[name].flags.writeable for name in wanted)


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
