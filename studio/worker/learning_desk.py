"""Behaviour models learnt in the background of a server: one at a time, in a process of its own."""

import multiprocessing
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from studio.errors import BehaviourError
from studio.runs.behaviour_models import models_folder
from studio.worker.learning_process import LearningOrder, learn_to_order
from studio.worker.owned_process import ending
from studio.worker.work_desk import WorkDesk, WorkState

CHECK_SECONDS = 0.2
ENOUGH_TO_TELL = 0.02
"""Share of a step that has to be done before it tells how long the rest takes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningState(WorkState):
    """How the learning of a model stands: running, done, cancelled or failed.

    body : that the model is of. seconds_left : of this step. learnt : what came out, in numbers.
    """

    body: str
    learnt: Mapping[str, object] = field(default_factory=dict)


class LearningDesk(WorkDesk[LearningState]):
    """Learns one model in a process. tell : hears of every change, in another thread."""

    def __init__(self, tell: Callable[[LearningState], None]) -> None:
        super().__init__(tell)
        self._step_began = 0.0

    def start(self, order: LearningOrder, ended: Callable[[], None] = lambda: None) -> LearningState:
        """Begin. ended : called when it is over, however. Raises RunError while another one is learnt, SettingsError
        for knobs that cannot be.
        """
        order.settings()
        first = LearningState(name=order.name, body=order.body)
        return self._begin(first, lambda: self._work(order, ended))

    def cancel(self) -> None:
        """Stop; nothing of it is kept."""
        self._stop.set()

    def _busy_with(self, state: LearningState) -> str:
        return f"Model '{state.name}' is being learnt; one is learnt at a time."

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
