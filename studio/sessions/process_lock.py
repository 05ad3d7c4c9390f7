"""A lock on a folder that the system frees when its process dies, on every system alike."""

import sqlite3
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class ProcessLock:
    """Held as an exclusive transaction on an empty database in the folder."""

    connection: sqlite3.Connection

    @staticmethod
    def take(path: Path) -> "ProcessLock | None":
        """The lock that the file `path` stands for (made where missing), None while another holds it."""
        connection = sqlite3.connect(path, timeout=0.0, isolation_level=None, check_same_thread=False)
        try:
            connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError:
            connection.close()
            return None
        return ProcessLock(connection)

    def free(self) -> None:
        """Let others take it."""
        self.connection.close()
