"""Comparisons on disk: a folder each, in the session they belong to, so that all can be resumed.

`comparisons/<name>/`: `comparison.json` (the request), `search.behaviour.model` (a copy of the model of those that need
one), `trials/` (one file an outcome, as soon as it is measured),
and once all are done `result.json` (numbers, findings, every frame) and `frames.csv`.
"""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from studio.foundations.foreign_files import LARGEST_RECORD, read_file
from studio.foundations.typed_decoding import decode_json
from studio.results.comparison.comparison_findings import document, findings, frames_csv
from studio.results.comparison.findings import Heading
from studio.results.comparison.findings_document import Making, as_document
from studio.results.comparison.kept_trials import KeptTrials, measured_by, plain
from studio.results.comparison.plan import Comparison, Plan
from studio.results.comparison.sweep import Sweep, sweep_csv, sweep_document
from studio.results.comparison.trials import Scale, Trial
from studio.sessions import atomic_files
from studio.sessions.manifest import now
from studio.sessions.object_stores import below, is_address
from studio.sessions.process_lock import ProcessLock
from studio.sessions.record_files import Entries, RecordFile, renamed
from studio.sessions.remote_sessions import place_in_words
from studio.sessions.session import Session

RECORD_NAME, RESULT_NAME, FRAMES_NAME = "comparison.json", "result.json", "frames.csv"
BEHAVIOUR_NAME = "behaviour.model"
LOCK_NAME, TRIALS_NAME = "comparison.lock", "trials"
SCHEMA_VERSION = 3


class ComparisonRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The requested comparison. name : of the folder when it was made. created : UTC, ISO 8601. software : the studio's
    version.

    ended : "cancelled" or "failed" where it was stopped so, else ""; problem : the reason.
    """

    schema: int = SCHEMA_VERSION
    name: str
    created: str
    software: str
    plan: Plan
    ended: str = ""
    problem: str = ""


def _plan_renamed(**names: str) -> Callable[[Entries], Entries]:
    """A migration that gives entries of the plan other names."""
    return lambda entries: entries | {"plan": renamed(**names)(entries["plan"])}


RECORD = RecordFile(
    ComparisonRecord,
    "a comparison's record",
    "Start a new one.",
    ("There is no comparison '{name}'.", "Start one with 'studio compare'."),
    SCHEMA_VERSION,
    {1: _plan_renamed(entrants="candidates"), 2: _plan_renamed(despite_findings="allow_inconsistent")},
)


@dataclass(frozen=True, slots=True)
class KeptComparison:
    """A comparison's folder, in any state."""

    folder: Path

    @property
    def name(self) -> str:
        return self.folder.name

    def note_of(self, trial: str) -> str:
        """What the record of a run says that was made for a trial of this name; "": how all of these begin. It stays
        where a comparison comes back from the trash under another name.
        """
        record = self.record()
        return f"A trial of comparison {record.name}, made {record.created}: {trial}"

    @property
    def kept_trials(self) -> KeptTrials:
        return KeptTrials(self.folder / TRIALS_NAME)

    def record(self) -> ComparisonRecord:
        """The request. Raises NotFoundError where there is none, SessionError where it cannot be read."""
        return RECORD.read(self.folder / RECORD_NAME)

    def plan(self, session: Session | None = None) -> Plan:
        """The requested plan; with the present place of the session, if one is given, which is an
        address where it is a copy of one in a store.
        """
        plan = self.record().plan
        if plan.behaviour:
            plan = replace(plan, behaviour_path=str((self.folder / BEHAVIOUR_NAME).absolute()))
        if session is None:
            return plan
        footage = place_in_words(session)
        if plan.behaviour and is_address(footage) and self.folder.is_relative_to(session.path):
            place = below(footage, self.folder.parent.name, self.name, BEHAVIOUR_NAME)
            plan = replace(plan, behaviour_path=place)
        return replace(plan, footage=footage, session=session.name)

    def status(self) -> str:
        """running, done, cancelled, failed, or interrupted (its process ended; it can be resumed)."""
        if (self.folder / RESULT_NAME).is_file():
            return "done"
        if self.is_running():
            return "running"
        return self.record().ended or "interrupted"

    def is_running(self) -> bool:
        return ProcessLock.is_held(self.folder / LOCK_NAME)

    def lock(self) -> ProcessLock | None:
        """The lock for working on it, None while another process has it."""
        return ProcessLock.take(self.folder / LOCK_NAME)

    def end(self, how: str, problem: str = "") -> None:
        """Record that it was stopped ("cancelled", "failed") or resumed ("")."""
        ended = msgspec.structs.replace(self.record(), ended=how, problem=problem)
        RECORD.write(self.folder / RECORD_NAME, ended)

    def finish(self, measured: Comparison | Sweep) -> None:
        """Write the result, the frames first, so that both exist once there is a result."""
        if isinstance(measured, Sweep):
            frames, result = sweep_csv(measured), sweep_document(measured)
        else:
            frames, result = frames_csv(measured), result_of(measured)
        atomic_files.write_text(self.folder / FRAMES_NAME, frames)
        atomic_files.write_bytes(self.folder / RESULT_NAME, msgspec.json.encode(result) + b"\n")

    def result(self) -> dict[str, Any] | None:
        """Numbers (`document`), `findings` and `per_frame`, of a sweep `sweep_document`; None while unfinished."""
        path = self.folder / RESULT_NAME
        return decode_json(read_file(path, LARGEST_RECORD), dict[str, Any]) if path.is_file() else None


def trial_key(trial: Trial) -> str:
    """The name of a trial's outcome, from its arguments without paths."""
    elsewhere = ("footage", "behaviour")
    arguments = {name: value for name, value in plain(trial.arguments).items() if name not in elsewhere}
    return hashlib.sha256(json.dumps(arguments, sort_keys=True).encode()).hexdigest()[:24]


def result_of(comparison: Comparison) -> dict[str, Any]:
    """The stored result of a comparison, plain; NaN is written as null."""
    return {
        **document(comparison),
        "per_frame": {
            "frames": list(comparison.frames),
            "error_mm": {
                result.tracker: [list(seed.per_frame_mm) for seed in result.seeds]
                for result in comparison.trackers
            },
        },
        "findings": _findings_document(comparison),
    }


def _findings_document(comparison: Comparison) -> dict[str, Any]:
    plan = comparison.plan
    names = ", ".join(candidate.name for candidate in plan.candidates)
    heading = Heading(
        "comparison", f"{names} on {plan.session}", f"{plan.evaluations} evaluations a frame", claim=""
    )
    seconds = sum(result.seconds for result in comparison.trackers)
    count = len(plan.seeds) * len(plan.candidates)
    making = Making(Scale(plan.seeds), count, seconds, measured_by(), (), now())
    return as_document(heading, findings(comparison), making)
