"""Compiled kernels are found again by what they are made of, in any checkout."""

import gc
import hashlib
import importlib
import os
import pickle
import stat
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numba.core import event
from numba.core.dispatcher import Dispatcher

from studio.foundations import kernel_cache
from studio.foundations.kernel_cache import parts_of
from studio.sessions.process_lock import ProcessLock

ROOT = Path(__file__).resolve().parents[2]
HELPERS = """
from typing import NamedTuple
import numpy as np
from studio.foundations.numba_in_threads import EXACT_INLINED, njit

class Sizes(NamedTuple):
    first: float
    second: float

OFFSET, TABLE = 2.0, np.array([1.0, 5.0])

@njit(**EXACT_INLINED)
def scaled(x):
    return 3.0 * x

def squared(x):
    return x * x
"""
KERNELS = """
import helpers
from helpers import OFFSET, TABLE, scaled
from studio.foundations.numba_in_threads import FAST, KERNEL, njit

own = njit(**KERNEL)(helpers.squared)

@njit(**FAST)
def total(x, sizes):
    return scaled(x) + OFFSET + TABLE[1] + sizes.first + own(x) + later(x)

@njit(**KERNEL)
def later(x):
    return 100.0 * x
"""


class Compilations(event.Listener):
    """Names of what is compiled."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def on_start(self, event: event.Event) -> None:
        """Nothing yet."""

    def on_end(self, event: event.Event) -> None:
        self.names.append(event.data["dispatcher"].py_func.__name__)


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """What is compiled from here on; kernels are kept in a folder of the test's own."""
    monkeypatch.setattr(kernel_cache, "folder", lambda: tmp_path / "kept")
    listener = Compilations()
    with event.install_listener("numba:compile", listener):
        yield listener.names


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., ModuleType]:
    """Makes the two modules in a folder and loads the kernels."""

    def made(
        folder: str, helpers: str = HELPERS, kernels: str = KERNELS, name: str = "kernels"
    ) -> ModuleType:
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "helpers.py").write_text(helpers)
        module = tmp_path / folder / f"{name.replace('.', '/')}.py"
        module.parent.mkdir(exist_ok=True)
        module.write_text(kernels)
        with monkeypatch.context() as patched:
            patched.syspath_prepend(tmp_path / folder)
            for loaded in ("helpers", name):
                patched.delitem(sys.modules, loaded, raising=False)
            return importlib.import_module(name)

    return made


def answer(module: ModuleType) -> float:
    return module.total(2.0, module.helpers.Sizes(10.0, 20.0))


def test_another_checkout_finds_what_one_compiled(
    compiled: list[str], checkout: Callable[..., ModuleType]
) -> None:
    assert answer(checkout("one")) == 6.0 + 2.0 + 5.0 + 10.0 + 4.0 + 200.0
    assert sorted(compiled) == ["later", "scaled", "squared", "total"]
    compiled.clear()
    moved = "# A line more, and a comment.\n" + KERNELS
    assert answer(checkout("two", kernels=moved)) == 227.0
    assert not compiled


