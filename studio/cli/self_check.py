"""Whether this machine can run the studio: everything that it stands on tried once, with what to do where it fails."""

import contextlib
import importlib
import importlib.metadata
import os
import platform
import re
import shutil
import socket
import sqlite3
import struct
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import av
import cv2
import numpy as np

from studio.cli.launch import PORT, served_at
from studio.foundations.declaring import Terminal
from studio.foundations.errors import StudioError
from studio.foundations.numba_in_threads import numba
from studio.foundations.package import assets_folder
from studio.foundations.progress import no_progress
from studio.operations.tracking import go_on, new_run
from studio.runs.problem_source import ProblemSource
from studio.search.likelihood.devices import CPU, DEVICE_MODULE, GPU
from studio.search.settings import changed_settings, default_settings
from studio.sessions.samples import install_sample
from studio.sessions.workspace import Workspace

PACKAGE = "capture-studio"
OLDEST_PYTHON = (3, 11)
LEAST_FREE_BYTES = 2_000_000_000
DECODERS, ENCODERS = ("h264", "hevc", "mjpeg", "mpeg4", "png"), ("libx264",)
ENDINGS = (".png", ".jpg", ".tif")
QUICK = {"particles": 20, "layers": 2}
MOST_APART = 0.01
"""Nats between a pose on the card and on the processor."""


@dataclass(frozen=True, slots=True)
class Examined:
    """name : of the check. good : whether it passed. found : in words. remedy : what to do, "" where it is good."""

    name: str
    good: bool
    found: str
    remedy: str = ""


class _Fault(Exception):
    """What is wrong, and the remedy."""


def doctor(
    workspace: Annotated[Workspace | None, Terminal(left_out=True)] = None,
) -> tuple[Examined, ...]:
    """Try all that the studio stands on, and say what to do where something fails; the command ends with 1 then.

    No check is left out because another failed, and nothing stays behind.
    """
    place = workspace or Workspace()
    checks: tuple[tuple[str, Callable[[], str]], ...] = (
        ("Python", _python),
        ("packages", _packages),
        ("threads", _threads),
        ("pictures", _pictures),
        ("video codecs", _codecs),
        ("pages", _pages),
        ("workspace", lambda: _workspace(place.root)),
        ("disk", lambda: _disk(place.root)),
        ("port", lambda: _port(place.root)),
        ("graphics card", _card),
        ("one frame tracked", _tracked),
    )
    return tuple(_examined(name, check) for name, check in checks)


def _examined(name: str, check: Callable[[], str]) -> Examined:
    try:
        return Examined(name, True, check())
    except _Fault as fault:
        return Examined(name, False, str(fault.args[0]), str(fault.args[1]))
    except StudioError as error:
        return Examined(name, False, error.message, error.hint)
    except Exception as error:
        return Examined(name, False, f"{type(error).__name__}: {error}", "Install the studio again.")


def _python() -> str:
    version = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info[:2] < OLDEST_PYTHON or struct.calcsize("P") != 8:
        raise _Fault(
            f"Python {version}, {8 * struct.calcsize('P')} bits", "Use Python 3.11 or newer, 64 bits."
        )
    return f"{version} on {platform.system()} {platform.machine()}"


def _packages() -> str:
    wanted = [
        found
        for line in importlib.metadata.requires(PACKAGE) or []
        if (found := re.match(r"([A-Za-z0-9_.-]+)[^;]*?>=\s*([\d.]+)", line))
    ]
    for entry in wanted:
        name, least = entry[1], entry[2]
        try:
            there = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            if "extra ==" in entry.string:
                continue
            raise _Fault(f"{name} is missing", f"Install it: pip install '{name}>={least}'.") from None
        if _numbers(there) < _numbers(least):
            raise _Fault(
                f"{name} {there} is older than {least}",
                f"Install a newer one: pip install '{name}>={least}'.",
            )
    return f"{len(wanted)} packages, none too old"


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version)[:3])


def _threads() -> str:
    used, cores = numba.get_num_threads(), _cores()
    if used < cores:
        raise _Fault(
            f"kernels use {used} of {cores} cores",
            "Unset NUMBA_NUM_THREADS, or set it to the number of cores.",
        )
    return f"{used} for kernels, {cores} cores"


def _cores() -> int:
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1


