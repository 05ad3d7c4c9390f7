"""Behaviour models learnt in the background of a server: one at a time, in a process of its own."""

import multiprocessing
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from studio.errors import BehaviourError, RunError
from studio.runs.behaviour_models import models_folder
from studio.worker.learning_process import LearningOrder, learn_to_order
from studio.worker.owned_process import ending

CHECK_SECONDS = 0.2
ENOUGH_TO_TELL = 0.02
"""Share of a step that has to be done before it tells how long the rest takes."""


@dataclass(frozen=True, slots=True)
class LearningState:
    """How the learning of a model stands.

    state : running, done, cancelled or failed. step : what is being done, done of total parts of it. seconds_left : of
    this step, None before there is an estimate. message, hint : why it failed. learnt : what came out, in numbers.
    """

    name: str
    body: str
    state: str = "running"
    step: str = ""
    done: int = 0
    total: int = 0
    seconds_left: float | None = None
    message: str = ""
    hint: str = ""
    learnt: Mapping[str, object] = field(default_factory=dict)


class LearningDesk:
    """Learns one model in a process. tell : hears of every change, in another thread."""

    def __init__(self, tell: Callable[[LearningState], None]) -> None:
        self._tell = tell
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._state: LearningState | None = None
        self._step_began = 0.0

    @property
    def state(self) -> LearningState | None:
        """How the model that is learnt, or was learnt last, stands; None before the first."""
        return self._state

    def is_busy(self) -> bool:
        """Whether a model is being learnt."""
        return self._thread is not None and self._thread.is_alive()

    def check_free(self) -> None:
        """Raise RunError while a model is being learnt."""
        if self.is_busy() and self._state is not None:
            raise RunError(
                f"Model '{self._state.name}' is being learnt; one is learnt at a time.",
                "Wait for it, or cancel it.",
            )

    def start(self, order: LearningOrder, ended: Callable[[], None] = lambda: None) -> LearningState:
        """Begin. ended : called when it is over, however. Raises RunError while another one is learnt, SettingsError
        for knobs that cannot be.
        """
        order.settings()
        with self._lock:
            self.check_free()
            self._stop = threading.Event()
            self._state = state = LearningState(order.name, order.body)
            self._thread = threading.Thread(
                target=self._work, args=(order, ended), name="learning", daemon=True
            )
            self._thread.start()
        return state

    def cancel(self) -> None:
        """Stop; nothing of it is kept."""
        self._stop.set()

    def close(self, patience: float = 10.0) -> None:
        """Stop what is running and wait for its process to end."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(patience)

    def _work(self, order: LearningOrder, ended: Callable[[], None]) -> None:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(
            target=learn_to_order, args=(order, theirs), name="studio-learning", daemon=True
        )
        process.start()
        # Only the process itself may hold this end: then the pipe ends when the process does.
        theirs.close()
        end: dict[str, object] = {"state": "failed", "message": "Learning broke off.", "hint": "Try again."}
        try:
            end = self._listen(ours, process)
        finally:
            process.kill()
            process.join()
            ours.close()
            for left in models_folder(order.root).glob(f"*.{process.pid}.partial"):
                left.unlink(missing_ok=True)
            try:
                ended()
            finally:
                # Told last: who hears it finds everything put away.
                self._change(**end, seconds_left=None)

    def _listen(self, pipe: Connection, process: BaseProcess) -> dict[str, object]:
        """Hear the process out, until it is done or not wanted any more. Returns how it ended."""
        while True:
            if self._stop.is_set():
                return {"state": "cancelled"}
            if not pipe.poll(CHECK_SECONDS):
                continue
            try:
                kind, *told = pipe.recv()
            except (EOFError, OSError):
                process.join(CHECK_SECONDS)
                died = BehaviourError(
                    f"The process that learnt it {ending(process.exitcode)}.", "Try again with fewer frames."
                )
                return {"state": "failed", "message": died.message, "hint": died.hint}
            if kind == "step":
                self._report(*told)
            elif kind == "failed":
                return {"state": "failed", "message": told[0], "hint": told[1]}
            else:
                return {"state": "done", "learnt": told[0]}

    def _report(self, step: str, done: int, total: int) -> None:
        assert self._state is not None
        now = time.monotonic()
        if step != self._state.step:
            self._step_began = now
        left = None
        if total and done >= ENOUGH_TO_TELL * total:
            left = (now - self._step_began) * (total - done) / max(1, done)
        self._change(step=step, done=done, total=total, seconds_left=left)

    def _change(self, **changes: object) -> None:
        if self._state is not None:
            self._state = replace(self._state, **changes)  # pyright: ignore[reportArgumentType]
            self._tell(self._state)