def test_a_kernel_whose_module_was_moved_is_another(
    compiled: list[str],
    checkout: Callable[..., ModuleType],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    answer(checkout("one"))
    compiled.clear()
    monkeypatch.delitem(sys.modules, "kernels")
    assert answer(checkout("two", name="elsewhere.kernels")) == 227.0
    assert sorted(compiled) == ["later", "total"]
    assert not caplog.records


@pytest.mark.parametrize(
    ("old", "new", "expected", "anew"),
    [
        ("3.0 * x", "4.0 * x", 229.0, ["scaled", "total"]),
        ("OFFSET, TABLE = 2.0", "OFFSET, TABLE = 7.0", 232.0, ["total"]),
        ("[1.0, 5.0]", "[1.0, 8.0]", 230.0, ["total"]),
        ("x * x", "x * x * x", 231.0, ["squared", "total"]),
        ("first: float\n    second: float", "second: float\n    first: float", 237.0, ["total"]),
    ],
)
def test_what_a_change_reaches_is_compiled_anew(
    old: str,
    new: str,
    expected: float,
    anew: list[str],
    compiled: list[str],
    checkout: Callable[..., ModuleType],
) -> None:
    answer(checkout("one"))
    compiled.clear()
    assert old in HELPERS
    assert answer(checkout("two", HELPERS.replace(old, new))) == expected
    assert sorted(compiled) == anew


def test_a_damaged_file_and_a_folder_that_cannot_be_written_cost_a_compilation(
    compiled: list[str], checkout: Callable[..., ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer(checkout("one"))
    (kept,) = (tmp_path / "kept").glob("kernels.total-*")
    kept.write_bytes(kept.read_bytes()[:-100])
    compiled.clear()
    assert answer(checkout("two")) == 227.0
    assert compiled == ["total"]
    assert answer(checkout("three")) == 227.0
    assert compiled == ["total"]
    monkeypatch.setattr(kernel_cache, "folder", lambda: kept)
    assert answer(checkout("four")) == 227.0
    assert sorted(compiled) == ["later", "scaled", "squared", "total", "total"]


@pytest.mark.parametrize("planted", ["of another", "writable", "a link", "a wrong pickle"])
def test_what_another_may_have_put_there_is_not_run(
    planted: str,
    compiled: list[str],
    checkout: Callable[..., ModuleType],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answer(checkout("one"))
    (kept,) = (tmp_path / "kept").glob("kernels.total-*")
    assert (kept.stat().st_mode | kept.parent.stat().st_mode) & 0o077 == 0

    class Harmful:
        def __reduce__(self) -> tuple[object, ...]:
            return Path.touch, (tmp_path / "it-ran",)

    content = pickle.dumps(Harmful() if planted != "a wrong pickle" else "words")
    kept.write_bytes(hashlib.sha256(content).digest() + content)
    user = os.geteuid()
    if planted == "of another":
        monkeypatch.setattr(os, "fstat", lambda handle: another(os.stat(handle), user))
    elif planted == "writable":
        kept.chmod(0o666)
    elif planted == "a link":
        (tmp_path / "kept").rename(tmp_path / "elsewhere")
        (tmp_path / "kept").symlink_to(tmp_path / "elsewhere")
    compiled.clear()
    assert answer(checkout("two")) == 227.0
    assert "total" in compiled
    assert not (tmp_path / "it-ran").exists()


def another(status: os.stat_result, user: int) -> os.stat_result:
    """The status of a file as if it belonged to another user."""
    values = list(status)
    values[stat.ST_UID] = user + 1
    return os.stat_result(values)


def test_in_a_shared_folder_each_user_has_one_of_his_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    tmp_path.chmod(0o777)
    kernel_cache.folder.cache_clear()
    try:
        assert kernel_cache.folder().parent == tmp_path
        tmp_path.chmod(0o700)
        kernel_cache.folder.cache_clear()
        assert kernel_cache.folder() == tmp_path
    finally:
        kernel_cache.folder.cache_clear()


def test_who_compiles_it_just_now_is_waited_for(
    compiled: list[str], checkout: Callable[..., ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer(checkout("one"))
    assert not list((tmp_path / "kept").glob("*.turn"))
    (kept,) = (tmp_path / "kept").glob("kernels.total-*")
    content = kept.read_bytes()
    compiled.clear()
    kept.unlink()
    other = ProcessLock.take(kept.with_suffix(".turn"))

    def ends() -> None:
        kept.write_bytes(content)
        other.free()

    ending = threading.Timer(0.3, ends)
    ending.start()
    assert answer(checkout("two")) == 227.0
    ending.join()
    assert not compiled
    # One that never ends is not waited for forever.
    kept.unlink()
    other = ProcessLock.take(kept.with_suffix(".turn"))
    monkeypatch.setattr(kernel_cache, "PATIENCE_S", 0.1)
    assert answer(checkout("three")) == 227.0
    assert compiled == ["total"]
    other.free()


def digests() -> dict[str, str]:
    """Of every kernel of the product. Raises UnkeyedError where one could not be kept."""
    found: dict[str, str] = {}
    for path in sorted((ROOT / "studio").rglob("*.py")):
        if "numba_in_threads import" in path.read_text("utf-8"):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            module: dict[str, Any] = vars(importlib.import_module(name))
            for kernel in (one for one in module.values() if isinstance(one, Dispatcher)):
                key = f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"
                found[key] = hashlib.sha256(b"".join(parts_of(kernel))).hexdigest()
    return found


@pytest.mark.slow
def test_every_kernel_of_the_product_has_the_same_key_in_another_process() -> None:
    program = "from test_kernel_cache import digests; print(digests())"
    environment = os.environ | {"PYTHONPATH": str(ROOT / "tests"), "PYTHONHASHSEED": "5"}
    ended = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    here = digests()
    assert len(here) > 150
    assert ended.stdout.strip() == str(here)


def test_what_has_no_key_is_named() -> None:
    with pytest.raises(kernel_cache.UnkeyedError, match="object"):
        list(parts_of((1, np.float32(2.0), object())))


def test_what_was_not_used_for_longest_goes_where_the_folder_is_full(
    checkout: Callable[..., ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel_cache, "folder", lambda: tmp_path / "kept")
    answer(checkout("one"))
    room = tmp_path / "kept"
    sizes = {place.name.partition("-")[0]: place.stat().st_size for place in room.glob("*.kernel")}
    for place in room.glob("*.kernel"):
        os.utime(place, (1.0, 1.0))
    monkeypatch.setattr(kernel_cache, "MOST_BYTES", sum(sizes.values()) + 5000)
    # Another that calls the same ones: of all that is there it has no use for `total` alone.
    third = checkout("two", kernels=KERNELS.replace("def total", "def sum_of"))
    third.sum_of(2.0, third.helpers.Sizes(10.0, 20.0))
    left = {place.name.partition("-")[0] for place in room.glob("*.kernel")}
    assert left == {*sizes, "kernels.sum_of"} - {"kernels.total"}


def test_something_is_done_once_before_the_first_kernel_is_compiled(
    compiled: list[str], checkout: Callable[..., ModuleType]
) -> None:
    before: list[int] = []
    with kernel_cache.when_compiling(lambda: before.append(len(compiled))):
        answer(checkout("one"))
    assert before == [0]
    with kernel_cache.when_compiling(lambda: before.append(-1)):
        answer(checkout("two"))
    answer(checkout("three", HELPERS.replace("x * x", "x + x")))
    assert before == [0]


def test_a_kernel_within_a_kernel_has_no_wrapper_and_can_be_called_as_well(
    checkout: Callable[..., ModuleType],
) -> None:
    module = checkout("one")
    answer(module)
    assert not module.later.overloads  # compiled for `total`, and not to be called from Python
    assert module.later(2.0) == 200.0
    assert module.later.overloads


def test_the_collector_rests_while_something_is_compiled() -> None:
    assert gc.isenabled()
    with event.trigger_event("numba:compile"):
        assert not gc.isenabled()
        with event.trigger_event("numba:compile"):
            assert not gc.isenabled()
        assert not gc.isenabled()
    assert gc.isenabled()
