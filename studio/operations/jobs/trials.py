"""Trials run by any executor: by default in as many processes as there are cores, each on one core."""

import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from studio.foundations.errors import StudioError
from studio.operations.jobs.process_executor import ONE_CORE, ProcessExecutor, ProcessLostError, cores
from studio.results.comparison.footage_cache import MOST_BYTES, FootageCache
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.trials import Plain, TrialJob, failure_in_words
from studio.sessions.remote_sessions import remote_file

LOSSES_ALLOWED = 1
"""How often a trial is tried again whose process, or machine, was lost."""
MEMORY_SHARE = 0.5
CHECK_SECONDS = 0.2


@dataclass(frozen=True, slots=True)
class TrialResult:
    """measured : plain values, None where it failed; failure : why, then."""

    key: str
    measured: dict[str, Plain] | None
    failure: str
    seconds: float


OnResult = Callable[[TrialJob, TrialResult], None]


def run_jobs(
    jobs: Sequence[TrialJob],
    footage_folder: Path | str,
    on_result: OnResult,
    processes: int | None = None,
    *,
    executor: Executor | None = None,
    checkpoint: Callable[[], None] = lambda: None,
) -> None:
    """Run all jobs, those that must be alone at the end, one by one.

    footage_folder : see `FootageCache`; an address is one that all that run jobs can use.
    on_result : called here, as each is done. processes : at once, None for one a core. executor : runs them instead of
    processes of this call's own (threads, or other machines': `cluster.ClusterExecutor`); it is left open.
    checkpoint : called here, several times a second. Whatever is raised here (KeyboardInterrupt, or what `on_result`
    and `checkpoint` raise), no process of this call's own is left, and what waits elsewhere is cancelled. Raises
    StudioError of an executor that cannot run any.
    """
    shared = [job for job in jobs if not job.alone]
    alone = [job for job in jobs if job.alone]
    if executor is not None:
        for group in ([shared] if shared else []) + [[job] for job in alone]:
            _run(group, footage_folder, on_result, executor, None, checkpoint)
        return
    for group, most, environment in ((shared, processes or cores(), ONE_CORE), (alone, 1, None)):
        if not group:
            continue
        count = max(1, min(most, len(group)))
        own = ProcessExecutor(count, environment=environment, near=_footage_of)
        try:
            _run(group, footage_folder, on_result, own, count, checkpoint)
        finally:
            own.shutdown(cancel_futures=True)


def run_trial(job: TrialJob, footage_folder: str, at_once: int | None) -> TrialResult:
    """Run one job; whatever goes wrong becomes words. Evidence of its footage is kept for the thread's next.

    at_once : trials that share this machine's memory, None for one a core.
    """
    began = time.perf_counter()
    measured, failure = None, ""
    cache: FootageCache | None = getattr(_here, "cache", None)
    if cache is None or cache.place != footage_folder:
        if cache is not None:
            cache.close()
        cache = _here.cache = FootageCache(footage_folder, _cache_bytes(at_once or cores()))
    try:
        arguments = {**job.arguments}
        if "behaviour" in arguments:
            arguments["behaviour"] = remote_file(arguments["behaviour"])
        measured = plain(job.measure(arguments, cache))
    except Exception as error:
        failure = failure_in_words(error)
    return TrialResult(job.key, measured, failure, time.perf_counter() - began)


_here = threading.local()


def _run(
    jobs: Sequence[TrialJob],
    footage_folder: Path | str,
    on_result: OnResult,
    executor: Executor,
    at_once: int | None,
    checkpoint: Callable[[], None],
) -> None:
    lost = dict[str, int]()
    going = dict[Future[TrialResult], TrialJob]()

    def submit(job: TrialJob) -> None:
        going[executor.submit(run_trial, job, str(footage_folder), at_once)] = job

    try:
        for job in jobs:
            submit(job)
        while going:
            checkpoint()
            done, _ = wait(going, CHECK_SECONDS, FIRST_COMPLETED)
            for future, job in [(future, job) for future, job in going.items() if future in done]:
                del going[future]
                problem = CancelledError("It was cancelled.") if future.cancelled() else future.exception()
                if problem is None:
                    on_result(job, future.result())
                    continue
                # A trial raises nothing: what ran it was lost, or refuses to run any.
                if isinstance(problem, StudioError) and not isinstance(problem, ProcessLostError):
                    raise problem
                lost[job.key] = lost.get(job.key, 0) + 1
                if lost[job.key] <= LOSSES_ALLOWED:
                    with suppress(Exception):
                        submit(job)
                        continue
                on_result(job, TrialResult(job.key, None, str(problem) or type(problem).__name__, 0.0))
    finally:
        for future in going:
            future.cancel()


def _footage_of(_run: object, job: TrialJob, *_: object) -> tuple[str, ...]:
    return job.footage


def _cache_bytes(count: int) -> int:
    """How much evidence each of so many processes may keep: half of the memory among them, at most."""
    if not hasattr(os, "sysconf"):
        return MOST_BYTES
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return min(MOST_BYTES, int(memory * MEMORY_SHARE / count))
