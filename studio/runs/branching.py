"""A run that leaves another one at a frame: earlier frames are that run's, this one and all later ones are tracked with
other knobs. The other run is not changed.

The frame is searched from the same start with the same random numbers, so its result is the one that annealing it again
with these knobs has shown.
"""

from collections.abc import Mapping

from studio.foundations.errors import SettingsError
from studio.runs.derived_runs import check_branching_frame, derived_record, new_folder
from studio.runs.moved_knobs import FIRST_VERSION, keep_moved, moved_between, settings_with_moved
from studio.search.settings import (
    RunSettings,
    SettingsHistory,
    all_knobs,
    changed_settings,
    settings_from_values,
    values,
)
from studio.sessions.names import free_name, name_from
from studio.sessions.session import Session, make_numbered_run
from studio.sessions.stored_run import StoredRun


def prepare_branch(
    session: Session, run: StoredRun, frame: int, knobs: Mapping[str, object] | None = None, name: str = ""
) -> StoredRun:
    """Make the run's folder with the frames before `frame`; then track it like any other.

    frame : of the run, or the one after its last.
    knobs : changes by name; all others are as the run would continue, with the knobs that were moved in it.

    Raises RunError, SessionError, SettingsError; then nothing was made.
    """
    record = run.record
    check_branching_frame(run, frame)
    wanted = changed_settings(settings_with_moved(run), knobs or {})
    version, before = _settings_before(run, frame)
    moved = moved_between(before, wanted)
    if not moved:
        raise SettingsError(
            f"No knob differs from those that frame {frame} of run '{run.name}' was tracked with.",
            "Change at least one.",
        )
    is_whole = frame == record.first
    fixed = [
        entry.name for entry in all_knobs(wanted) if entry.takes_effect == "new run" and entry.name in moved
    ]
    if fixed and not is_whole:
        raise SettingsError(
            f"Setting '{fixed[0]}' cannot change inside a run.",
            f"Leave it, or branch off at the first frame ({record.first}).",
        )
    changed = ", ".join(f"{knob} {value}" for knob, value in moved.items())
    made = derived_record(
        session,
        run,
        name or _name_of(session, run, moved),
        f"From frame {frame} on run '{run.name}' with {changed}.",
        settings=dict(values(wanted)) if is_whole else record.settings,
    )

    def leave_moved(made_run: StoredRun) -> None:
        if not is_whole:
            keep_moved(made_run, version, moved)

    return make_numbered_run(session, made, name, lambda record: new_folder(run, record, frame, leave_moved))


MOST_NAMED = 2
"""Knobs that a run's name says, at most."""


def _name_of(session: Session, run: StoredRun, moved: Mapping[str, object]) -> str:
    """The name of the run: the one it leaves, and the changes, such as "walk-1-survival-0-8"."""
    changed = [part for knob, value in moved.items() for part in (knob, value)]
    if len(moved) > MOST_NAMED:
        changed = [len(moved), "knobs"]
    wanted = name_from("-".join(str(part).replace("_", "-") for part in (run.name, *changed)), "run")
    return free_name(wanted, {one.name for one in session.runs()})


def _settings_before(run: StoredRun, frame: int) -> tuple[int, RunSettings]:
    """The settings that the frames before `frame` ended with, and their version."""
    record = run.record
    with run.results() as results:
        history = SettingsHistory(tuple(results.settings_history()))
    entry = history.in_use(frame - 1, 2**31)
    if entry is None:
        return FIRST_VERSION, settings_from_values(record.tracker, record.weighting, record.settings)
    return entry.version, settings_from_values(record.tracker, record.weighting, entry.values)
