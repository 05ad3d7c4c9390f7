"""The arena: frames as black-box problems, and races of optimisers on them."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
from pydantic import Field

from studio.foundations.declaring import Terminal, Web, operation, taking
from studio.foundations.errors import NotFoundError, RunError, SessionError
from studio.foundations.foreign_files import read_file
from studio.foundations.progress import Progress
from studio.foundations.typed_decoding import decode_json
from studio.operations.jobs.process_executor import cores
from studio.operations.jobs.trials import TrialResult, run_jobs
from studio.operations.opening import RunName, keeping_in_place, open_run, session_of
from studio.operations.progress import Reporting, reporting
from studio.results.arena.making import REFERENCE, problems_of_run
from studio.results.arena.problem import ArenaError, Definition, Problem
from studio.results.arena.problem_files import write_problems
from studio.results.arena.profiles import Trial
from studio.results.arena.race_files import DOCUMENT, PAGE, RaceDocument, race_document, write_race
from studio.results.arena.racers import RACERS, SUFFIX, Racer, racer_named
from studio.results.arena.racing import (
    as_trial,
    chosen,
    defined_in,
    measure_race,
    measure_races,
    planned,
    races_in_common,
)
from studio.results.comparison import trials as kinds
from studio.results.comparison.kept_trials import KeptOutcome, KeptTrials, measured_by, plain
from studio.results.comparison.tracked import SEEDS_AT_ONCE
from studio.results.comparison.trials import Outcome, TrialJob, measure_name
from studio.results.inspection.reading import InspectedRun
from studio.search.likelihood.devices import CPU, Device
from studio.sessions.atomic_files import writing
from studio.sessions.manifest import now
from studio.sessions.process_lock import ProcessLock
from studio.sessions.workspace import Workspace

ARENA, TRIALS, LOCK = "arena", "trials", "arena.lock"
"""Folder of races in the workspace, and what is in it."""
KEY_LENGTH = 24

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")]
"""From far away a racer is named and never a file, which would be run."""
ProblemFile = Annotated[
    str | Path,
    Field(description="A set of problems that was exported; default: the bundled one."),
    Terminal("--file", kind=Path, metavar="FILE"),
]
Reference = Annotated[
    int, Field(ge=1000, le=1_000_000_000, description="Poses that the search for the heaviest one weighs.")
]
Limbs = Annotated[
    Sequence[str],
    Field(
        description="A limb or a parameter that is searched, the rest held as the run has it (default: all)"
    ),
    Terminal("--limb", metavar="NAME"),
]
Frames = Annotated[
    Sequence[int], Field(description="Finished frames, each a problem."), Terminal("--frames", required=True)
]


@operation
def problems(file: ProblemFile = "") -> tuple[Problem, ...]:
    """List frames as black-box problems for an optimiser, which calls `problem.log_likelihood(poses)`.

    Each has bounds, a prior (start pose, σ0, last cloud of the frame before) and the heaviest pose that a long search
    knows. No footage is needed: what the likelihood reads is in the file.

    Raises ArenaError for a file that is missing or damaged.
    """
    return tuple(map(Problem, defined_in(str(file or ""))))


@dataclass(frozen=True, slots=True)
class ProblemLine:
    """A problem in a list.

    kind : "easy" or "hard".
    about : where its frame is from.
    weighting : the likelihood.
    microseconds : of an evaluation on the machine that made it.
    hash : of its function, bounds and prior.
    best_log_weight, best_evaluations, best_hash : of the heaviest known pose.
    """

    name: str
    kind: str
    about: str
    dimensions: int
    parameters: tuple[str, ...]
    weighting: str
    microseconds: float
    hash: str
    best_log_weight: float | None
    best_evaluations: int | None
    best_hash: str | None


def problem_line(problem: Problem) -> ProblemLine:
    """What a list says of a problem."""
    best = problem.best
    return ProblemLine(
        problem.name,
        problem.kind,
        problem.about,
        problem.dimensions,
        problem.parameters,
        problem.weighting,
        problem.microseconds,
        problem.hash,
        None if best is None else best.log_weight,
        None if best is None else best.evaluations,
        None if best is None else best.hash,
    )


@operation
@keeping_in_place
def problems_of(
    run: RunName,
    frames: Frames,
    *,
    limbs: Limbs = (),
    evaluations: Reference = REFERENCE,
    progress: Reporting = None,
) -> tuple[Problem, ...]:
    """Make problems of a run's frames, as its search began them, of any footage.

    The heaviest pose of each is searched for first, some seconds a frame.

    Raises NotFoundError for a frame that is not finished, ArenaError where the likelihood reads pictures or a hull.
    """
    return tuple(map(Problem, _defined(run, frames, limbs, evaluations, progress)))


@dataclass(frozen=True, slots=True)
class Exported:
    """A set of problems as a file. size : bytes."""

    file: Path
    problems: tuple[str, ...]
    size: int


@operation
@keeping_in_place
def export(
    run: RunName,
    to: Annotated[
        str | Path, Field(description="The file to write, .npz."), Terminal("--to", kind=Path, metavar="FILE")
    ],
    frames: Frames,
    *,
    limbs: Limbs = (),
    evaluations: Reference = REFERENCE,
    progress: Reporting = None,
) -> Exported:
    """Write a run's frames as problems into one file of at most 20 MB, which needs no footage.

    Raises as `problems_of`, and ArenaError for a set that is too large.
    """
    definitions = _defined(run, frames, limbs, evaluations, progress)
    file = write_problems(definitions, Path(to))
    return Exported(file, tuple(one.name for one in definitions), file.stat().st_size)


def _defined(
    run: RunName, frames: Sequence[int], limbs: Sequence[str], evaluations: int, progress: Reporting
) -> tuple[Definition, ...]:
    stored = open_run(run)
    opened = InspectedRun(session_of(stored), stored)
    if not frames:
        raise ArenaError("No frame is named.", "Name finished frames, such as 10,20.")
    with reporting(progress, f"{opened.session.name} / {opened.run.name}: searching for long") as report:
        return problems_of_run(opened, frames, limbs, evaluations, report)


def racers() -> tuple[Racer, ...]:
    """All racers that are installed: trackers, CMA-ES, SciPy's, and those of packages."""
    return tuple(RACERS.values())


