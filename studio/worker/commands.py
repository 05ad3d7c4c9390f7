"""What a person may ask of the tracking process. All are acknowledged by an `Acknowledged` event."""

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Command:
    """identifier : made by the sender, returned in the acknowledgement."""

    identifier: str


@dataclass(frozen=True, slots=True)
class Open(Command):
    """Make a run the current one (resuming it where it stands). session, run : folder paths as text."""

    session: str
    run: str


@dataclass(frozen=True, slots=True)
class Start(Command):
    """Track on from the first frame that has no result."""


@dataclass(frozen=True, slots=True)
class Pause(Command):
    """Stop after the layer in progress; the particles stay where they are."""


@dataclass(frozen=True, slots=True)
class StepFrame(Command):
    """Finish the current frame (or do the next), then pause."""


@dataclass(frozen=True, slots=True)
class StepLayer(Command):
    """Do one layer, then pause inside the frame."""


@dataclass(frozen=True, slots=True)
class Seek(Command):
    """Make `frame` the one that re-anneal works on; it must have a result or be the next to do."""

    frame: int


@dataclass(frozen=True, slots=True)
class Reanneal(Command):
    """Anneal a stored frame again with the current settings, same start and random keys; the stored result stays."""

    frame: int


@dataclass(frozen=True, slots=True)
class Cancel(Command):
    """End the run; what was tracked stays."""


@dataclass(frozen=True, slots=True)
class Stop(Command):
    """End the process."""


@dataclass(frozen=True, slots=True)
class ChangeSettings(Command):
    """Change knobs by name; checked, versioned, swapped between layers."""

    changes: dict[str, bool | int | float | str] = field(default_factory=dict)
