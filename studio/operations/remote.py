"""Sessions on many machines: put into an object store and brought from it, tracked in a batch."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from studio.foundations.declaring import Terminal, Web, operation, taking
from studio.foundations.errors import RunError
from studio.operations.jobs.cluster import Cluster, chosen_executor
from studio.operations.jobs.swept_runs import measure_run_of_batch
from studio.operations.jobs.trials import TrialResult, run_jobs
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.sweep import Swept
from studio.results.comparison.trials import ALLOW_INCONSISTENT, TrialJob
from studio.runs.new_run import prepare_run
from studio.sessions import remote_sessions
from studio.sessions.names import checked_name
from studio.sessions.object_stores import above, folder_of, is_address
from studio.sessions.remote_sessions import RemoteSession, sessions_at
from studio.sessions.session import Session
from studio.sessions.stored_run import RunSummary
from studio.sessions.workspace import Workspace

Address = Annotated[
    str, Field(description="Address in a store, such as s3://BUCKET/sessions/NAME."), Web(left_out=True)
]


@dataclass(frozen=True, slots=True)
class RunsThere:
    """Runs of this machine, or of an object store.

    place : the workspace's folder, or the address.
    runs : of the workspace's sessions.
    stored : sessions at the address; None for this machine.
    """

    place: str
    runs: tuple[RunSummary, ...] = ()
    stored: tuple[RemoteSession, ...] | None = None


def runs_there(place: str | None = None) -> RunsThere:
    """The runs of a session, or of the whole workspace; at an address the sessions of a store. Raises NotFoundError."""
    if place and is_address(place):
        return RunsThere(place, stored=sessions_at(place))
    workspace = Workspace()
    if place:
        runs = tuple(run.summary() for run in workspace.resolve(place).runs())
    else:
        runs = tuple(run for entry in workspace.sessions() for run in entry.runs)
    return RunsThere(str(workspace.root), runs)


@operation
@keeping_in_place
def upload(
    session: SessionName, to: Annotated[Address, Terminal("--to", "ADDRESS")], *, progress: Reporting = None
) -> str:
    """Put a session with its runs into an object store, from which any machine can track it, and return its address.

    An interrupted upload is not seen as a session there; the same call begins it again.

    Raises SessionError where the store cannot be written or has such a session already.
    """
    opened = open_session(session)
    with reporting(progress, f"{opened.name}: uploading") as report:
        return remote_sessions.upload(opened, to, report)


@operation
def download(
    address: Annotated[Address, Terminal(metavar="ADDRESS")],
    into: Annotated[
        str | Path,
        Field(description="Name of the new session in the workspace, or a path."),
        Terminal("--into", "SESSION", kind=str),
    ],
    *,
    progress: Reporting = None,
) -> Session:
    """Bring a session with its runs and comparisons from an object store, completely or not at all.

    Raises NotFoundError where there is no session at the address, SessionError for a name that is taken.
    """
    place = Workspace().place_for(into)
    with reporting(progress, f"{place.name}: downloading") as report:
        return remote_sessions.download(address, place, report)


@dataclass(frozen=True, slots=True)
class BatchLine:
    """A session of a batch.

    place : its folder or address.
    run : the measured run; None where it failed.
    failure : why, then.
    """

    session: str
    place: str
    run: Swept | None
    failure: str = ""


@dataclass(frozen=True, slots=True)
class Batch:
    """A tracked batch.

    lines : one a session, in the order of the sessions.
    """

    lines: tuple[BatchLine, ...]


@operation
@taking(
    prepare_run,
    without=("session", "subject", "start_pose", "start_source", "live", "ping_pong", "note", "progress"),
)
def batch(
    sessions: Annotated[
        Sequence[str | Path],
        Field(
            description="Sessions by name, folder or address; the address of a folder means all sessions below"
            " it."
        ),
        Terminal(metavar="SESSION…"),
    ],
    *,
    name: Annotated[str, Field(description="Name of the runs (letters, digits, - and _).")] = "batch",
    processes: Annotated[
        int | None, Field(ge=1, description="Sessions at once; default: one a core."), Web(left_out=True)
    ] = None,
    cluster: Cluster = "",
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> Batch:
    """Track many sessions with the same settings, on all cores or on a cluster's workers, one run each.

    All runs have the same name and lie in their sessions. A session that fails does not stop the others. The same call
    continues an interrupted batch and tracks nothing twice.

    Raises RunError where no session is given, SessionError where a place holds none.
    """
    places = [place for one in sessions for place in _places(one)]
    if not places:
        raise RunError("A batch without sessions tracks nothing.", "Name sessions, folders or addresses.")
    jobs = [_job(place, name, options) for place in dict.fromkeys(places)]
    lines: dict[str, BatchLine] = {}

    def on_result(job: TrialJob, result: TrialResult) -> None:
        run = Swept(**result.measured) if result.measured is not None else None
        lines[job.key] = BatchLine(job.label, job.footage[0], run, result.failure)
        report(job.label, len(lines), len(jobs))

    with (
        chosen_executor(cluster, places[0]) as executor,
        reporting(progress, f"{len(jobs)} sessions") as report,
    ):
        say(progress, [executor.in_words] if executor else [])
        run_jobs(jobs, above(places[0]), on_result, processes, executor=executor)
    return Batch(tuple(lines[job.key] for job in jobs))


def _places(session: str | Path) -> list[str]:
    """The folder or address of a session, or the addresses of those below one. Raises SessionError."""
    place = folder_of(str(session))
    if not is_address(place):
        return [str(open_session(place).path)]
    below = sessions_at(place)
    broken = next((one for one in below if not one.whole), None)
    if broken is not None or not below:
        # Says what is wrong with it.
        remote_sessions.remote_session(broken.address if broken else place)
    return [one.address for one in below]


def _job(place: str, name: str, options: dict[str, Any]) -> TrialJob:
    """The trial of a session. Two requests that differ in anything are two runs: their notes differ."""
    usual = {
        "tracker": "",
        "weighting": "",
        "body": "",
        "behaviour": "",
        "first": None,
        "last": None,
        "seed": 0,
    }
    wanted = {**usual, "fit_shape": True, "allow_inconsistent": False}
    wanted |= {key: value for key, value in options.items() if key != "knobs"}
    wanted[ALLOW_INCONSISTENT] = wanted.pop("allow_inconsistent")
    arguments = plain({**wanted, "changes": dict(options.get("knobs") or {})})
    digest = hashlib.sha256(json.dumps(arguments, sort_keys=True).encode()).hexdigest()[:12]
    return TrialJob(
        key=place,
        experiment=checked_name(name, "run"),
        label=Path(place).name,
        arguments={**arguments, "footage": place, "run": name, "note": f"A run of batch {digest}."},
        measure=measure_run_of_batch,
        footage=(place,),
        frames=None,
        alone=False,
    )
