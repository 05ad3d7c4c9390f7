"""A process that reads as `fuzz.reading` does, where a format's reader does what the campaign has to notice."""

import ctypes
import sys
import time
from pathlib import Path

from fuzz import formats, reading
from studio.foundations.errors import StudioError

turn = -1


def harm(_: Path) -> None:
    """By turns: nothing, a traceback, a native abort, an error without a remedy, and a hang."""
    global turn
    turn += 1
    if turn == 1:
        raise ValueError("unforeseen")
    if turn == 2:
        ctypes.string_at(0)
    if turn == 3:
        raise StudioError("Wrong.")
    if turn == 4:
        time.sleep(600.0)


if __name__ == "__main__":
    formats.FORMATS = reading.FORMATS = {"numbers": formats.Format((harm,))}
    turn = int(sys.argv[1]) - 1
    reading.main()
