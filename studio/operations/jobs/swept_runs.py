"""The trial of a sweep or a batch: a run of the session, tracked to its end and measured."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from studio.foundations.progress import report
from studio.operations.jobs.batch import track_to_end, track_together
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.sweep import measured_run
from studio.results.comparison.trials import ALLOW_INCONSISTENT, kept_as
from studio.runs.new_run import prepare_run
from studio.runs.setup.session_settings import session_settings
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING, values
from studio.sessions.names import free_name
from studio.sessions.remote_sessions import bring_runs, put_run, remote_runs
from studio.sessions.run_record import RunRecord
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@kept_as("swept_runs.measure_run")
def measure_run(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track a run and measure it; the fields of `Swept`. An earlier attempt of the same name is continued; for a
    session in a store also one of another machine, and the tracked run is put there.
    """
    session = cache.session(arguments["footage"])
    run = _begun(session, arguments)
    if _is_unfinished(run):
        track_to_end(session, run, report)
    return _measured(session, run)


@kept_as("swept_runs.measure_runs")
def measure_runs(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track runs of a session side by side and measure them as `measure_run`: `measured`, the fields of each one's
    `Swept`.

    arguments : `trials`, those of each. Where they fail together, they are tracked one by one.
    """
    trials = arguments["trials"]
    session = cache.session(trials[0]["footage"])
    runs = [_begun(session, one) for one in trials]
    try:
        track_together(session, [run for run in runs if _is_unfinished(run)], report)
    except Exception:
        return {"measured": [measure_run(one, cache) for one in trials]}
    return {"measured": [_measured(session, run) for run in runs]}


def _begun(session: Session, arguments: Mapping[str, Any]) -> StoredRun:
    bring_runs(session, arguments["run"])
    return _earlier_attempt(session, arguments) or _new(session, arguments)


def _is_unfinished(run: StoredRun) -> bool:
    return run.summary(blobs=False).done < run.record.frame_count


def _measured(session: Session, run: StoredRun) -> dict[str, Any]:
    if run.name not in remote_runs(session):
        put_run(session, run)
    return asdict(measured_run(session, run))


@kept_as("swept_runs.measure_run_of_batch")
def measure_run_of_batch(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """The same for a session that the caller has not opened: what is left out is the session's own."""
    session = cache.session(arguments["footage"])
    about, first = session.manifest, arguments["first"]
    first, last = session.checked_frames(
        session.start_pose_frame() if first is None else first, arguments["last"]
    )
    filled = {
        "first": first,
        "last": last,
        "tracker": arguments["tracker"] or about.tracker or DEFAULT_TRACKER,
        "weighting": arguments["weighting"] or about.weighting or DEFAULT_WEIGHTING,
    }
    return measure_run({**arguments, **filled}, cache)


def _earlier_attempt(session: Session, arguments: Mapping[str, Any]) -> StoredRun | None:
    """The run that an earlier attempt at this trial left, None without one. Its record has the trial's note, if any."""
    wanted = session_settings(session, arguments["tracker"], arguments["weighting"], arguments["changes"])
    for run in session.runs():
        # A name that was taken has a number behind it.
        if not run.name.startswith(arguments["run"]) or not _is_of(run.record, arguments):
            continue
        if "note" in arguments and arguments["note"] not in run.record.notes:
            continue
        if dict(run.record.settings) == dict(values(wanted)) and not run.being_tracked():
            return run
    return None


def _is_of(record: RunRecord, arguments: Mapping[str, Any]) -> bool:
    names = ("tracker", "weighting", "seed", "first", "last", *(["body"] if arguments["body"] else []))
    return all(getattr(record, name) == arguments[name] for name in names)


def _new(session: Session, arguments: Mapping[str, Any]) -> StoredRun:
    taken = {run.name for run in session.runs()}
    return prepare_run(
        session,
        tracker=arguments["tracker"],
        weighting=arguments["weighting"],
        body=arguments["body"],
        behaviour=arguments.get("behaviour", ""),
        first=arguments["first"],
        last=arguments["last"],
        seed=arguments["seed"],
        knobs=arguments["changes"],
        fit_shape=arguments["fit_shape"],
        allow_inconsistent=arguments.get(ALLOW_INCONSISTENT, False),
        note=arguments.get("note", ""),
        name=free_name(arguments["run"], taken),
    )
