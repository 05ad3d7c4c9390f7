"""A served workspace with a small session for each group, and processes beside it that do as a command line does."""

import contextlib
import multiprocessing
import os
import shutil
import traceback
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType

import cv2
import msgspec
from faults.process_kinds import Served, server, until
from faults.stage import DONE, TOY, Place, build_source, frames_of
from toy_footage import write_video

from races.verbs import CLIP, FRAMES, PYTHON, Given, build
from studio.foundations.errors import StudioError, UnforeseenError
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.results.verifying import verify
from studio.runs.notes import write_note
from studio.sessions.manifest import write_manifest
from studio.sessions.session import Session
from studio.sessions.work_under_way import STATE_NAME
from studio.sessions.workspace import TRASH_NAME, VARIABLE, Workspace

GONE = "gone"
"""A run that lies in the trash when a group begins."""
MARK = "this one"
"""The note by which the tracked run is known under any name."""
SOURCE = ".source"
PROCESSES = 3


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a verb. state : "done", "refused", "killed" or "wrong". words : the refusal, or what is wrong."""

    state: str
    words: str = ""


class OtherProcess:
    """A process that does verbs of Python, one after another, until it is killed; then there is another one."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["races.warm"])
        self._here, there = context.Pipe()
        # No daemon: comparisons have processes of their own.
        self._process = context.Process(target=_live, args=(there, self._root))
        self._process.start()
        there.close()

    def do(self, verb: str, given: Given) -> Outcome:
        """Do a verb and wait for it."""
        try:
            self._here.send((verb, given))
            return self._here.recv()
        except (EOFError, OSError):
            return Outcome("killed")

    def kill(self) -> None:
        """kill -9, whatever it does."""
        self._process.kill()
        self._process.join()

    def revive(self) -> None:
        """Another process, if this one was killed."""
        if not self._process.is_alive():
            self._here.close()
            self._start()

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.join()


def _live(there: Connection, root: Path) -> None:
    """In the process."""
    cv2.setNumThreads(-1)
    os.environ[VARIABLE] = str(root)
    while True:
        try:
            verb, given = there.recv()
        except EOFError:
            return
        there.send(_done(verb, given))


def _done(verb: str, given: Given) -> Outcome:
    try:
        PYTHON[verb](given)
    except UnforeseenError as error:
        return Outcome("wrong", str(error))
    except StudioError as error:
        return Outcome("refused", str(error))
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)
        place = next((entry for entry in reversed(last) if "/studio/" in entry.filename), last[-1])
        where = f"{place.filename.rpartition('/studio/')[2]}:{place.lineno}"
        return Outcome("wrong", f"{type(error).__name__} at {where}: {error}")
    return Outcome("done")


@dataclass
class Stage:
    """frames : of the run that is tracked to its end, by digest. others : processes beside the server."""

    folder: Path
    frames: dict[int, str] = field(init=False)
    others: list[OtherProcess] = field(init=False)
    served: Served = field(init=False)

    def __post_init__(self) -> None:
        first = Place(self.folder / "first")
        session = build(first, DONE, GONE)
        build_source(first)
        (session.path / "truth").mkdir()
        export_run(session, first.run(DONE), FORMATS["trc"], {}, session.path / "truth" / "arm.trc")
        verify(first.session)
        write_note(first.run(DONE), FRAMES - 1, MARK)
        self.frames = frames_of(first.run(DONE))
        with contextlib.closing(session.footage()) as footage:
            pictures = [footage.picture("front", frame) for frame in range(FRAMES)]
        write_video(self.folder / CLIP, pictures, fps=30)
        self.root.mkdir(parents=True)
        shutil.copytree(first.folder / "source", self.root / SOURCE)
        self.others = [OtherProcess(self.root) for _ in range(PROCESSES)]
        self._open = ExitStack()
        self._serve()

    def __enter__(self) -> "Stage":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        for other in self.others:
            other.close()
        self._open.close()

    @property
    def root(self) -> Path:
        """The folder of the workspace."""
        return self.folder / "served" / "workspace"

    @property
    def workspace(self) -> Workspace:
        """That is served."""
        return Workspace(self.root)

    def _serve(self) -> None:
        self._open.close()
        self.served = self._open.enter_context(server(Place(self.folder / "served")))
        until(lambda: self.served.client.get("/api/worker").json()["state"] != "starting")

    def revive(self) -> None:
        """Start again what was killed."""
        for other in self.others:
            other.revive()
        if self.served.process.poll() is not None:
            self._serve()
        elif self.served.state() == "lost":
            self.served.post("/api/worker/restart")

    @contextmanager
    def given(self, number: int) -> Iterator[Given]:
        """A fresh session for a group; afterwards nothing of it is left."""
        given = Given(self.root, f"toy{number}", self.root / SOURCE, self.folder / "out", number)
        shutil.copytree(self.folder / "first" / "workspace" / TOY, given.session)
        session = Session(given.session)
        write_manifest(session.path, msgspec.structs.replace(session.manifest, name=given.name))
        given.out.mkdir()
        given = given.with_trashed(self.workspace.trash_run(given.name, GONE).name)
        try:
            yield given
        finally:
            shutil.rmtree(given.out)
            for path in self.root.iterdir():
                if path.name not in (STATE_NAME, SOURCE, TRASH_NAME):
                    shutil.rmtree(path)
            for path in (self.root / TRASH_NAME).iterdir():
                shutil.rmtree(path)
