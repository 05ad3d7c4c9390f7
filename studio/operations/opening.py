"""Sessions and runs by the names that people give them."""

import functools
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from studio.body.catalogue import list_bodies, load_body
from studio.body.model import BodyModel
from studio.foundations.declaring import Target, operation
from studio.foundations.errors import NotFoundError, RunError, SessionError
from studio.foundations.foreign_files import MANIFEST_NAME
from studio.operations.exports import exported_files
from studio.runs.setup.workflow import Workflow, run_to_use, workflow_of
from studio.runs.sides import in_words
from studio.runs.tracks import Track
from studio.sessions.names import is_name
from studio.sessions.run_arrays import inference_data as chains_of
from studio.sessions.session import BODIES_NAME, RUNS_NAME, Session
from studio.sessions.stored_run import RunSummary, StoredRun
from studio.sessions.work_under_way import gone, working_on
from studio.sessions.workspace import Workspace

P = ParamSpec("P")
R = TypeVar("R")

SessionName = Annotated[Session | str | Path, Target("session")]
"""A session that was opened, its name in the workspace (STUDIO_WORKSPACE), or its folder."""
AnySession = Annotated[Session | str | Path, Target("session", remote=True)]
"""The same, or an address such as s3://bucket/sessions/walk: of verbs that put back what they make."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """A run that was tracked; every verb that takes a run takes it.

    run : as stored.
    track : frames (K,), poses (K, D) in radians and mm, confidence (K,), states.
    names : of the D parameters.
    notes : on defaults that were filled in.
    seconds : that the search took.
    evaluations_per_frame : poses weighed in a frame.
    likelihood_scale : β of the last layer.
    exchanged : left and right that were put right in the track "sides", in words.
    """

    run: StoredRun
    track: Track
    names: tuple[str, ...]
    notes: tuple[str, ...]
    seconds: float
    evaluations_per_frame: int
    likelihood_scale: float = float("nan")
    exchanged: tuple[str, ...] = ()

    @property
    def sides_in_words(self) -> str:
        """What was exchanged, as a sentence; "" for nothing."""
        return in_words(self.exchanged) if self.exchanged else ""

    def to_xarray(self, frames: Iterable[int] | None = None) -> Any:  # noqa: ANN401 - xarray.Dataset
        """The particles with layers as a dimension (`StoredRun.to_xarray`). Raises StudioError without xarray."""
        return self.run.to_xarray(frames)

    def _repr_html_(self) -> str:
        """The run as a notebook shows it."""
        return self.run.as_html()

    @property
    def frames(self) -> NDArray[np.int64]:
        """(K,) numbers of the tracked frames."""
        return self.track.frames

    @property
    def poses(self) -> NDArray[np.float64]:
        """(K, D) radians and mm, in the order of `names`."""
        return self.track.poses


RunName = Annotated[Tracked | StoredRun | str | Path, Target("run")]
"""A run that was tracked or opened, "SESSION/RUN" as in the workspace, or its folder."""


def open_session(session: AnySession, *, remote: bool = False) -> Session:
    """A session by name or folder.

    remote : also by an address, as a copy (`sessions.remote_sessions`).

    Raises NotFoundError where there is none, SessionError where it is damaged.
    """
    if isinstance(session, Session):
        return Session(session.path)
    return Workspace().resolve(session, remote=remote)


def keeping_in_place(function: Callable[P, R]) -> Callable[P, R]:
    """Let the sessions and runs that a verb is about stay where they are while it works, whatever other processes do.

    These are the parameters marked as targets, else the first one. Whatever is no session of this machine is left to
    the verb.
    """
    signature = inspect.signature(function)
    about = [name for name, one in signature.parameters.items() if _is_target(one)] or [
        *signature.parameters
    ][:1]

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        given = signature.bind_partial(*args, **kwargs).arguments
        with ExitStack() as kept:
            for name in about:
                if (value := given.get(name)) is not None:
                    for session, run in _places_of(value, name):
                        kept.enter_context(working_on(session, function.__name__, run))
            return function(*args, **kwargs)

    call.__dict__["keeps_in_place"] = True
    return call


def _is_target(parameter: inspect.Parameter) -> bool:
    return any(isinstance(one, Target) for one in getattr(parameter.annotation, "__metadata__", ()))


def _places_of(value: Any, name: str) -> Iterator[tuple[Path, str]]:  # noqa: ANN401 - SessionName or RunName
    """The folder of the session and the run's name, for one of this machine."""
    with suppress(SessionError):
        if name == "run":
            folder = open_run(value).folder
            yield folder.parent.parent, folder.name
        else:
            yield open_session(value).path, ""


def list_sessions() -> tuple[str, ...]:
    """The names of the workspace's sessions."""
    return tuple(entry.name for entry in Workspace().sessions())


def list_runs(session: SessionName) -> tuple[RunSummary, ...]:
    """The runs of a session, oldest first, each with its request and how many frames it has."""
    return tuple(run.summary() for run in open_session(session).runs())


def open_run(run: RunName) -> StoredRun:
    """A run by its name (SESSION/RUN) or folder.

    Raises RunError for another name, NotFoundError where there is none.
    """
    if isinstance(run, Tracked):
        return StoredRun(run.run.folder)
    if isinstance(run, StoredRun):
        return run
    session, slash, name = str(run).rstrip("/").rpartition("/")
    if not slash or not session:
        raise RunError(f"'{run}' names no run.", "Write SESSION/RUN, such as walk/run-1.")
    place = Path(session)
    return open_session(place.parent if place.name == RUNS_NAME else session).run(name)


def inference_data(*runs: RunName, frames: Iterable[int] | None = None) -> Any:  # noqa: ANN401 - arviz.InferenceData
    """The last clouds of runs that differ by seed, as chains of one `arviz.InferenceData`, with all layers.

    frames : some instead of all finished ones. Raises StudioError without ArviZ, RunError where the runs do not fit
    together, NotFoundError.
    """
    if not runs:
        raise RunError("No run is named.", "Name one or more: studio.inference_data('walk/run-1').")
    chosen = None if frames is None else list(frames)
    return chains_of([open_run(run).to_xarray(chosen) for run in runs])


def session_of(run: StoredRun) -> Session:
    """The session that a run belongs to."""
    return Session(run.folder.parent.parent)


def bodies() -> tuple[BodyModel, ...]:
    """List the bodies that are shipped and those of the workspace."""
    folders = tuple(folder for folder in (Workspace().root / BODIES_NAME,) if folder.is_dir())
    return tuple(load_body(name, folders) for name in list_bodies(folders))


@operation
@keeping_in_place
def workflow(session: SessionName) -> Workflow:
    """Say how far a session is, step by step from footage to an exported motion, and which step is next."""
    return workflow_now(open_session(session))


def workflow_now(session: Session, running: Mapping[str, str] | None = None) -> Workflow:
    """How far a session is. running : by step, the progress of its job in words."""
    run = run_to_use(session)
    return workflow_of(session, running, exported_files(run) if run else ())


def moved_meanwhile(workspace: Workspace, name: str) -> NotFoundError | None:
    """Why work on a session failed that was renamed or deleted meanwhile; None where it is still there."""
    is_there = not is_name(name) or (workspace.root / name / MANIFEST_NAME).is_file()
    return None if is_there else gone(f"Session '{name}'")
