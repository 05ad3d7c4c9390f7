"""A tracking process that only records its commands, and user input on viser's controls."""

import asyncio
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import viser

from studio.app.scene.model import Model
from studio.operations.jobs.commands import Command
from studio.operations.jobs.events import Acknowledged, Event, RunState, StateChanged
from studio.operations.jobs.watchers import Subscription, Watchers


class FakeControl:
    """What a scene uses of `worker.control.StudioControl`; a test answers for it."""

    def __init__(self, session: str = "", run: str = "", state: str = "idle") -> None:
        self.state = StateChanged(session, run, RunState(state), 0, 0, 0, 6, 5, math.nan, math.nan)
        self.commands: list[Command] = []
        self.watchers = Watchers()

    def send(self, command: Command) -> None:
        """Remember a command."""
        self.commands.append(command)

    def subscribe(self, wanted: Callable[[Event], bool] = lambda _: True) -> Subscription:
        """A queue that `say` fills."""
        return self.watchers.subscribe(wanted)

    def emit(self, event: Event) -> None:
        """Tell all watchers an event."""
        if isinstance(event, StateChanged):
            self.state = event
        self.watchers.publish(event)

    def answer(self, command: Command, message: str = "", hint: str = "") -> None:
        """Acknowledge a command; with a message it is refused."""
        name = type(command).__name__
        self.emit(
            Acknowledged(
                self.state.session, self.state.run, command.identifier, name, not message, message, hint
            )
        )


SOMEBODY = 7


def by_hand(handle: Any, value: object) -> None:  # noqa: ANN401 - any input handle
    """What happens when a viewer moves a control: viser's loop takes the value, then awaits the callbacks."""

    async def take() -> None:
        handle._impl.value = value
        for callback in handle._impl.update_cb:
            await callback(SimpleNamespace(target=handle, client_id=SOMEBODY))

    asyncio.run_coroutine_threadsafe(take(), handle._impl.gui_api._event_loop).result(5)


def press(handle: Any, word: object = None) -> None:  # noqa: ANN401 - a button or a group of them
    """What happens when a viewer presses a button, or one of a group."""
    target = SimpleNamespace(value=word)
    for callback in handle._impl.update_cb:
        asyncio.run(callback(SimpleNamespace(target=target, client_id=SOMEBODY)))


def drag(gizmo: Any, place: np.ndarray, phase: str = "update") -> None:  # noqa: ANN401 - a gizmo's handle
    """What happens when a viewer drags a gizmo to a place (mm)."""
    target = SimpleNamespace(position=place / 1000.0, wxyz=gizmo.wxyz)
    for callback in gizmo._impl_aux.update_cb:
        asyncio.run(callback(SimpleNamespace(target=target, client_id=SOMEBODY, phase=phase)))


def settle_viser(server: viser.ViserServer) -> None:
    """Wait until viser's loop has run what was handed to it, however often that hands on."""
    for _ in range(3):
        asyncio.run_coroutine_threadsafe(asyncio.sleep(0), server.get_event_loop()).result(5)


class Posted:
    """Keeps what the panel posts; `happen` lets it come true in a model."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.waiting: list[tuple[Callable[..., Model], tuple[Any, ...]]] = []

    def post(self, change: Callable[..., Model], *values: object) -> None:
        """As `SceneController.post`."""
        self.waiting.append((change, values))

    def happen(self) -> Model:
        """The model after all that was posted."""
        for change, values in self.waiting:
            self.model = change(self.model, *values)
        self.waiting.clear()
        return self.model
