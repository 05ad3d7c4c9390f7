"""A desk where one thing is worked at in the background of a server: its thread, how it stands, who hears of that."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from studio.errors import RunError


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkState:
    """How the work at `name` stands.

    state : "running", and how it ended. step : what is being done, done of total parts of it. seconds_left : an
    estimate, None before there is one. message, hint : why it failed.
    """

    name: str
    state: str = "running"
    step: str = ""
    done: int = 0
    total: int = 0
    seconds_left: float | None = None
    message: str = ""
    hint: str = ""


State = TypeVar("State", bound=WorkState)


class WorkDesk(ABC, Generic[State]):
    """Works at one thing at a time, in a thread. tell : hears of every change, in any thread."""

    def __init__(self, tell: Callable[[State], None]) -> None:
        self._tell = tell
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._state: State | None = None

    @property
    def state(self) -> State | None:
        """How what is worked at, or was worked at last, stands; None before the first."""
        return self._state

    def is_busy(self) -> bool:
        """Whether something is being worked at."""
        return self._thread is not None and self._thread.is_alive()

    def check_free(self) -> None:
        """Raise RunError while something is being worked at."""
        if self.is_busy() and self._state is not None:
            raise RunError(self._busy_with(self._state), "Wait for it, or cancel it.")

    def close(self, patience: float = 10.0) -> None:
        """Stop what is running and wait, for so many seconds, for its processes to end."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(patience)

    @abstractmethod
    def _busy_with(self, state: State) -> str:
        """The sentence that tells why nothing else can begin."""

    def _begin(self, first: State, work: Callable[[], None]) -> State:
        """Work in a thread, from the state `first` on; `_stop` tells it to end. Raises RunError while busy."""
        with self._lock:
            self.check_free()
            self._stop = threading.Event()
            self._state = first
            self._thread = threading.Thread(target=work, name=type(self).__name__, daemon=True)
            self._thread.start()
        return first

    def _change(self, **changes: object) -> None:
        if self._state is not None:
            self._state = replace(self._state, **changes)  # pyright: ignore[reportArgumentType]
            self._tell(self._state)