@dataclass(frozen=True, slots=True, eq=False)
class Raced:
    """A race.

    trials : each racer on each problem with each seed: when it met heavier poses, and how near the known best they are.
    document : charts and tables as plain JSON values.
    folder : where the trials, `race.json` and the page `race.html` lie.
    measured, kept : trials that were run now, and that were kept from before.
    """

    trials: tuple[Trial, ...]
    document: RaceDocument
    folder: Path
    measured: int
    kept: int


@dataclass(frozen=True, slots=True)
class RaceRequest:
    """What is raced."""

    problems: Annotated[
        Sequence[str],
        Field(description="A problem by name, or all that are easy or hard (default: all)"),
        Terminal("--problem", metavar="NAME"),
        Web(kind=list[Name]),
    ] = ()
    racers: Annotated[
        Sequence[str],
        Field(description="A racer by name, or a Python file with one (default: all that are installed)"),
        Terminal("--racer", metavar="NAME"),
        Web(kind=list[Name]),
    ] = ()
    evaluations: Annotated[
        int, Field(ge=10, le=100_000_000, description="Poses that each racer may weigh of a problem.")
    ] = 10_000
    seeds: Annotated[int, Field(ge=1, le=1000, description="Number of seeds of each racer, from 0 on.")] = 5
    device: Annotated[
        Device, Field(description="What weighs poses, where the likelihood lets it be chosen.")
    ] = CPU
    file: ProblemFile = ""


