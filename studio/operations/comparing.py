"""Trackers compared fairly on a session with a truth; knobs swept over a grid of values."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, cast

from pydantic import Field

from studio.foundations.declaring import (
    AllowInconsistent,
    Body,
    First,
    Knobs,
    Last,
    Model,
    OneOf,
    Terminal,
    Values,
    Web,
    operation,
    taking,
)
from studio.foundations.errors import RunError, SessionError
from studio.foundations.knobs import Value
from studio.operations.comparison_folders import differences, new_comparison, place_of, unfinished_like
from studio.operations.jobs.cluster import Cluster, chosen_executor
from studio.operations.jobs.comparison_run import Result, done_before, processes_beside, run_comparison
from studio.operations.jobs.process_executor import cores
from studio.operations.opening import AnySession, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.results.comparison.candidates import DEFAULT_LAYERS, Lineup
from studio.results.comparison.comparison_findings import document, table_text
from studio.results.comparison.kept_comparison import RECORD_NAME, KeptComparison
from studio.results.comparison.plan import Comparison, Plan, conclude, plan_comparison
from studio.results.comparison.sweep import (
    Sweep,
    SweepExpected,
    conclude_sweep,
    expected,
    plan_sweep,
    run_name,
    sweep_document,
    sweep_text,
)
from studio.results.comparison.trials import Outcome
from studio.runs.behaviour_models import needs_model
from studio.runs.new_run import own_knobs
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.devices import CPU, Device
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.names import checked_name
from studio.sessions.object_stores import below
from studio.sessions.remote_sessions import (
    COMPARISONS,
    address_of,
    bring_comparisons,
    comparison_put_back,
    place_in_words,
)
from studio.sessions.session import Session

MOST_TRACKERS, MOST_SPLIT = 12, 60
USUAL = tuple(name for name in sorted(TRACKERS) if not needs_model(name, None))


@dataclass(frozen=True, slots=True)
class CompareRequest:
    """What is compared."""

    trackers: Annotated[
        Sequence[str],
        Field(description="Trackers, tracker:label, or a name that stands for several."),
        Terminal(metavar="A,B,C", kind=str),
        Web(left_out=True),
    ] = USUAL
    evaluations: Annotated[
        int, Field(ge=1, le=1_000_000, description="Poses that each tracker weighs a frame.")
    ] = 1000
    seeds: Annotated[int, Field(ge=1, le=1000, description="Number of seeds of each tracker, from 0 on.")] = 5
    weighting: Annotated[
        str, Field(description="The likelihood of all; default: the session's own."), OneOf(WEIGHTINGS)
    ] = ""
    device: Annotated[
        Device, Field(description="What weighs poses, where the likelihood lets it be chosen.")
    ] = CPU
    body: Body = ""
    behaviour: Annotated[
        Model, Field(description="Behaviour model, by name or file, for trackers that need one.")
    ] = ""
    first: First = None
    last: Last = None
    layers: Annotated[
        int, Field(ge=1, le=60, description="Layers of trackers whose layers can be chosen.")
    ] = DEFAULT_LAYERS
    split_frames: Annotated[
        int,
        Field(
            ge=0,
            le=MOST_SPLIT,
            description="Frames of each trial in which it is measured whose fault the error is.",
        ),
    ] = 0
    changes: Annotated[
        Mapping[str, Mapping[str, object]] | None,
        Field(description='Knobs by tracker; under "" for all trackers that have them.'),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None

    def plan(self, session: Session) -> Plan:
        """The checked plan. Raises StudioError for what cannot be compared."""
        changes = dict(cast("Mapping[str, Mapping[str, Value]]", self.changes or {}))
        if self.device != CPU:
            changes[""] = {"device": self.device, **changes.get("", {})}
        lineup = Lineup(tuple(self.trackers), self.weighting, self.evaluations, self.layers, changes)
        return plan_comparison(
            session,
            lineup,
            range(self.seeds),
            first=session.start_pose_frame() if self.first is None else self.first,
            last=self.last,
            body=self.body,
            behaviour=self.behaviour,
            split_frames=self.split_frames,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """A comparison.

    comparison : its numbers, and the verdict on every pair of trackers.
    kept : where it lies.
    """

    comparison: Comparison
    kept: KeptComparison

    @property
    def document(self) -> dict[str, Any]:
        """Its numbers as plain JSON values."""
        return document(self.comparison)

    @property
    def in_words(self) -> str:
        """Its numbers as a table for a terminal."""
        return table_text(self.comparison)


@operation
@taking(CompareRequest)
@keeping_in_place
def compare(
    session: AnySession,
    *,
    name: Annotated[str, Field(description="Name of the comparison; default: numbered.")] = "",
    out: Annotated[
        str | Path | None,
        Field(description="Folder for the comparison, instead of the session's."),
        Terminal(kind=Path),
    ] = None,
    processes: Annotated[
        int | None, Field(ge=1, description="Trials at once; default: one a core."), Web(left_out=True)
    ] = None,
    cluster: Cluster = "",
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> Compared:
    """Compare trackers on a session with a truth: same evidence, same number of evaluations a frame, same seeds.

    Measures how far they are from the truth, with sign tests over frames and seeds. Each trial is kept as soon as it is
    done (in the session, or in another folder), so after Ctrl-C the same call continues. The studio shows what is kept
    in the session.

    Raises TruthError for a session without a truth, SettingsError for an unknown tracker or knob, RunError where
    another process works at the comparison.
    """
    opened = open_session(session, remote=True)
    bring_comparisons(opened)
    plan = CompareRequest(**options).plan(opened)
    with chosen_executor(cluster, place_in_words(opened)) as executor:
        kept = _folder_for(opened, plan, name, Path(out) if out else None)
        before = done_before(kept, plan)
        lines = [executor.in_words] if executor else []
        if before:
            lines.append(f"{before} of {len(plan.seeds) * len(plan.candidates)} trials are there already.")
        comparison = _measure(kept, opened, conclude, processes, executor, lines, progress)
    return Compared(comparison, kept)


@dataclass(frozen=True, slots=True, eq=False)
class SweptGrid:
    """A sweep; its runs are the session's.

    sweep : the measured runs and points.
    kept : where it lies.
    """

    sweep: Sweep
    kept: KeptComparison

    @property
    def document(self) -> dict[str, Any]:
        """Its runs and points as plain JSON values."""
        return sweep_document(self.sweep)

    @property
    def in_words(self) -> str:
        """Its points as a table for a terminal, the best first."""
        return sweep_text(self.sweep)


@dataclass(frozen=True, slots=True)
class SweepRequest:
    """Which knobs are varied, and how each combination is tracked."""

    vary: Annotated[
        Mapping[str, Sequence[object]],
        Field(description="Values by knob; every combination of them is tracked."),
        Terminal(left_out=True),
        Web(kind=dict[str, list[Value]]),
    ]
    seeds: Annotated[
        int, Field(ge=1, le=1000, description="Number of runs of each combination, seeds from 0 on.")
    ] = 3
    tracker: Annotated[
        str, Field(description="Default: the session's own, else annealed."), OneOf(TRACKERS)
    ] = ""
    weighting: Annotated[
        str, Field(description="The likelihood; default: the session's own."), OneOf(WEIGHTINGS)
    ] = ""
    body: Body = ""
    behaviour: Model = ""
    first: First = None
    last: Last = None
    knobs: Annotated[
        Values,
        Field(description="Any other knob, of all runs."),
        Knobs(own_knobs, others=True, with_defaults=False),
    ] = None
    fit_shape: Annotated[
        bool,
        Field(description="Each run begins with the shape that its first frames show."),
        Terminal("--fit-shape/--keep-shape"),
    ] = True
    allow_inconsistent: AllowInconsistent = False

    def plan(self, session: Session) -> Plan:
        """The checked plan. Raises StudioError for what cannot be swept."""
        given: dict[str, Any] = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        given["seeds"] = range(self.seeds)
        return plan_sweep(session, **given)


@operation
@taking(SweepRequest)
@keeping_in_place
def sweep(
    session: AnySession,
    *,
    name: Annotated[
        str, Field(description="Name of the sweep, with which its runs' names begin; default: numbered.")
    ] = "",
    processes: Annotated[
        int | None, Field(ge=1, description="Runs at once; default: one a core."), Web(left_out=True)
    ] = None,
    cluster: Cluster = "",
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> SweptGrid:
    """Track every combination of some knobs' values with several seeds, and compare the runs.

    Before it begins it says how many runs there will be and about how long they take. Every run is stored in the
    session with its frames; after Ctrl-C the same call continues. The measure is the error where the session has a
    truth, and else how well the body fits the masks.

    Raises SettingsError for an unknown knob or a value out of its range; then nothing was made.
    """
    opened = open_session(session, remote=True)
    bring_comparisons(opened)
    plan = SweepRequest(**options).plan(opened)
    with chosen_executor(cluster, place_in_words(opened)) as executor:
        kept = kept_sweep(opened, plan, name)
        at_once = executor.threads or 1 if executor else processes or cores()
        wait = expected(opened, plan, at_once, cores())
        lines = [*([executor.in_words] if executor else []), wait.in_words]
        if before := done_before(kept, plan):
            lines.append(f"{before} of {wait.runs} runs are there already.")
        swept = _measure(kept, opened, conclude_sweep, processes, executor, lines, progress)
    return SweptGrid(swept, kept)


def expected_sweep(session: Session, request: SweepRequest) -> SweepExpected:
    """How many runs a sweep has, and about how long they take. Raises StudioError for what cannot be swept."""
    return expected(session, request.plan(session), processes_beside(), cores())


def _measure(
    kept: KeptComparison,
    session: Session,
    conclude: Callable[[Plan, Sequence[Outcome]], Result],
    processes: int | None,
    executor: Executor | None,
    lines: list[str],
    progress: Reporting,
) -> Result:
    """The conclusion from all trials, moved back to where the session lies now.

    lines : shown before, and after it where it is kept.
    """
    say(progress, lines)
    with (
        comparison_put_back(session, kept.folder),
        reporting(progress, f"{session.name} / {kept.name}") as report,
    ):
        result = run_comparison(kept, session, report, conclude, processes=processes, executor=executor)
    address = address_of(session)
    inside = address and kept.folder.is_relative_to(session.path)
    place = below(address, COMPARISONS, kept.name) if inside else str(kept.folder)
    say(progress, [f"Kept in {place}"])
    return result


def kept_sweep(session: Session, plan: Plan, name: str = "") -> KeptComparison:
    """The folder of an unfinished sweep with the same request, else a new one. Raises SessionError."""
    if not name:
        again = unfinished_like(session, plan)
        if again is not None:
            return again
    folder = place_of(session, name, sweep=True)
    checked_name(run_name(folder.name, plan, len(plan.candidates) * len(plan.seeds) - 1), "run of a sweep")
    if (folder / RECORD_NAME).is_file():
        return _same(folder, plan)
    return new_comparison(folder, plan, session)


def _folder_for(session: Session, plan: Plan, name: str, out: Path | None) -> KeptComparison:
    """The folder to work in: of an unfinished comparison with the same request, else a new one.

    Raises SessionError for a folder that holds something else, or cannot be written.
    """
    try:
        if out is None and not name:
            return unfinished_like(session, plan) or new_comparison(place_of(session), plan, session)
        folder = (out or place_of(session, name)).absolute()
        if (folder / RECORD_NAME).is_file():
            return _same(folder, plan)
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        return new_comparison(folder, plan, None if out else session)
    except PermissionError as error:
        raise SessionError(
            f"A comparison cannot be kept in '{error.filename}'.", "Choose another folder with --out."
        ) from None


def _same(folder: Path, plan: Plan) -> KeptComparison:
    """The comparison in a folder if it has the same request. Raises RunError for another one."""
    kept = KeptComparison(folder)
    other = differences(plan, kept.plan())
    if other:
        raise RunError(
            f"'{folder}' holds a comparison with other {', '.join(other)}.", "Choose another folder or name."
        )
    return kept
