"""A disk that fills at a chosen statement: a store's connection with a fault in it."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from studio.foundations.errors import SessionError
from studio.sessions.results_store import ResultsWriter

BEFORE, ROLLED_BACK, AFTER, STUCK = "before", "rolled back", "after", "stuck"
WAYS = (BEFORE, ROLLED_BACK, AFTER, STUCK)
"""How a statement fails: before it does anything; SQLite rolls back by itself, as it does where the disk is full; only
once it is done (a COMMIT that is not acknowledged); and so that not even a roll back is possible.
"""


def disk_full() -> sqlite3.OperationalError:
    """What SQLite raises."""
    error = sqlite3.OperationalError("database or disk is full")
    error.sqlite_errorcode, error.sqlite_errorname = sqlite3.SQLITE_FULL, "SQLITE_FULL"
    return error


class FaultyConnection:
    """Stands for a writer's connection. fails_at : the number of the statement that fails, from 0; for_good : and all
    after it, until `mend`.
    """

    def __init__(
        self, inner: sqlite3.Connection, fails_at: int, way: str = BEFORE, for_good: bool = True
    ) -> None:
        self.inner, self.fails_at, self.way, self.for_good = inner, fails_at, way, for_good
        self.statements = 0
        self.failed = False

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self.inner, name)

    def mend(self) -> None:
        """There is room again."""
        self.fails_at = -1

    def execute(self, sql: str, *values: Any) -> Any:  # noqa: ANN401
        """As the connection's, or the fault."""
        number, self.statements = self.statements, self.statements + 1
        due = number == self.fails_at or (self.for_good and 0 <= self.fails_at < number)
        if not due or (sql == "ROLLBACK" and self.way != STUCK):
            return self.inner.execute(sql, *values)
        self.failed = True
        if self.way == AFTER and number == self.fails_at:
            self.inner.execute(sql, *values)
        if self.way == ROLLED_BACK and self.inner.in_transaction:
            self.inner.execute("ROLLBACK")
        raise disk_full()


def break_at(
    writer: ResultsWriter, statement: int, way: str = BEFORE, *, for_good: bool = True
) -> FaultyConnection:
    """Let a writer's statement of that number fail, counted from now on."""
    writer._connection = FaultyConnection(writer._connection, statement, way, for_good)  # pyright: ignore
    return writer._connection  # pyright: ignore


@contextmanager
def refusals() -> Iterator[list[str]]:
    """What ends because the disk is full ends here, and is noted; anything else is raised."""
    noted: list[str] = []
    try:
        yield noted
    except SessionError as problem:
        if "disk full" not in problem.message:
            raise
        noted.append(problem.message)
