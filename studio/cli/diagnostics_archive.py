"""One archive about an installation and its workspace for a helper: no footage, no poses, no secrets, no names.

Every text in it is written with the studio's own words: a word that occurs neither in the studio's source nor among the
messages of the system becomes "…", and sessions, runs and cameras are numbered. What a log or a remark quotes of a
person's files, folders, addresses or tokens therefore cannot get into it, however it came there.
"""

import builtins
import datetime
import errno
import getpass
import importlib.metadata
import io
import json
import os
import platform
import re
import shutil
import zipfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Annotated

from pydantic import Field

from studio.cli.launch import LOG_NAME, served_at
from studio.cli.self_check import PACKAGE, doctor
from studio.foundations.declaring import Terminal
from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import open_file, read_text
from studio.foundations.package import package_folder
from studio.foundations.typed_decoding import is_list, is_table
from studio.operations.overview import run_log
from studio.sessions.atomic_files import taken, write_bytes
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.work_under_way import STATE_NAME
from studio.sessions.workspace import Workspace

USUAL_NAME = Path("studio-diagnostics.zip")
LOG_TAIL = 200_000
"""Bytes of each log that are taken, the newest."""
NEWEST_RUNS, RUN_LINES = 20, 50
VARIABLES = (
    "STUDIO_WORKSPACE",
    "STUDIO_TRACEBACK",
    "NUMBA_NUM_THREADS",
    "NUMBA_DISABLE_JIT",
    "OMP_NUM_THREADS",
)
ADDRESS = re.compile(r"\b[a-zA-Z][\w+.-]*://\S+|\b\d{1,3}(?:\.\d{1,3}){3}\b|\S+@\S+")
SECRET = re.compile(r"[A-Za-z0-9_+/=-]{20,}")
WORD = re.compile(r"\w+")
LONGEST_NUMBER = 12
GONE = "…"
README = """Made by `studio diagnostics`. Look through it before you send it.

doctor.json       what `studio doctor` tried, and what it found
environment.json  system, versions, threads, disk; of environment variables the names, and values that are numbers
sessions.json     sessions and runs, numbered: sizes, settings, states, the last lines of the runs' logs
server*.log       warnings and errors of the server

No pictures, videos, poses, names, paths, addresses or tokens: words that are not the studio's own stand here as "…".
"""


def diagnostics(
    out: Annotated[
        Path, Field(description="The archive to write; it must not exist."), Terminal("--out")
    ] = USUAL_NAME,
    workspace: Annotated[Workspace | None, Terminal(left_out=True)] = None,
) -> tuple[Path, tuple[str, ...]]:
    """Write what a helper needs into one archive: no footage, no names, no secrets; and list what is in it.

    Raises SessionError for a place that is taken or cannot be written.
    """
    if out.exists():
        raise taken(out)
    place = workspace or Workspace()
    words = Redaction(place)
    parts = {
        "README.txt": README,
        "doctor.json": _json([asdict(one) for one in doctor(place)], words),
        "environment.json": _json(_environment(place.root), words),
        "sessions.json": _json([*_sessions(place, words)], words),
    }
    for log in sorted((place.root / STATE_NAME).glob(f"{LOG_NAME}*")):
        parts[log.name] = words(_tail(log))
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(name, text)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(out, content.getvalue())
    return out, tuple(parts)


class Redaction:
    """Called with a text, it returns it without anything that is a person's own.

    numbers : what a session, run or camera is called instead of its name, by name.
    """

    def __init__(self, workspace: Workspace) -> None:
        self.numbers: dict[str, str] = {_user(): "user", platform.node(): "host"}
        for number, summary in enumerate(workspace.sessions(), 1):
            self.numbers[summary.name] = f"session-{number}"
            for camera, name in enumerate(summary.cameras, 1):
                self.numbers.setdefault(name, f"camera-{camera}")
            for run, entry in enumerate(summary.runs, 1):
                self.numbers.setdefault(entry.name, f"run-{run}")
        # The longest first: a name may begin with another one.
        names = [name for name in self.numbers if name and not name.isdigit()]
        known = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
        self._names = re.compile(rf"(?<!\w)(?:{known})(?!\w)") if known else None

    def __call__(self, text: str) -> str:
        """The text without names, addresses, secrets and words that are not the studio's own."""
        text = ADDRESS.sub(GONE, text)
        if self._names is not None:
            text = self._names.sub(lambda match: self.numbers[match[0]], text)
        text = SECRET.sub(lambda match: match[0] if _all_known(match[0]) else GONE, text)
        return WORD.sub(lambda match: match[0] if _is_known(match[0]) else GONE, text)


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return ""


