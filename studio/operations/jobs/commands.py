"""What a person may ask of the tracking process. All are acknowledged by an `Acknowledged` event.

Each works while a frame is being annealed: it is served between two layers. A command names the run that it is about:
that run is opened first if it is not open, in one step with what the command does, so no two windows can get between
opening and starting. While another run is tracked it is refused; only `Start` waits for its turn, and `Open` pauses the
other run.
"""

import time
import uuid
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypedDict


class About(TypedDict):
    """What makes a command one about a run."""

    session: str
    run: str


def about(run: Path) -> About:
    """The run of a folder, for a command: `Start(**about(folder))`."""
    return {"session": str(run.parent.parent), "run": str(run)}


@dataclass(frozen=True, slots=True)
class Command:
    """identifier : made by the sender, returned in the acknowledgement. requested_at : `time.monotonic()` then.
    session, run : folder paths as text of what it is about; "" : the run that is open.
    """

    identifier: str = field(default_factory=lambda: uuid.uuid4().hex)
    requested_at: float = field(default_factory=time.monotonic, kw_only=True)
    session: str = field(default="", kw_only=True)
    run: str = field(default="", kw_only=True)


@dataclass(frozen=True, slots=True)
class Open(Command):
    """Make a run the current one, where it stands.

    Another run that is being tracked is paused first, saved whole inside its frame; opening the open one changes
    nothing. warm : compile its kernels now, so that the first knob that is moved is answered at once.
    """

    warm: bool = field(default=False, kw_only=True)


@dataclass(frozen=True, slots=True)
class Start(Command):
    """Track on from the first frame that has no result: at once, or after those that are tracked and wait already.

    The next one begins when the run before it finishes, fails or is cancelled; a paused run holds the others up.
    """


@dataclass(frozen=True, slots=True)
class Dequeue(Command):
    """Take a run out of those that wait."""


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

    frame: int = -1


@dataclass(frozen=True, slots=True)
class Reanneal(Command):
    """Anneal a frame again with the current settings, same start and random keys; the stored result stays.

    frame : -1 for the selected one. keep : store the answer as the run's own and drop the frames after it,
    which followed from the old one; the run as it was goes to the trash. A run that is being tracked is paused.
    """

    frame: int = -1
    keep: bool = False


@dataclass(frozen=True, slots=True)
class Cancel(Command):
    """End the run; what was tracked stays."""


@dataclass(frozen=True, slots=True)
class Close(Command):
    """Release the open run, saved where it stands (before it is renamed or deleted); refused while it is tracked.

    With a session's name or a run's only if the open one is of that session, or that run.
    """


@dataclass(frozen=True, slots=True)
class Stop(Command):
    """End the process."""


@dataclass(frozen=True, slots=True)
class ChangeSettings(Command):
    """Change knobs by name; checked, versioned, swapped between layers.

    While nothing is tracked `frame` is selected (-1 : the one that is) and annealed again at once, if it can be.
    """

    changes: dict[str, bool | int | float | str] = field(default_factory=dict[str, bool | int | float | str])
    frame: int = -1


@dataclass(frozen=True, slots=True)
class PutBackSettings(Command):
    """Put the knobs that were moved, and that no stored frame uses, back to the run's newest settings."""


@dataclass(frozen=True, slots=True)
class SetPace(Command):
    """Let each layer of a run that is tracked take at least so many seconds, 0 to 10; 0 : as fast as it can.

    For watching only: no result changes, no run records it; it holds until the process ends, and a restart brings
    it back. Steps and re-annealing are not slowed, and every command is served while a layer's time runs.
    """

    seconds_a_layer: float = 0.0