@operation
@taking(RaceRequest)
def race(
    *,
    out: Annotated[
        str | Path | None,
        Field(description="Folder of what is kept; default: 'arena' in the workspace."),
        Terminal(kind=Path),
    ] = None,
    processes: Annotated[
        int | None, Field(ge=1, description="Trials at once; default: one a core."), Web(left_out=True)
    ] = None,
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> Raced:
    """Race optimisers on problems: how many evaluations each needs to come how near the heaviest known pose.

    Every trial is kept as soon as it is done: after Ctrl-C the same call goes on, and a race with one racer more runs
    that one alone. Writes `race.json` and a page, `race.html`.

    Raises ArenaError for an unknown problem, and for a racer that raises, weighs nothing or gives a pose that is not
    finite; UnknownMemberError for an unknown racer; RunError while another process races in the folder.
    """
    request = RaceRequest(**options)
    place = str(Path(request.file).absolute()) if request.file else ""
    definitions = chosen(defined_in(place), request.problems)
    named = tuple(
        str(Path(one).absolute()) if one.endswith(SUFFIX) else one for one in request.racers or RACERS
    )
    wanted = planned(definitions, named, request.evaluations, range(request.seeds), place, request.device)
    folder = Path(out).absolute() if out else Workspace().root / ARENA
    with writing("The race", folder):
        folder.mkdir(parents=True, exist_ok=True)
    lock = ProcessLock.take(folder / LOCK)
    if lock is None:
        raise RunError(f"Another process races in '{folder}'.", "Wait for it, or choose another folder.")
    try:
        with reporting(progress, "racing") as report:
            outcomes, kept = _outcomes(wanted, KeptTrials(folder / TRIALS), report, processes)
        labels = {racer_named(name).name: racer_named(name).label for name in named}
        document = race_document(definitions, outcomes, labels, request.evaluations)
        write_race(folder, document)
    finally:
        lock.free()
    return Raced(tuple(map(as_trial, outcomes)), document, folder, len(wanted) - kept, kept)


class KeptRace(msgspec.Struct, frozen=True):
    """A race as `race.json` has it. findings : its charts and tables. drawn : who is where, a picture a problem."""

    findings: dict[str, Any]
    drawn: list[dict[str, Any]]


def kept_race(workspace: Workspace) -> KeptRace | None:
    """The last race in the workspace, None where there was none. Raises SessionError where it cannot be read."""
    path = workspace.root / ARENA / DOCUMENT
    if not path.is_file():
        return None
    try:
        return decode_json(read_file(path), KeptRace)
    except (msgspec.DecodeError, OSError) as error:
        raise SessionError(
            f"'{path}' cannot be read: {error}.", "Race again; what is measured is kept."
        ) from None


def race_page(workspace: Workspace) -> Path:
    """The page of the last race in the workspace. Raises NotFoundError."""
    path = workspace.root / ARENA / PAGE
    if not path.is_file():
        raise NotFoundError("There was no race yet.", "Begin one: studio arena race.")
    return path


def _outcomes(
    wanted: Sequence[kinds.Trial], kept: KeptTrials, report: Progress, processes: int | None
) -> tuple[list[Outcome], int]:
    """The outcomes of trials in their order, and how many were kept from before; missing ones are measured.

    Raises ArenaError for a trial that fails.
    """
    keys = [_key(trial) for trial in wanted]
    by_key = dict(zip(keys, wanted, strict=True))
    outcomes = dict[str, Outcome]()
    for key, trial in by_key.items():
        known = kept.read(key)
        if known is not None and known.measured is not None and known.software == measured_by():
            outcomes[key] = Outcome(trial, known.measured)
    before = len(outcomes)
    report("", before, len(by_key))

    def on_result(first: TrialJob, result: TrialResult) -> None:
        if result.measured is None:
            raise ArenaError(result.failure, "What was finished is kept; correct it and race again.")
        group = groups[first.key]
        measured = [result.measured] if len(group) == 1 else result.measured["measured"]
        for job, values in zip(group, measured, strict=True):
            seconds = result.seconds / len(group)
            kept.write(
                job.key, KeptOutcome(values, "", seconds, measured_by(), now(), job.label, job.arguments)
            )
            outcomes[job.key] = Outcome(by_key[job.key], values)
            report(job.label, len(outcomes), len(by_key))

    jobs = [
        TrialJob(key, ARENA, trial.label, plain(trial.arguments), measure_race, (), None, alone=False)
        for key, trial in by_key.items()
        if key not in outcomes
    ]
    groups = {group[0].key: group for group in _side_by_side(jobs, processes or cores())}
    if jobs:
        report("starting", before, len(by_key))
        run_jobs(
            [_as_one(group) for group in groups.values()],
            kept.folder.parent,
            on_result,
            processes,
            checkpoint=lambda: report("", len(outcomes), len(by_key)),
        )
    return [outcomes[key] for key in keys], before


def _side_by_side(jobs: Sequence[TrialJob], processes: int) -> list[list[TrialJob]]:
    """The jobs in groups whose poses a card weighs together, enough of them for all processes."""
    most = min(SEEDS_AT_ONCE, -(-len(jobs) // processes))
    alike = dict[str, list[TrialJob]]()
    for job in jobs:
        alike.setdefault(races_in_common(job.arguments) or job.key, []).append(job)
    return [seeds[at : at + most] for seeds in alike.values() for at in range(0, len(seeds), most)]


def _as_one(group: Sequence[TrialJob]) -> TrialJob:
    if len(group) == 1:
        return group[0]
    return replace(group[0], arguments={"trials": [job.arguments for job in group]}, measure=measure_races)


def _key(trial: kinds.Trial) -> str:
    """What a trial's outcome is kept under: the same for the same problem, wherever its file lies."""
    arguments: dict[str, Any] = {**trial.arguments, "set": ""}
    made_by = json.dumps([measure_name(measure_race), arguments], sort_keys=True)
    return hashlib.sha256(made_by.encode()).hexdigest()[:KEY_LENGTH]
