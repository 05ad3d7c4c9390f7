"""Functions run on other machines: tasks of Dask.distributed behind `concurrent.futures.Executor`.

A scheduler hands them to its workers, wherever they run. All machines need the same versions, and the folder of what is
worked at at the same path, or the right to use the store where it lies: arguments and results travel, footage and runs
do not.
"""

import gc
import importlib
import importlib.util
import os
import pickle
import platform
import socket
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Executor, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar
from uuid import uuid4

from pydantic import Field

from studio.foundations.children import answered
from studio.foundations.declaring import Terminal, Web
from studio.foundations.errors import RunError, SessionError, StudioError, WorkCancelledError
from studio.foundations.progress import heard_by
from studio.operations.jobs.process_executor import ProcessLostError
from studio.results.comparison.kept_trials import measured_by
from studio.sessions.atomic_files import PARTIAL_PREFIX
from studio.sessions.object_stores import Store, is_address

P = ParamSpec("P")
T = TypeVar("T")

VARIABLE = "STUDIO_CLUSTER"
CLUSTER_HELP = (
    "Scheduler of a Dask cluster, as tcp://HOST:8786, whose workers run the trials;"
    f" default: {VARIABLE}, else processes of this machine."
)
# No body of HTTP: what a scheduler sends is unpickled, so only who starts the server says which one is trusted.
Cluster = Annotated[str, Field(description=CLUSTER_HELP), Terminal(metavar="ADDRESS"), Web(left_out=True)]
INSTALL = 'Install it on all machines: pip install "capture-studio[cluster]"'
SHARE = (
    "Mount one file system (NFS, SMB, the cluster's own) at the same path on all machines, keep the workspace there,"
    " and let workers run as a user who may read and write it."
)
PATIENCE = 10.0
"""How long a scheduler may take to answer, s."""
STORE = "Give all machines the same address of the store (for S3: AWS_ENDPOINT_URL), with a right to read and write."
LOOKS_APART, REMOTE_LOOKS_APART = 1.0, 5.0
"""Seconds between two looks of a task whether it is still wanted: at a folder, at a store."""
COMPUTING = ("numpy", "numba", "scipy", "opencv-python-headless", "distributed")
"""Packages on whose versions results, or what is understood of a message, may depend."""


@contextmanager
def chosen_executor(address: str, folder: Path | str) -> Generator["ClusterExecutor | None"]:
    """The executor of a cluster whose workers see `folder`, which may be an address of a store; None for processes of
    this machine, where neither `address` nor STUDIO_CLUSTER names one. What is not done at the end is cancelled.

    Raises RunError, SessionError.
    """
    address = address or os.environ.get(VARIABLE, "").strip()
    if not address:
        yield None
        return
    executor = ClusterExecutor(address, folder)
    try:
        yield executor
    finally:
        executor.shutdown(cancel_futures=True)


