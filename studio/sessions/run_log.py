"""A run's log: one JSON object a line in `log.jsonl`, appended as it happens and readable at any time."""

import time
from pathlib import Path

import msgspec

from studio.typed_decoding import decode_json

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
    with (run_folder / FILE_NAME).open("ab") as stream:
        stream.write(msgspec.json.encode(entry) + b"\n")
    return entry


def read_log(run_folder: Path, last: int = 200) -> tuple[LogEntry, ...]:
    """The last entries of a run's log, oldest first; a line cut short by a crash is left out."""
    path = run_folder / FILE_NAME
    if not path.exists():
        return ()
    with path.open("rb") as stream:
        stream.seek(max(0, path.stat().st_size - LONGEST_TAIL))
        lines = stream.read().splitlines()
    entries: list[LogEntry] = []
    for line in lines[-last:]:
        try:
            entries.append(decode_json(line, LogEntry))
        except msgspec.DecodeError:
            continue
    return tuple(entries)
