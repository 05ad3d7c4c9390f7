"""Bytes that flip on a disk: in what a store holds, and in a file, at places by a seed."""

import contextlib
import os
import sqlite3
from pathlib import Path

import numpy as np

COLUMNS = (("frames", "blob"), ("frames", "pose"), ("layers", "blob"))


def flip_stored(store: Path, rng: np.random.Generator) -> int:
    """Flip a bit of a byte somewhere in a frame's blobs; returns the frame."""
    table, column = COLUMNS[int(rng.integers(len(COLUMNS)))]
    with contextlib.closing(sqlite3.connect(store)) as connection:
        rows = connection.execute(f"SELECT rowid, frame, {column} FROM {table}").fetchall()
        row, frame, blob = rows[int(rng.integers(len(rows)))]
        connection.execute(f"UPDATE {table} SET {column} = ? WHERE rowid = ?", (_flipped(blob, rng), row))
        connection.commit()
    return frame


def flip_in_file(path: Path, rng: np.random.Generator) -> None:
    """Flip a bit of a file, as a disk does: its time stays."""
    status = path.stat()
    path.write_bytes(_flipped(path.read_bytes(), rng))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def _flipped(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    changed[int(rng.integers(len(changed)))] ^= 1 << int(rng.integers(8))
    return bytes(changed)