class ClusterExecutor(Executor):
    """The workers of the Dask scheduler at an address. Functions, arguments and results are pickled.

    folder : which all workers have to see, or an address of a store. on_report : hears, in another thread, what tasks
    `progress.report`, values of MessagePack. A task whose worker is lost is given to another, as often as the scheduler
    allows (Dask's `distributed.scheduler.allowed-failures`, 3). Raises RunError where the package is missing, the
    scheduler does not answer, or a worker has other versions or does not see the folder; SessionError where nothing can
    be written there.
    """

    def __init__(
        self,
        address: str,
        folder: Path | str,
        on_report: Callable[..., None] | None = None,
        patience: float = PATIENCE,
    ) -> None:
        self.address = address
        self._changed = threading.Lock()
        self._tasks: dict[Future[Any], Any] = {}
        self._closed = False
        self._client = _connect(address, patience)
        self._marker: _Marker | None = None
        try:
            self._marker = _marked(folder)
            topic = f"studio-{uuid4().hex}" if on_report else ""
            self._needs = _Needs(_software(), self._marker, topic)
            if on_report:
                self._client.subscribe_topic(topic, partial(_pass_report, on_report))
            self._check_machines()
            threads = self._client.nthreads().values()
            self.workers, self.threads = len(threads), sum(threads)
        except BaseException:
            self._close()
            raise

    @property
    def in_words(self) -> str:
        """How many workers there were when the scheduler answered."""
        if not self.workers:
            return f"The cluster at {self.address} has no worker yet; the first one that comes begins."
        return f"The cluster at {self.address}: {self.workers} workers, {self.threads} trials at once."

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Run `fn(*args, **kwargs)` on a worker; the future raises what it raised, ProcessLostError where it lost too
        many workers, RunError where the scheduler is gone or a worker is of no use.

        Raises RuntimeError after a shutdown, what pickle raises for what cannot be pickled.
        """
        content = pickle.dumps((fn, args, kwargs))
        future: Future[T] = Future()
        with self._changed:
            if self._closed:
                raise RuntimeError("The executor is shut down.")
            task = self._client.submit(_run_there, content, self._needs, pure=False)
            self._tasks[future] = task
        future.add_done_callback(self._forget)
        task.add_done_callback(partial(self._answer, future))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks. cancel_futures : cancel those that wait; those that run end at what they report next."""
        with self._changed:
            if self._closed:
                return
            self._closed = True
            going = dict(self._tasks)
        if cancel_futures:
            self._withdraw()
            for future in going:
                future.cancel()
            self._close()
        elif wait:
            _wait(going)
            self._close()
        else:
            threading.Thread(target=self._close_after, args=(going,), name="cluster-end", daemon=True).start()

    def _close_after(self, going: Mapping[Future[Any], Any]) -> None:
        _wait(going)
        self._close()

    def _close(self) -> None:
        self._withdraw()
        self._client.close()

    def _withdraw(self) -> None:
        """Tell tasks that run that they are not wanted any more."""
        if self._marker is not None:
            with suppress(OSError, StudioError):
                self._marker.remove()

    def _forget(self, future: Future[Any]) -> None:
        with self._changed:
            task = self._tasks.pop(future, None)
        if future.cancelled() and task is not None:
            task.cancel()

    def _answer(self, future: Future[Any], task: Any) -> None:  # noqa: ANN401 - a future of Dask
        """Called in a thread of Dask's with the outcome of a task."""
        if not future.set_running_or_notify_cancel():
            return
        try:
            kind, answer = pickle.loads(task.result())
        except BaseException as problem:
            kind, answer = "raised", self._in_words(problem)
        if kind == "raised":
            future.set_exception(answer)
        else:
            future.set_result(answer)

    def _in_words(self, problem: BaseException) -> StudioError:
        """What kept a task from being run to its end."""
        if isinstance(problem, StudioError):
            return problem
        name = type(problem).__name__
        if name == "KilledWorker":
            failures: int = getattr(problem, "allowed_failures", 0) + 1
            last = getattr(getattr(problem, "last_worker", None), "address", "unknown")
            return ProcessLostError(
                f"It lost {failures} workers one after another, the last one was {last}.",
                "The workers' own output says why; a machine without enough memory is the usual cause.",
            )
        if "Cancelled" in name:
            return RunError(
                f"The scheduler at {self.address} is gone, or has dropped what was to be done.",
                "Start it and its workers, then the same again: what was finished is kept.",
            )
        return _useless("A machine of the cluster", problem)

    def _check_machines(self) -> None:
        """Raises RunError where the scheduler or a worker has other versions or does not see the folder."""
        try:
            self._client.run_on_scheduler(_check_software, self._needs, f"The scheduler at {self.address}")
            self._client.run(_check_worker, self._needs)
        except StudioError:
            raise
        except Exception as problem:
            raise _useless("A machine of the cluster", problem) from None


@dataclass(frozen=True, slots=True)
class _Marker:
    """A file that is there as long as the executor wants its results. folder : an absolute path, or an address."""

    folder: str
    name: str

    def is_there(self) -> bool:
        """Whether this machine sees it. Raises SessionError where a store refuses."""
        if is_address(self.folder):
            return Store(self.folder).has(self.name)
        return (Path(self.folder) / self.name).is_file()

    def remove(self) -> None:
        if is_address(self.folder):
            Store(self.folder).remove([self.name])
        else:
            (Path(self.folder) / self.name).unlink(missing_ok=True)


@dataclass(frozen=True, slots=True)
class _Needs:
    """What a worker must have. software : versions. marker : which it must see. topic : of reports, "" for none."""

    software: Mapping[str, str]
    marker: _Marker
    topic: str


