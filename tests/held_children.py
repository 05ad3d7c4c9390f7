"""What children of tests do: nothing, until they are ended."""

import os
import time
from multiprocessing.connection import Connection
from pathlib import Path

from studio.foundations.children import Child
from studio.foundations.isolated import isolated


def hold(_inbox: Connection, _outbox: Connection) -> None:
    """Deaf to its inbox."""
    time.sleep(600.0)


def say_end(inbox: Connection, outbox: Connection, place: Path) -> None:
    """Says that it is there; when its parent is gone, that in a file."""
    outbox.send("here")
    try:
        inbox.recv()
    except EOFError:
        place.write_text("gone")


def hold_another(_inbox: Connection, outbox: Connection) -> None:
    """Has a child of its own that does nothing, and says its process."""
    child = Child(hold, name="held")
    outbox.send(child.identifier)
    time.sleep(600.0)


def ask_another(_inbox: Connection, outbox: Connection, reader: object, path: Path) -> None:
    """Has a file read in a process of a process."""
    outbox.send((os.getpid(), isolated(Exception, reader, path)))  # pyright: ignore[reportArgumentType]
