"""A run's log, as OpenAPI shows it."""

from studio.web.schemas import Answer


class LogEntry(Answer):
    """One line of a run's log. time: seconds since the epoch."""

    level: str
    time: float
    text: str


class LogLines(Answer):
    """What the tracking process said, oldest first."""

    lines: list[LogEntry]
