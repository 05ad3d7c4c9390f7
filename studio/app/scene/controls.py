"""Connects viser's inputs with the model: user input is reported, the model's value is shown."""

import threading
from collections.abc import Callable
from typing import Any

import viser

from studio.app.scene.model import Model

Change = Callable[..., Model]
"""(model, *values) to the changed model."""


Post = Callable[..., None]
"""post(change, *values): queues a change for the scene's thread; from any thread, returns at once."""


class Control:
    """An input of the panel. change : what happens with the model when a person moves it, (model, value) -> model.

    viser tells of every change of a value, from a thread of its own and also when it was made from here. So nothing
    is decided there: a person's change is counted and posted with its value. While one waits to be decided on, the
    input is not written to; what the model says then is not yet the answer to it. It is written to in viser's loop:
    from another thread a value could be written between a person's change and the report of it.
    """

    def __init__(self, handle: Any, post: Post, change: Callable[[Model, Any], Model]) -> None:  # noqa: ANN401 - any input handle
        self.handle = handle
        self._loop = handle._impl.gui_api._event_loop
        self._change = change
        self._reported = self._decided = 0
        self._shown: object = None

        async def report(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:
                self._reported += 1
                post(self._decide, event.target.value)

        handle.on_update(report)

    def _decide(self, model: Model, value: object) -> Model:
        self._decided += 1
        return self._change(model, value)

    def show(self, value: object) -> None:
        """Show a value soon, without reporting it as user input. One that stands there is not written again, unless a
        person's change waits to be decided on.
        """
        is_decided = self._reported == self._decided
        if is_decided and self._shown == value and self.handle.value == value:
            return
        self._shown = value
        self._loop.call_soon_threadsafe(self._write, value)

    def _write(self, value: object) -> None:
        with _removing:
            if self._reported == self._decided and not self.handle._impl.removed:
                self.handle.value = value

    def remove(self) -> None:
        """Take the input out of the panel."""
        take_out(self.handle)


_removing = threading.Lock()


def take_out(handle: Any) -> None:  # noqa: ANN401 - an input or a folder of them
    """Remove an input, or a folder with all its inputs, from the panel; nothing is written to them any more."""
    with _removing:
        handle.remove()


def on_press(handle: Any, post: Post, change: Change) -> None:  # noqa: ANN401 - a button or a group of them
    """Change the model when a button is pressed; for a group with the label of the pressed one."""
    is_group = isinstance(handle, viser.GuiButtonGroupHandle)

    async def report(event: viser.GuiEvent[Any]) -> None:
        post(change, *((event.target.value,) if is_group else ()))

    handle.on_click(report)
