"""How a verb tells what it does: to a function of one's own, or in a bar where somebody is looking."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as Bar

from studio.progress import Progress, TimeLeft, left_in_words

Told = Progress | bool | None
"""A function of one's own; True for a bar, False for nothing; None for a bar where somebody is looking."""


@contextmanager
def told(progress: Told, title: str) -> Iterator[Progress]:
    """What a verb reports to. A function that raises ends the verb, and nothing half done is kept."""
    if callable(progress):
        yield progress
        return
    console = Console(stderr=True, highlight=False)
    if progress is False or (progress is None and not (console.is_terminal or console.is_jupyter)):
        yield _nobody
        return
    with bar(console, title) as report:
        yield report


@contextmanager
def bar(console: Console, title: str) -> Iterator[Progress]:
    """A bar with the time that is left."""
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
                description=step or title,
                completed=done,
                total=total or None,
                left=left_in_words(left.after(step, done, total)),
                speed=f"{finished.speed:.1f}/s" if finished.speed else "",
            )

        yield report


def _nobody(_step: str, _done: int, _total: int) -> None:
    """Nobody is looking."""