def _connect(address: str, patience: float) -> Any:  # noqa: ANN401 - of a package that need not be there
    if importlib.util.find_spec("distributed") is None:
        raise RunError("Work on a cluster needs Dask.distributed, which is not installed.", INSTALL)
    try:
        return _dask().Client(address, timeout=patience, set_as_default=False, name="capture-studio")
    except (OSError, ValueError, TypeError) as problem:
        said = _first_line(problem)
        traceback.clear_frames(problem.__traceback__)
    # Dask's client that never came up closes itself when it is collected, which hangs while another one starts.
    gc.collect()
    raise RunError(
        f"The cluster's scheduler at '{address}' does not answer ({said}).",
        "Start one with 'dask scheduler' and give the address that it prints, such as tcp://HOST:8786;"
        f" without --cluster and {VARIABLE} this machine works alone.",
    )


def _dask() -> Any:  # noqa: ANN401 - loaded only where it is used
    return importlib.import_module("distributed")


def _marked(folder: Path | str) -> _Marker:
    """A new file by which workers know the folder or store."""
    if is_address(folder):
        marker = _Marker(str(folder), f"{PARTIAL_PREFIX}cluster-{uuid4().hex}")
        Store(marker.folder).write(marker.name, b"studio")
        return marker
    try:
        handle, name = tempfile.mkstemp(prefix=f"{PARTIAL_PREFIX}cluster-", dir=folder)
    except OSError as problem:
        raise SessionError(
            f"No file can be written in '{folder}' ({problem.strerror}), by which a cluster's workers would know it.",
            "Give yourself the right to write there, or work without a cluster.",
        ) from None
    os.close(handle)
    return _Marker(str(Path(folder).absolute()), Path(name).name)


@cache
def _software() -> dict[str, str]:
    return {
        "capture-studio": measured_by(),
        "Python": ".".join(platform.python_version_tuple()[:2]),
        **{name: version(name) for name in COMPUTING},
    }


def _useless(who: str, problem: BaseException) -> RunError:
    return RunError(
        f"{who} cannot run the studio's trials: {type(problem).__name__}: {_first_line(problem)}.",
        f"{INSTALL}, in the environment of scheduler and workers, in the same versions.",
    )


def _pass_report(on_report: Callable[..., None], event: tuple[float, tuple[object, ...]]) -> None:
    """An event of the scheduler: when it came, and the words of a report."""
    on_report(*event[1])


def _first_line(problem: BaseException) -> str:
    return str(problem).strip().partition("\n")[0][:200]


_wait = wait  # where a parameter is called `wait`


# ------------------------------------------------------------------ on the other machines


def _check_software(needs: _Needs, who: str) -> None:
    """Raises RunError where this machine has other versions."""
    installed = _software()
    for name, wanted in needs.software.items():
        if installed.get(name) != wanted:
            raise RunError(
                f"{who} has {name} {installed.get(name, 'missing')}, this machine has {wanted}.",
                "Install the same versions on all machines: other ones may give other results.",
            )


def _check_worker(needs: _Needs) -> None:
    """Raises RunError where this worker has other versions or does not see the folder."""
    who = f"A worker on {socket.gethostname()}"
    _check_software(needs, who)
    folder = needs.marker.folder
    try:
        seen = needs.marker.is_there()
    except StudioError as problem:
        raise RunError(f"{who} cannot use the store: {problem.message}", problem.hint) from None
    if not seen:
        hint = STORE if is_address(folder) else SHARE
        raise RunError(f"{who} does not see the folder '{folder}' as this machine does.", hint)


def _run_there(content: bytes, needs: _Needs) -> bytes:
    """Run a task on a worker. Raises RunError where that is of no use."""
    _check_worker(needs)
    worker, looked = _dask().get_worker(), time.monotonic()
    apart = REMOTE_LOOKS_APART if is_address(needs.marker.folder) else LOOKS_APART

    def report(*words: object) -> None:
        nonlocal looked
        if needs.topic:
            worker.log_event(needs.topic, words)
        if time.monotonic() - looked > apart:
            looked = time.monotonic()
            if not needs.marker.is_there():
                raise WorkCancelledError("Nobody waits for it any more.")

    with heard_by(report):
        return answered(content)