def _pictures() -> str:
    picture = np.full((16, 16, 3), 90, np.uint8)
    for ending in ENDINGS:
        try:
            written, content = cv2.imencode(ending, picture)
            read = cv2.imdecode(content, cv2.IMREAD_COLOR) if written else None
        except cv2.error:
            read = None
        if read is None or np.abs(read.astype(int) - picture).max() > 4:
            raise _Fault(
                f"OpenCV {cv2.__version__} cannot write and read {ending}",
                "Install the usual build: pip install --force-reinstall opencv-python-headless.",
            )
    return f"OpenCV {cv2.__version__} writes and reads {', '.join(ENDINGS)}"


def _codecs() -> str:
    known = av.codecs_available
    missing = [name for name in (*DECODERS, *ENCODERS) if name not in known]
    if missing:
        raise _Fault(
            f"PyAV {av.__version__} lacks {', '.join(missing)}",
            "Install the wheel, which brings them: pip install --force-reinstall --only-binary av av.",
        )
    return f"PyAV {av.__version__} has {', '.join((*DECODERS, *ENCODERS))}"


def _pages() -> str:
    if not (assets_folder() / "index.html").is_file():
        raise _Fault("the studio's pages are missing", "Install the studio again.")
    return "there"


def _workspace(root: Path) -> str:
    try:
        root.mkdir(parents=True, exist_ok=True)
        # What a run needs of a file system: locks, and memory that processes share.
        with (
            tempfile.TemporaryDirectory(dir=root, prefix=".partial-") as folder,
            contextlib.closing(sqlite3.connect(Path(folder) / "try.sqlite")) as connection,
        ):
            mode = connection.execute("PRAGMA journal_mode = WAL").fetchone()[0]
            connection.execute("CREATE TABLE a (b)")
            connection.commit()
    except (OSError, sqlite3.Error) as error:
        raise _Fault(
            f"'{root}' cannot be written ({error})", "Choose another folder with STUDIO_WORKSPACE."
        ) from None
    if mode != "wal":
        raise _Fault(
            f"'{root}' lies where databases cannot be shared ({mode})",
            "Use a local disk, no network share: set STUDIO_WORKSPACE.",
        )
    return f"'{root}' can be written"


def _disk(root: Path) -> str:
    there = next(folder for folder in (root, *root.parents) if folder.exists())
    free = shutil.disk_usage(there).free
    if free < LEAST_FREE_BYTES:
        raise _Fault(
            f"{free / 1e6:.0f} MB are free", "Make room: 2 GB at least, or choose another STUDIO_WORKSPACE."
        )
    return f"{free / 1e9:.0f} GB are free"


def _port(root: Path) -> str:
    address = served_at(root)
    if address:
        return f"the workspace is served at {address}"
    try:
        with socket.create_server(("127.0.0.1", PORT)):
            return f"{PORT} is free"
    except OSError as error:
        raise _Fault(
            f"{PORT} cannot be used ({error.strerror})", "Serve on another one: studio serve --port 0."
        ) from None


def _card() -> str:
    """Evaluates a sample's pose on the card, where there is one, and compares it with the processor."""
    try:
        why = importlib.import_module(DEVICE_MODULE).missing()
    except ImportError as error:
        why = str(error)
    if why:
        return f"none is needed, everything runs on the processor ({why})"
    remedy = (
        "Install the extra again, which brings versions that fit (pip install 'capture-studio[gpu]'), and the card's"
        " driver; or set device to cpu."
    )
    with tempfile.TemporaryDirectory() as folder:
        session = install_sample(Workspace(Path(folder)), "planar_arm")
        body = session.body()
        problems = ProblemSource(session, body)
        pose = np.zeros((1, len(body.parameters)))
        try:
            there, here = (
                problems.problem(
                    0, changed_settings(default_settings(weighting_name="edge-region"), {"device": device})
                ).log_likelihood(pose)
                for device in (GPU, CPU)
            )
        except StudioError as error:
            raise _Fault(error.message, remedy) from None
        finally:
            problems.close()
    if np.abs(there - here).max() > MOST_APART:
        raise _Fault("a pose on the card is weighed otherwise than on the processor", remedy)
    return "its kernels compile, run and agree with the processor"


def _tracked() -> str:
    with tempfile.TemporaryDirectory() as folder:
        session = install_sample(Workspace(Path(folder)), "planar_arm")
        tracked = go_on(new_run(session, last=1, knobs=QUICK, progress=no_progress), progress=no_progress)
    return f"in {tracked.seconds:.1f} s, compiling included"
