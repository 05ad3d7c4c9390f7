"""What every command shares: `--json`, progress on standard error, errors in words with exit code 2."""

import errno
import functools
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from typing import Any, ParamSpec

import click
import msgspec
from rich.console import Console

from studio.foundations.errors import StudioError
from studio.foundations.progress import Progress, TimeLeft, left_in_words
from studio.foundations.registry import Registry
from studio.foundations.words import printable
from studio.operations.progress import Display, bar

P = ParamSpec("P")

CANCELLED = 130
TERMINATED = 143
FOUND_FAULTS = 1
EXIT_CODE = "exit code"
"""Key of a command's result that is not printed."""
WRONG_INPUT = 2
FAULT = 70
REFUSED_BY_THE_DISK = frozenset((errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOSPC, errno.EDQUOT))
TRACEBACK_VARIABLE = "STUDIO_TRACEBACK"
SECONDS_BETWEEN = 10.0
"""Least between two lines of progress, where no bar can be drawn."""

messages = Console(stderr=True, highlight=False, soft_wrap=True)


class MemberChoice(click.Choice):  # pyright: ignore[reportMissingTypeArgument] - not generic before click 8.2
    """A member of a registry by name; faults of members that packages add are reported when they are chosen."""

    def __init__(self, registry: Registry[Any]) -> None:
        super().__init__(sorted(registry))
        self._registry = registry

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        try:
            self._registry[value]
        except StudioError as problem:
            self.fail(str(problem), param, ctx)
        return value


def command(function: Callable[P, Mapping[str, object]]) -> Callable[P, None]:
    """Make a function that returns its result a command body: prints it, and turns errors into words.

    The result is printed as one JSON object under `--json` (which this decorator adds), else as aligned
    lines; a value under the key "text" is what a person reads instead. EXIT_CODE is what the command ends with.
    """

    @click.option(
        "--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on standard output."
    )
    @functools.wraps(function)
    def body(*arguments: P.args, **options: P.kwargs) -> None:
        as_json = bool(options.pop("as_json"))
        with errors_in_words():
            result = dict(function(*arguments, **options))
            code = int(str(result.pop(EXIT_CODE, 0)))
            print_result(result, as_json)
        if code:
            sys.exit(code)

    return body


def print_result(result: Mapping[str, object], as_json: bool) -> None:
    """Print a result for a person, or as one JSON object."""
    values = dict(result)
    text = values.pop("text", None)
    if as_json:
        click.echo(_without_c1(msgspec.json.encode(values, enc_hook=_plain_value).decode()))
    else:
        lines = "\n".join(f"{key:24} {value}" for key, value in values.items())
        click.echo(printable(str(text) if text is not None else lines))


class TerminatedError(KeyboardInterrupt):
    """The process is to end (SIGTERM): everything that answers Ctrl-C answers this."""


@contextmanager
def termination_as_interrupt() -> Generator[None]:
    """While the block lasts a SIGTERM is raised in it, once, as Ctrl-C is; in the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: object) -> None:
        # What cleans up now is not interrupted again.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise TerminatedError

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def errors_in_words() -> Generator[None]:
    """Turn whatever goes wrong into a cause, a remedy and an exit code; never a traceback."""
    try:
        with termination_as_interrupt():
            yield
    except StudioError as error:
        _say_wrong(error.message, error.hint)
        sys.exit(WRONG_INPUT)
    except TerminatedError:
        messages.print("Ended from outside (SIGTERM); what was finished is kept.")
        sys.exit(TERMINATED)
    except KeyboardInterrupt:
        messages.print("Cancelled; what was finished is kept.")
        sys.exit(CANCELLED)
    except Exception as error:
        if os.environ.get(TRACEBACK_VARIABLE):
            raise
        if isinstance(error, OSError) and error.errno in REFUSED_BY_THE_DISK:
            where = f"'{error.filename}' cannot be used" if error.filename else "The disk refused"
            _say_wrong(f"{where} ({error.strerror}).", "Check the disk's room and the folder's permissions.")
            sys.exit(WRONG_INPUT)
        if isinstance(error, MemoryError):
            _say_wrong(
                "There is not enough memory for this.",
                "Close other programs, or raise the limit (ulimit -v).",
            )
            sys.exit(WRONG_INPUT)
        _say_wrong(
            f"{type(error).__name__}: {error}",
            f"This is a fault of the studio: set {TRACEBACK_VARIABLE}=1 to see where.",
        )
        sys.exit(FAULT)


def _say_wrong(cause: str, remedy: str) -> None:
    messages.print(f"[bold red]error[/] {_plain(cause)}")
    if remedy:
        messages.print(f"[bold]remedy[/] {_plain(remedy)}")


def _plain(text: str) -> str:
    return printable(text).replace("[", "\\[")


def _without_c1(text: str) -> str:
    """JSON with the control characters that its own rules leave as they are."""
    return re.sub(r"[\x7f-\x9f]", lambda one: f"\\u{ord(one[0]):04x}", text)


def _plain_value(value: object) -> object:
    """Arrays and paths as JSON values (NaN becomes null)."""
    as_list = getattr(value, "tolist", None)
    return as_list() if callable(as_list) else str(value)


def note(text: str) -> None:
    """A line for the person at the terminal, on standard error."""
    messages.print(_plain(text))


@contextmanager
def progress(title: str) -> Generator[Progress]:
    """Progress on standard error with the time that is left; yields `report(step in words, done, total)`.

    A bar on a terminal; in a log file a line now and then.
    """
    if not messages.is_terminal:
        yield progress_lines(title)
        return
    with bar(messages, title) as report:
        yield report


def progress_lines(title: str, clock: Callable[[], float] = time.monotonic) -> Progress:
    """A reporter that prints a line at most every SECONDS_BETWEEN."""
    shown_at, left = clock(), TimeLeft(clock)

    def report(step: str, done: int, total: int) -> None:
        nonlocal shown_at
        estimate, now = left.after(step, done, total), clock()
        if now - shown_at < SECONDS_BETWEEN:
            return
        shown_at = now
        note(", ".join(filter(None, (f"{step or title}: {done} of {total}", left_in_words(estimate)))))

    return report


shown_progress = Display(progress, note)
"""How verbs show what they do in a terminal."""
