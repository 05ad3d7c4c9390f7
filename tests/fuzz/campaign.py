"""Many mutations, read in a process that may crash or hang; and the table of what became of them."""

import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field

LONGEST_SECONDS = 10.0
"""Of the reading process's own time."""
PATIENCE = 120.0
"""Seconds without a word, however busy the machine is."""


@dataclass
class Tally:
    """Of one format. failures : the number of the mutation, and what came of it."""

    tries: int = 0
    read: int = 0
    refused: int = 0
    tracebacks: int = 0
    aborts: int = 0
    hangs: int = 0
    seconds: float = 0.0
    failures: list[tuple[int, str]] = field(default_factory=list)


def campaign(
    names: Sequence[str],
    count: int,
    first: int = 0,
    *,
    module: str = "fuzz.reading",
    patience: float = PATIENCE,
) -> dict[str, Tally]:
    """Read `count` mutations, a format after the other. module : of the process that reads."""
    tallies = {name: Tally() for name in names}
    place, last = first * len(names), first * len(names) + count
    while place < last:
        place = _reads(names, place, last, tallies, module, patience)
    return tallies


def _reads(
    names: Sequence[str], place: int, last: int, tallies: dict[str, Tally], module: str, patience: float
) -> int:
    """Read from `place` until all is read, or the process ends or hangs; returns the place to go on from."""
    process = subprocess.Popen(
        [sys.executable, "-m", module, str(place), str(last - place), *names],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    said: queue.SimpleQueue[str] = queue.SimpleQueue()
    stream = process.stdout

    def listen() -> None:
        for line in stream:
            said.put(line)
        said.put("")

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    at, began = place, False
    try:
        while at < last:
            tally, number = tallies[names[at % len(names)]], at // len(names)
            try:
                line = said.get(timeout=patience)
            except queue.Empty:
                tally.hangs += 1
                tally.failures.append((number, f"no answer in {patience:g} s"))
                break
            if not line:
                assert began or at > place, "the reading process did not start"
                tally.aborts += 1
                tally.failures.append((number, f"the process ended with {process.wait()}"))
                break
            _, what, more = json.loads(line)
            began = what == "reads"
            if not began:
                _note(tally, number, what, more)
                at += 1
        else:
            return at
        tally.tries += 1
        return at + 1
    finally:
        process.kill()
        process.wait()
        listener.join()
        stream.close()


def _note(tally: Tally, number: int, what: str, seconds: float) -> None:
    tally.tries += 1
    tally.seconds += seconds
    if what in ("read", "refused"):
        setattr(tally, what, getattr(tally, what) + 1)
    else:
        tally.tracebacks += 1
        tally.failures.append((number, what.strip()))
    if seconds > LONGEST_SECONDS:
        tally.hangs += 1
        tally.failures.append((number, f"took {seconds:.0f} s"))


COLUMNS = ("tries", "read", "refused", "tracebacks", "aborts", "hangs")


def table(tallies: dict[str, Tally]) -> str:
    """What became of them, a line a format, and below how each failure is seen again."""
    lines = [f"{'format':24}" + "".join(f"{name:>12}" for name in COLUMNS) + f"{'ms each':>10}"]
    sums = [sum(getattr(tally, name) for tally in tallies.values()) for name in COLUMNS]
    for name, tally in tallies.items():
        counts = "".join(f"{getattr(tally, column):12}" for column in COLUMNS)
        lines.append(f"{name:24}{counts}{1e3 * tally.seconds / max(tally.tries, 1):10.1f}")
    lines.append(f"{f'{len(tallies)} formats':24}" + "".join(f"{value:12}" for value in sums))
    for name, tally in tallies.items():
        # Of what fails in the same way the first is enough.
        alike = {
            text.splitlines()[-1].partition(":")[0]: (number, text) for number, text in tally.failures[::-1]
        }
        lines += [f"--only {name} --first {number} --count 1:\n{text}" for number, text in alike.values()]
    return "\n".join(lines)