def _is_known(word: str) -> bool:
    if word.isascii() and word.isdigit():
        return len(word) <= LONGEST_NUMBER
    return word.lower() in vocabulary()


def _all_known(text: str) -> bool:
    return all(_is_known(word) for word in WORD.findall(text))


@cache
def vocabulary() -> frozenset[str]:
    """Every word, lower case, of the studio's source, the system's messages and Python's own names."""
    texts: Iterable[str] = (read_text(path) for path in sorted(package_folder().rglob("*.py")))
    known = {word for text in texts for word in WORD.findall(text.lower())}
    for other in (*map(os.strerror, errno.errorcode), *dir(builtins), README, PACKAGE):
        known.update(WORD.findall(other.lower()))
    return frozenset(known)


def _json(value: object, words: Callable[[str], str]) -> str:
    """The value as JSON, every text in it redacted; names of entries are the studio's own."""

    def plain(part: object) -> object:
        if isinstance(part, str):
            return words(part)
        if is_table(part):
            return {key: plain(entry) for key, entry in part.items()}
        if is_list(part):
            return [plain(entry) for entry in part]
        return part

    return json.dumps(plain(value), indent=1, ensure_ascii=False)


def _environment(root: Path) -> dict[str, object]:
    existing = next(folder for folder in (root, *root.parents) if folder.exists())
    return {
        "made": datetime.datetime.now(datetime.UTC).strftime("%Y %m %d %H %M"),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {
            name: _version(name)
            for line in [PACKAGE, *(importlib.metadata.requires(PACKAGE) or [])]
            if (name := re.split(r"[^A-Za-z0-9_.-]", line)[0])
        },
        "cores": os.cpu_count(),
        "memory": _memory(),
        "free on disk": shutil.disk_usage(existing).free,
        "served": bool(served_at(root)),
        "variables": {
            name: float(value) if _is_number(value) else "set"
            for name in VARIABLES
            if (value := os.environ.get(name)) is not None
        },
    }


def _memory() -> int | None:
    """Bytes of the machine, None where the system does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def _is_number(text: str) -> bool:
    return re.fullmatch(r"\d{1,6}(\.\d+)?", text, re.ASCII) is not None


def _version(name: str) -> list[int]:
    """As numbers, which are no words."""
    try:
        return [int(part) for part in re.findall(r"\d+", importlib.metadata.version(name))]
    except importlib.metadata.PackageNotFoundError:
        return []


def _sessions(workspace: Workspace, words: Redaction) -> Iterator[dict[str, object]]:
    for summary in workspace.sessions():
        entry: dict[str, object] = {
            "session": words.numbers[summary.name],
            "created": summary.created,
            "problem": summary.problem,
            "body": summary.body,
            "frames": summary.frames,
            "fps": summary.fps,
            "cameras": len(summary.cameras),
            "truth": summary.has_truth,
            "warnings": list(summary.warnings),
        }
        if not summary.problem:
            session = workspace.session(summary.name)
            entry |= {"sources": _sources(session), "calibrated": session.is_calibrated}
            entry["runs"] = [_run(run) for run in session.runs()[-NEWEST_RUNS:]]
        yield entry


def _sources(session: Session) -> list[dict[str, object]]:
    """Kind and size of each camera's footage."""
    return [
        {"kind": source.kind, "width": source.width, "height": source.height, "frames": source.frame_count}
        for source in session.manifest.footage.cameras
    ]


def _run(run: StoredRun) -> dict[str, object]:
    """What there is to know of a run but what it found. What cannot be read says why."""
    about: dict[str, object] = {"run": run.name}
    try:
        record, summary = run.record, run.summary(blobs=False)
        about |= {
            "software": record.software,
            "status": summary.status,
            "frames": [summary.first, summary.last, summary.done],
            "damaged": list(summary.damaged),
            "tracker": record.tracker,
            "weighting": record.weighting,
            "live": record.live,
            "seed": record.seed,
            "settings": dict(record.settings),
        }
        with run.results() as results:
            states = results.timeline().tracking
        about["states"] = {state: list(states).count(state) for state in dict.fromkeys(states)}
    except StudioError as error:
        about["problem"] = str(error)
    about["log"] = [f"{line.level}: {line.text}" for line in run_log(run, RUN_LINES).lines]
    return about


def _tail(path: Path) -> str:
    """The end of a text file, whole lines; why it cannot be read instead."""
    try:
        with open_file(path) as stream:
            stream.seek(max(0, path.stat().st_size - LOG_TAIL))
            return stream.read(LOG_TAIL).decode("utf-8", "replace")
    except StudioError as error:
        return str(error)
    except OSError as error:
        return f"cannot be read ({error.strerror})"
