"""Changes drawn by a seed, each made in a copy of the package and shown to the room's tests."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mutants.changes import Change, changes
from mutants.rooms import Room

EQUIVALENT = Path(__file__).with_name("equivalent.toml")
USUAL_SECONDS = 60.0
"""Beside four times what the unchanged tests need: changed kernels are compiled."""


@dataclass
class Tally:
    """Of one room. possible : how many changes there are to draw from. survived : those that no test noticed."""

    possible: int = 0
    drawn: int = 0
    killed: int = 0
    equivalent: int = 0
    survived: list[Change] = field(default_factory=list)


class Campaign:
    """In a checkout. folder : where the copy, its kernels and what became of each change are kept."""

    def __init__(
        self, root: Path, folder: Path, package: str = "studio", equivalent: Path = EQUIVALENT
    ) -> None:
        self._root, self._package = root, package
        self._copy, self._kernels, self._log = folder / "copy", folder / "kernels", folder / "log.jsonl"
        self._equivalent = _listed(equivalent)
        self._became = _read(self._log)
        self._unchanged: dict[tuple[str, ...], float] = {}
        shutil.rmtree(self._copy, ignore_errors=True)
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(root / package, self._copy / package, ignore=ignored)
        self._kernels.mkdir(exist_ok=True)
        for other in root.iterdir():
            if other.name not in (package, "build", ".git"):
                (self._copy / other.name).symlink_to(other)

    def run(self, room: Room, count: int, seed: int, until: float, *, again: bool, whole: bool) -> Tally:
        """Try `count` changes of a room. until : begin none after this time (`time.monotonic`). again : try what
        survived once more. whole : show a change to all tests that reach it, not only to the nearest.
        """
        every = [one for file in room.sources() for one in changes(file, (self._root / file).read_text())]
        tally = Tally(len(every))
        for change in drawn(every, seed)[:count]:
            line = (self._root / change.file).read_text().split("\n")[change.line - 1].strip()
            if (change.file, line, change.words) in self._equivalent:
                tally.drawn, tally.equivalent = tally.drawn + 1, tally.equivalent + 1
                continue
            key = self._key(change)
            if key not in self._became or (again and self._became[key] == "survived"):
                if time.monotonic() > until:
                    continue
                self._note(key, change, self._fate(change, room.tests_of(change.file, whole)))
            tally.drawn += 1
            tally.killed += self._became[key] != "survived"
            if self._became[key] == "survived":
                tally.survived.append(change)
        return tally

    def _fate(self, change: Change, tests: Sequence[str]) -> str:
        if not tests:
            return "survived"
        allowed = 4.0 * self._seconds_unchanged(tuple(tests)) + USUAL_SECONDS
        file = self._copy / change.file
        source = file.read_text()
        try:
            self._write(file, change.applied(source))
            return {0: "survived", None: "timed out"}.get(self._tested(tests, allowed), "killed")
        finally:
            self._write(file, source)

    def _seconds_unchanged(self, tests: tuple[str, ...]) -> float:
        if tests not in self._unchanged:
            began = time.monotonic()
            if self._tested(tests, 3600.0) != 0:
                raise RuntimeError(f"These fail without any change: {' '.join(tests)}.")
            self._unchanged[tests] = time.monotonic() - began
        return self._unchanged[tests]

    def _tested(self, tests: Sequence[str], seconds: float) -> int | None:
        """The exit status of pytest, stopped at the first failure; None when it took too long."""
        options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--rootdir", f"{self._root}"]
        files = [f"{self._root / test}" for test in tests]
        words = [sys.executable, "-P", "-m", "pytest", *options, "-m", "not slow and not browser", *files]
        environment = {
            **os.environ,
            "PYTHONPATH": f"{self._copy}",
            "NUMBA_CACHE_DIR": f"{self._kernels}",
            "NUMBA_NUM_THREADS": "2",
        }
        with subprocess.Popen(
            words,
            # Processes that tests start look for the package there first.
            cwd=self._copy,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ) as child:
            try:
                return child.wait(seconds)
            except subprocess.TimeoutExpired:
                return None
            finally:
                if child.poll() is None:
                    os.killpg(child.pid, signal.SIGKILL)

    def _write(self, file: Path, source: str) -> None:
        """A module, and nothing left of what it was compiled to: the time of a file is too coarse to tell."""
        file.write_text(source)
        for compiled in file.parent.glob(f"__pycache__/{file.stem}.*"):
            compiled.unlink()

    def _key(self, change: Change) -> str:
        source = (self._root / change.file).read_bytes()
        return hashlib.sha256(source + repr(change).encode()).hexdigest()[:20]

    def _note(self, key: str, change: Change, fate: str) -> None:
        self._became[key] = fate
        with self._log.open("a") as log:
            print(json.dumps({"key": key, "fate": fate, "at": f"{change.file}:{change.line}"}), file=log)
        print(f"{fate:10} {change.file}:{change.line} {change.words}", file=sys.stderr, flush=True)


def drawn(every: Sequence[Change], seed: int) -> list[Change]:
    """All changes in an order that depends on the seed; what is changed elsewhere moves none before another."""
    met: Counter[str] = Counter()
    order: list[tuple[str, Change]] = []
    for change in every:
        name = f"{seed} {change.file} {change.words}"
        met[name] += 1
        order.append((hashlib.sha256(f"{name} {met[name]}".encode()).hexdigest(), change))
    return [change for _, change in sorted(order)]


def table(tallies: dict[str, Tally]) -> str:
    """Room by room, and below each change that survived."""
    lines = [
        f"{'room':20}{'changes':>9}{'drawn':>7}{'killed':>8}{'survived':>10}{'equivalent':>12}{'killed of rest':>16}"
    ]
    for name, tally in tallies.items():
        counted = max(tally.drawn - tally.equivalent, 1)
        lines.append(
            f"{name:20}{tally.possible:9}{tally.drawn:7}{tally.killed:8}{len(tally.survived):10}"
            f"{tally.equivalent:12}{tally.killed / counted:15.0%} "
        )
    for tally in tallies.values():
        lines += [f"{one.file}:{one.line}: {one.words}" for one in sorted(tally.survived)]
    return "\n".join(lines)


def _listed(file: Path) -> set[tuple[str, str, str]]:
    listed = tomllib.loads(file.read_text()).get("equivalent", [])
    return {(one["file"], one["line"], one["change"]) for one in listed}


def _read(log: Path) -> dict[str, str]:
    return dict(_lines(log)) if log.is_file() else {}


def _lines(log: Path) -> Iterator[tuple[str, str]]:
    for line in log.read_text().splitlines():
        noted = json.loads(line)
        yield noted["key"], noted["fate"]
