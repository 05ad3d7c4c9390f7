"""A tracking process that only remembers what it was asked."""

import math

from studio.worker.commands import Command
from studio.worker.events import Acknowledged, Event, StateChanged
from studio.worker.watchers import Subscription, Watchers


class FakeControl:
    """Satisfies `scene.wishes.Control`; a test answers for it."""

    def __init__(self, session: str = "", run: str = "", state: str = "idle") -> None:
        self.state = StateChanged(session, run, state, 0, 0, 0, 6, 5, math.nan, math.nan)
        self.commands: list[Command] = []
        self.watchers = Watchers()

    def send(self, command: Command) -> None:
        """Remember a command."""
        self.commands.append(command)

    def subscribe(self) -> Subscription:
        """A queue that `say` fills."""
        return self.watchers.subscribe()

    def say(self, event: Event) -> None:
        """Tell all watchers an event."""
        if isinstance(event, StateChanged):
            self.state = event
        self.watchers.publish(event)

    def answer(self, command: Command, message: str = "", hint: str = "") -> None:
        """Acknowledge a command; with a message it is refused."""
        name = type(command).__name__
        self.say(
            Acknowledged(
                self.state.session, self.state.run, command.identifier, name, not message, message, hint
            )
        )
