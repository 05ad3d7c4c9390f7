"""A run's log: one JSON object a line in `log.jsonl`, appended as it happens and readable at any time."""

import os
import time
from pathlib import Path

import msgspec

from studio.foundations.errors import SessionError
from studio.foundations.foreign_files import check_file, open_file
from studio.foundations.typed_decoding import decode_json

FILE_NAME = "log.jsonl"
LONGEST_TAIL = 1 << 20


class LogEntry(msgspec.Struct, frozen=True):
    """level : info, warning or error. time : seconds since the epoch."""

    time: float
    level: str
    text: str


def append_to_log(run_folder: Path, level: str, text: str) -> LogEntry:
    """Write one entry at the end of the run's log. Raises OSError."""
    entry = LogEntry(time.time(), level, text)
    check_file(run_folder / FILE_NAME, SessionError)
    with (run_folder / FILE_NAME).open("ab") as stream:
        stream.write(msgspec.json.encode(entry) + b"\n")
    return entry


def read_log(run_folder: Path, last: int = 200) -> tuple[LogEntry, ...]:
    """The last entries of a run's log, oldest first; a line cut short by a crash is left out. Raises SessionError for
    what is no regular file of the session.
    """
    path = run_folder / FILE_NAME
    try:
        with open_file(path) as stream:
            stream.seek(max(0, os.fstat(stream.fileno()).st_size - LONGEST_TAIL))
            lines = stream.read(LONGEST_TAIL).splitlines()
    except FileNotFoundError:
        return ()
    entries: list[LogEntry] = []
    for line in lines[-last:]:
        try:
            entries.append(decode_json(line, LogEntry))
        except msgspec.DecodeError:
            continue
    return tuple(entries)
