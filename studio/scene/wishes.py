"""What a person asks of the tracking process through the scene: the one place that talks to it.

Nothing here waits: commands are posted, and what becomes of them comes back as `Acknowledged` events. While
nothing is tracked, a change of settings anneals the selected frame again at once (the process does that,
newest wins), so the frame that is shown is selected first.
"""

import threading
from collections import OrderedDict
from pathlib import Path
from typing import Protocol

from studio.errors import RunError, StudioError
from studio.worker import commands
from studio.worker.events import Acknowledged, Event, StateChanged
from studio.worker.watchers import Subscription

Value = bool | int | float | str

SEARCHING = ("tracking", "compiling")
_REMEMBERED = 256


class Control(Protocol):
    """The tracking process as its owner sees it (`worker.control.StudioControl`)."""

    @property
    def state(self) -> StateChanged:
        """Where the search stands."""
        ...

    def send(self, command: commands.Command) -> object:
        """Post a command; an `Acknowledged` event follows. Raises RunError if the process has died."""
        ...

    def subscribe(self) -> Subscription:
        """Every event from now on."""
        ...


class Wishes:
    """Commands by name; may be used from any thread."""

    def __init__(self, control: Control) -> None:
        self._control = control
        self._lock = threading.Lock()
        self._sent: OrderedDict[str, None] = OrderedDict()

    @property
    def searching(self) -> bool:
        """Whether frames are being tracked now."""
        return self._control.state.state in SEARCHING

    def change_settings(self, changes: dict[str, Value], session: Path, run: Path, frame: int | None) -> str:
        """Change knobs of a run, and anneal `frame` again with them if nothing is being tracked.

        Returns the identifier that the acknowledgement will carry. Raises RunError while another run is
        tracked.
        """
        self.make_current(session, run)
        state = self._control.state
        if frame is not None and not self.searching and state.selected != frame:
            self._send(commands.Seek(frame=frame))
        return self._send(commands.ChangeSettings(changes=changes))

    def make_current(self, session: Path, run: Path) -> None:
        """Make a run the one that commands are about. Raises RunError while another one is being tracked."""
        state = self._control.state
        if (state.session, state.run) == (session.name, run.name) and state.state != "lost":
            return
        if state.state in SEARCHING:
            raise RunError(
                f"Run '{state.run}' of session '{state.session}' is being tracked.",
                "Pause it before changing another.",
            )
        self._send(commands.Open(session=str(session), run=str(run)))

    def start(self) -> None:
        """Track on."""
        self._send(commands.Start())

    def pause(self) -> None:
        """Stop after the layer in progress."""
        self._send(commands.Pause())

    def step_layer(self) -> None:
        """Do one layer, then pause inside the frame."""
        self._send(commands.StepLayer())

    def step_frame(self) -> None:
        """Finish the frame or do the next, then pause."""
        self._send(commands.StepFrame())

    def cancel(self) -> None:
        """End the run."""
        self._send(commands.Cancel())

    def reanneal(self, frame: int) -> None:
        """Anneal a frame again with the settings in use; the stored answer stays."""
        self._send(commands.Reanneal(frame=frame))

    def set_pace(self, seconds_a_layer: float) -> None:
        """Let each layer that is tracked take at least so many seconds; 0: as fast as it can."""
        self._send(commands.SetPace(seconds_a_layer=seconds_a_layer))

    def settled(self, event: Event) -> tuple[str, StudioError | None] | None:
        """If the event acknowledges a command sent from here: its identifier and the refusal, None if it
        was taken.
        """
        if not isinstance(event, Acknowledged):
            return None
        with self._lock:
            if event.identifier not in self._sent:
                return None
            del self._sent[event.identifier]
        return event.identifier, None if event.ok else StudioError(event.message, event.hint)

    def _send(self, command: commands.Command) -> str:
        with self._lock:
            self._sent[command.identifier] = None
            while len(self._sent) > _REMEMBERED:
                self._sent.popitem(last=False)
        self._control.send(command)
        return command.identifier
