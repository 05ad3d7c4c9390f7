"""Where a verb reports its progress: a function, a bar on a terminal, or the caller's display."""

from collections.abc import Callable, Generator, Iterable
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as Bar

from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import read_file
from studio.foundations.progress import Progress, TimeLeft, left_in_words, no_progress
from studio.foundations.typed_decoding import decode_json
from studio.foundations.words import printable
from studio.sessions.atomic_files import write_bytes

SAID = ".notes-said.json"
"""In a session's folder: notes that commands have shown of it."""


@dataclass(frozen=True, slots=True)
class Display:
    """How a command shows the progress of a verb.

    watch : begins a stage with that title.
    say : shows a line.
    """

    watch: Callable[[str], AbstractContextManager[Progress]]
    say: Callable[[str], None]


Reporting = Progress | Display | bool | None
"""A function of one's own; True for a bar, False for nothing; None for a bar on a terminal or in a notebook."""


@contextmanager
def reporting(progress: Reporting, title: str) -> Generator[Progress]:
    """The progress that a verb reports to. A function that raises ends the verb, and nothing half done is kept."""
    console = Console(stderr=True, highlight=False)
    if isinstance(progress, Display):
        with progress.watch(title) as report:
            yield report
    elif callable(progress):
        yield progress
    elif progress or (progress is None and (console.is_terminal or console.is_jupyter)):
        with bar(console, title) as report:
            yield report
    else:
        yield no_progress


def say(progress: Reporting, lines: Iterable[str], once_in: Path | None = None) -> None:
    """Show lines during the verb, if there is a display; for all others they are in the verb's result.

    once_in : a session's folder; each line is shown only the first time for it.
    """
    if isinstance(progress, Display):
        for line in lines if once_in is None else _new_in(once_in, list(lines)):
            progress.say(line)


def _new_in(folder: Path, lines: list[str]) -> list[str]:
    """Lines that were not shown of a session before; they are remembered if possible."""
    known = set[str]()
    with suppress(OSError, StudioError, msgspec.DecodeError):
        known = set(decode_json(read_file(folder / SAID), list[str]))
    new = [line for line in lines if line not in known]
    if new:
        with suppress(StudioError):
            write_bytes(folder / SAID, msgspec.json.encode(sorted(known.union(new))))
    return new


@contextmanager
def bar(console: Console, title: str) -> Generator[Progress]:
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[left]}"),
        TextColumn("{task.fields[speed]}"),
    )
    left = TimeLeft()
    with Bar(*columns, console=console) as shown:
        task = shown.add_task(title, total=None, speed="", left="")

        def report(step: str, done: int, total: int) -> None:
            finished = shown.tasks[task]
            shown.update(
                task,
                description=printable(step or title),
                completed=done,
                total=total or None,
                left=left_in_words(left.after(step, done, total)),
                speed=f"{finished.speed:.1f}/s" if finished.speed else "",
            )

        yield report
