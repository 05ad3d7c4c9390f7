"""`studio doctor` passes here, and names each of the faults that are planted, with a remedy."""

import collections
import importlib
import importlib.metadata
import json
import socket
import sqlite3
import types
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from command_line import call

from studio.cli import self_check as examination
from studio.cli.self_check import Examined, doctor
from studio.foundations.errors import RunError
from studio.search.likelihood.devices import DEVICE_MODULE
from studio.search.likelihood.edge_region import EdgeRegionFrameLikelihood
from studio.sessions.workspace import Workspace

Plant = Callable[[pytest.MonkeyPatch, Path], None]
OPEN: list[socket.socket] = []
Usage = collections.namedtuple("Usage", "total used free")


@pytest.fixture
def free_port(monkeypatch: pytest.MonkeyPatch) -> int:
    with socket.create_server(("127.0.0.1", 0)) as found:
        port = found.getsockname()[1]
    monkeypatch.setattr(examination, "PORT", port)
    return port


def faults(workspace: Path) -> list[Examined]:
    return [one for one in doctor(Workspace(workspace)) if not one.good]


def test_nothing_is_wrong_here(tmp_path: Path, free_port: int) -> None:
    found = doctor(Workspace(tmp_path / "workspace"))
    assert [one for one in found if not one.good] == []
    assert len(found) > 10
    assert list((tmp_path / "workspace").iterdir()) == []


def old_package(patch: pytest.MonkeyPatch, folder: Path) -> None:
    known = importlib.metadata.version
    patch.setattr(importlib.metadata, "version", lambda name: "1.2.3" if name == "numpy" else known(name))


def missing_package(patch: pytest.MonkeyPatch, folder: Path) -> None:
    def version(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    patch.setattr(importlib.metadata, "version", version)


def one_thread(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setattr(examination, "_cores", lambda: 1024)


def no_jpeg(patch: pytest.MonkeyPatch, folder: Path) -> None:
    known = cv2.imencode

    def encode(ending: str, picture: np.ndarray) -> object:
        return (False, None) if ending == ".jpg" else known(ending, picture)

    patch.setattr(cv2, "imencode", encode)


def no_h264(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setattr(examination.av, "codecs_available", examination.av.codecs_available - {"h264"})


def no_pages(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setattr(examination, "assets_folder", lambda: folder / "none")


def no_folder(patch: pytest.MonkeyPatch, folder: Path) -> None:
    (folder / "workspace").write_text("in the way")


def network_share(patch: pytest.MonkeyPatch, folder: Path) -> None:
    known = sqlite3.connect

    class Unshared(sqlite3.Connection):
        def execute(self, sql: str, *values: object) -> sqlite3.Cursor:
            return super().execute(sql.replace("WAL", "DELETE"), *values)

    patch.setattr(sqlite3, "connect", lambda path, **given: known(path, **{**given, "factory": Unshared}))


def full_disk(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setattr(examination.shutil, "disk_usage", lambda path: Usage(1e9, 1e9 - 5e6, 5_000_000))


def taken_port(patch: pytest.MonkeyPatch, folder: Path) -> None:
    taken = socket.create_server(("127.0.0.1", 0))
    patch.setattr(examination, "PORT", taken.getsockname()[1])
    OPEN.append(taken)


def a_card(patch: pytest.MonkeyPatch, weights: Callable[..., object]) -> None:
    """A card whose memory works; `weights` stands for what weighs poses on it."""
    device = importlib.import_module(DEVICE_MODULE)
    patch.setattr(device, "missing", lambda: "")
    there = types.SimpleNamespace(frame=lambda *_: object(), weights=weights)
    patch.setattr(device, "WeighingDevice", lambda *_: there)


def failing_card(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """As numba-cuda 0.30.4 fails beside NumPy 2.5, in the first kernel that it compiles."""

    def fail(*_: object) -> None:
        raise AttributeError("module 'numpy' has no attribute 'row_stack'")

    a_card(patch, fail)


def forgetful_card(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """All that it weighs is nothing."""
    a_card(patch, lambda poses, *_: (np.zeros(len(poses)), np.zeros(len(poses))))


def broken_search(patch: pytest.MonkeyPatch, folder: Path) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RunError("The kernels cannot be compiled.", "Install numba again.")

    patch.setattr(examination, "go_on", fail)


@pytest.mark.parametrize(
    ("plant", "name", "found", "remedy"),
    [
        (old_package, "packages", "numpy 1.2.3 is older", "pip install 'numpy>="),
        (missing_package, "packages", "is missing", "pip install"),
        (one_thread, "threads", "of 1024 cores", "NUMBA_NUM_THREADS"),
        (no_jpeg, "pictures", ".jpg", "opencv-python-headless"),
        (no_h264, "video codecs", "lacks h264", "pip install"),
        (no_pages, "pages", "missing", "Install the studio again"),
        (no_folder, "workspace", "cannot be written", "STUDIO_WORKSPACE"),
        (network_share, "workspace", "cannot be shared", "local disk"),
        (full_disk, "disk", "5 MB are free", "Make room"),
        (taken_port, "port", "cannot be used", "--port 0"),
        (failing_card, "graphics card", "no attribute 'row_stack'", "capture-studio[gpu]"),
        (forgetful_card, "graphics card", "otherwise than on the processor", "set device to cpu"),
        (broken_search, "one frame tracked", "cannot be compiled", "Install numba again"),
    ],
)
def test_each_planted_fault_is_named(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    free_port: int,
    plant: Plant,
    name: str,
    found: str,
    remedy: str,
) -> None:
    if plant is not broken_search:
        monkeypatch.setattr(examination, "_tracked", lambda: "not tried")
    plant(monkeypatch, tmp_path)
    (fault,) = faults(tmp_path / "workspace")
    while OPEN:
        OPEN.pop().close()
    assert fault.name == name
    assert found in fault.found
    assert remedy in fault.remedy


def test_a_card_that_agrees_with_the_processor_is_good(monkeypatch: pytest.MonkeyPatch) -> None:
    """The processor in the card's place: it weighs with another likelihood of the same frame."""
    known = EdgeRegionFrameLikelihood.device_weights

    def weighed(self: EdgeRegionFrameLikelihood, poses: np.ndarray, *rest: object) -> object:
        given = known(self, poses, *rest)
        if given is None:
            return None
        outlines = self.likelihood.projector.blocks(poses)
        weights = self._evaluated(outlines, self.hidden(outlines), len(poses))[1]
        return weights, weights

    a_card(monkeypatch, lambda *_: ())
    monkeypatch.setattr(EdgeRegionFrameLikelihood, "device_weights", weighed)
    assert examination._card() == "its kernels compile, run and agree with the processor"


def test_the_command_ends_with_1_where_something_is_wrong(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, free_port: int
) -> None:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path / "workspace"))
    monkeypatch.setattr(examination, "_tracked", lambda: "not tried")
    call("doctor")
    full_disk(monkeypatch, tmp_path)
    done = call("doctor --json", code=1)
    assert [one["name"] for one in json.loads(done.stdout)["checks"] if not one["good"]] == ["disk"]
