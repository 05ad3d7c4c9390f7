"""Replay of a live run without the clock: the same frames, the same settings at the same layers.

Poses and weights are bit for bit the same, whatever the machine's load was. So a live result can be examined again, and
checked by anyone who has the footage.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import numpy as np

from studio.foundations.errors import RunError
from studio.foundations.foreign_files import read_file, read_text
from studio.runs.live.live_problems import LiveProblems
from studio.runs.live.live_run import LiveRun
from studio.runs.problem_source import ProblemSource
from studio.search.settings import RunSettings, SettingsHistory, settings_from_values
from studio.search.trackers.random_numbers import COUNTED
from studio.sessions.manifest import now
from studio.sessions.run_record import BEHAVIOUR_NAME, CAMERAS_NAME
from studio.sessions.session import Session, free_run_name
from studio.sessions.stored_run import BODY_FOLDER, StoredRun


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two runs compared.

    frames : how many were compared.
    different : numbers of the frames whose pose or log weight differs in any bit.
    """

    frames: int
    different: tuple[int, ...]


def prepare_replay(session: Session, run: StoredRun, name: str = "") -> StoredRun:
    """A new run with the frames and settings of a live one. Raises RunError for a run that was not live, has no frames
    or used other random numbers, SessionError if the name is taken.
    """
    record = run.record
    with run.results() as results:
        if not record.live or not results.done():
            raise RunError(f"Run '{run.name}' has no frames that were tracked live.", "Choose a live run.")
    if record.random_numbers != COUNTED:
        raise RunError(
            f"Run '{run.name}' was begun when searches drew their random numbers in turn; now they count them, and its "
            "frames would come out otherwise.",
            f"Replay it with a studio of {record.created[:10]}, or track its frames as a new run: "
            f"studio track {session.name}.",
        )
    bodies = sorted((run.folder / BODY_FOLDER).glob("*.toml"))
    following = msgspec.structs.replace(
        record,
        name=name or free_run_name(session),
        created=now(),
        notes=(*record.notes, f"The frames that '{run.name}' tracked live, without the clock."),
    )
    text = read_text(bodies[0]) if bodies else ""
    behaviour = run.folder / BEHAVIOUR_NAME if record.behaviour else None
    # The session's calibration may have changed since.
    return session.new_run(following, text, behaviour, read_file(run.folder / CAMERAS_NAME))


def replay(source: StoredRun, into: StoredRun, problems: ProblemSource) -> Iterator[int]:
    """Track the frames of a live run again; yields each frame when done. Raises the errors of tracking."""
    with source.results() as results:
        frames, history = results.frames(), SettingsHistory(tuple(results.settings_history()))
    run = LiveRun(into, LiveProblems(problems))
    try:
        for frame in frames:
            run.go_to(frame)
            while run.next_frame == frame and not run.finished:
                run.settings_source = lambda: _settings_at(history, source, run)
                run.step_layer()
            yield frame
        if not run.finished:
            run.end()
    finally:
        run.close()


def compare(one: StoredRun, other: StoredRun) -> Comparison:
    """Compare two runs frame by frame; a frame that one of them lacks counts as different."""
    bytes_of: list[dict[int, bytes]] = []
    for run in (one, other):
        with run.results() as results:
            frames, poses = results.poses()
            weights = results.timeline().log_weights
        rows = np.column_stack([poses, weights]) if len(frames) else np.zeros((0, 1))
        bytes_of.append({int(frame): row.tobytes() for frame, row in zip(frames, rows, strict=True)})
    every = sorted(bytes_of[0].keys() | bytes_of[1].keys())
    return Comparison(
        len(every), tuple(frame for frame in every if bytes_of[0].get(frame) != bytes_of[1].get(frame))
    )


def _settings_at(history: SettingsHistory, source: StoredRun, run: LiveRun) -> tuple[int, RunSettings]:
    """The settings of the live run in the next layer, and their version."""
    entry = history.in_use(run.next_frame, run.layers_done) or history.entries[0]
    record = source.record
    return entry.version, settings_from_values(record.tracker, record.weighting, entry.values)
