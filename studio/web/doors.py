"""What the routes need of the storeys beside and below: the tracking process, the scene, and where things
lie.

`Stage` is a protocol because the scene is a room on the same storey, which this one may not see; `launch`
brings them together.
"""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from fastapi import Request

from studio.sessions.workspace import Workspace
from studio.web.event_stream import EventStream
from studio.web.presets import Preset
from studio.web.schemas import ImportState
from studio.worker.commands import Command
from studio.worker.events import StateChanged
from studio.worker.watchers import Subscription

Value = bool | int | float | str

STATE_NAME = ".studio"


class Control(Protocol):
    """The tracking process as its owner sees it (`worker.control.StudioControl`)."""

    @property
    def state(self) -> StateChanged:
        """Where the search stands, or stood when the process was last heard of."""
        ...

    def send(self, command: Command) -> object:
        """Post a command; an `Acknowledged` event follows."""
        ...

    def change_settings(self, **changes: Value) -> object:
        """Change knobs of the open run. Raises SettingsError."""
        ...

    def subscribe(self) -> Subscription:
        """All events from now on."""
        ...

    def restart(self) -> None:
        """Start the process again after it died."""
        ...

    def close(self) -> None:
        """End the process."""
        ...


class Stage(Protocol):
    """The 3-D scene (`scene.stage.SceneStage`)."""

    def start(self) -> int:
        """Build the scene; the loopback port that it listens on."""
        ...

    def stop(self) -> None:
        """Close it."""
        ...

    def show(self, **wish: object) -> None:
        """Change what is shown: session, run, frame, layer, look_through, dark."""
        ...

    def relay_headers(self) -> Mapping[str, str]:
        """The secret that the scene asks of whoever connects."""
        ...


@dataclass(slots=True)
class Doors:
    """Everything a route may use, kept in `app.state.doors`.

    scene_port : of the inner viser server, 0 while it is not running. footage_roots : folders that may be
    imported from. presets : the studio's own. log_path : the server's log file. imports, uploads : those
    under way, by their identifiers.
    """

    workspace: Workspace
    control: Control
    stage: Stage
    events: EventStream
    footage_roots: tuple[Path, ...] = ()
    presets: Sequence[Preset] = ()
    log_path: Path | None = None
    scene_port: int = 0
    imports: dict[str, ImportState] = field(default_factory=dict)
    uploads: dict[str, dict[str, int]] = field(default_factory=dict)
    jobs: set[asyncio.Task[None]] = field(default_factory=set)

    @property
    def state_folder(self) -> Path:
        """Where the server keeps what is its own: preferences, presets, unfinished uploads."""
        return self.workspace.root / STATE_NAME


def doors_of(request: Request) -> Doors:
    """The doors, as a dependency of routes."""
    return request.app.state.doors
