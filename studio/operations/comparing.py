"""Trackers compared fairly on a session with a truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from studio.comparison.candidates import DEFAULT_LAYERS, Lineup
from studio.comparison.folders import differences, new_comparison, place_of, unfinished_like
from studio.comparison.kept_comparison import RECORD_NAME, KeptComparison
from studio.comparison.plan import Comparison, Plan, plan_comparison
from studio.declaring import Body, Model, OneOf, Terminal, Web, operation
from studio.errors import RunError, SessionError
from studio.operations.opening import SessionName, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.runs.behaviour_models import needs_model
from studio.sessions.session import Session
from studio.tracking.catalogue import TRACKERS
from studio.weighting.catalogue import WEIGHTINGS
from studio.worker.comparison_run import done_before, run_comparison

MOST_TRACKERS = 12
USUAL = tuple(name for name in sorted(TRACKERS) if not needs_model(name, None))


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """A comparison and where it is kept."""

    comparison: Comparison
    kept: KeptComparison


@operation
def compare(
    session: SessionName,
    *,
    trackers: Annotated[
        Sequence[str],
        Field(description="Who is compared: trackers, tracker:label, or a name that stands for several."),
        Terminal(metavar="A,B,C", kind=str),
        Web(left_out=True),
    ] = USUAL,
    evaluations: Annotated[
        int, Field(ge=1, le=1_000_000, description="Poses weighed a frame, by each.")
    ] = 1000,
    seeds: Annotated[int, Field(ge=1, le=1000, description="How many seeds each, from 0 on.")] = 5,
    weighting: Annotated[
        str, Field(description="Of all; default: the session's own."), OneOf(WEIGHTINGS)
    ] = "",
    body: Body = "",
    behaviour: Annotated[
        Model, Field(description="Behaviour model of those that need one, by name or file.")
    ] = "",
    first: Annotated[int | None, Field(ge=0, description="Default: the frame of the start pose.")] = None,
    last: Annotated[
        int | None, Field(ge=1, description="The frame after the last one; default: all.")
    ] = None,
    layers: Annotated[
        int, Field(ge=1, le=60, description="Of trackers whose layers can be chosen.")
    ] = DEFAULT_LAYERS,
    changes: Annotated[
        Mapping[str, Mapping[str, object]] | None,
        Field(description='By tracker its own knobs; under "" those of all that have them.'),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None,
    name: Annotated[str, Field(description="Of the comparison; default: numbered.")] = "",
    out: Annotated[
        str | Path | None,
        Field(description="Folder to keep it in, instead of the session's."),
        Terminal(kind=Path),
    ] = None,
    processes: Annotated[
        int | None, Field(ge=1, description="Trials at once; default: one a core."), Web(left_out=True)
    ] = None,
    progress: Reporting = None,
) -> Compared:
    """Compare trackers on a session with a truth: same evidence, same number of evaluations a frame, same seeds.

    Says how far they are from the truth, with sign tests over frames and seeds; keeps each trial as soon as it is done
    (in the session, or in another folder), so that after Ctrl-C the same call goes on. The studio shows what is kept in
    the session.

    Raises StudioError for what cannot be compared.
    """
    opened = open_session(session)
    plan = planned(
        opened,
        trackers,
        evaluations=evaluations,
        seeds=seeds,
        weighting=weighting,
        body=body,
        behaviour=behaviour,
        first=first,
        last=last,
        layers=layers,
        changes=changes,
    )
    kept = _kept(opened, plan, name, Path(out) if out else None)
    before = done_before(kept, plan)
    if before:
        say(progress, [f"{before} of {seeds * len(plan.entrants)} trials are there already."])
    with reporting(progress, f"{opened.name} / {kept.name}") as report:
        comparison = run_comparison(kept, opened, report, processes=processes)
    say(progress, [f"Kept in {kept.folder}"])
    return Compared(comparison, kept)


def planned(
    session: Session,
    trackers: Sequence[str],
    *,
    evaluations: int,
    seeds: int,
    weighting: str = "",
    body: str = "",
    behaviour: str = "",
    first: int | None = None,
    last: int | None = None,
    layers: int = DEFAULT_LAYERS,
    changes: Mapping[str, Mapping[str, object]] | None = None,
    name: str = "",
) -> Plan:
    """What `compare` will do. Raises StudioError for what cannot be compared."""
    lineup = Lineup(tuple(trackers), weighting, evaluations, layers, changes or {})  # pyright: ignore[reportArgumentType]
    first = session.start_pose_frame() if first is None else first
    return plan_comparison(
        session, lineup, range(seeds), first=first, last=last, body=body, behaviour=behaviour
    )


def _kept(session: Session, plan: Plan, name: str, out: Path | None) -> KeptComparison:
    """The folder to work in: one that asked for the same and is not finished, else a new one.

    Raises SessionError for a folder that holds something else, or cannot be written.
    """
    try:
        if out is None and not name:
            return unfinished_like(session, plan) or new_comparison(place_of(session), plan)
        folder = (out or place_of(session, name)).absolute()
        if (folder / RECORD_NAME).is_file():
            kept = KeptComparison(folder)
            other = differences(plan, kept.plan())
            if other:
                raise RunError(
                    f"'{folder}' holds a comparison with other {', '.join(other)}.",
                    "Choose another folder or name.",
                )
            return kept
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        return new_comparison(folder, plan)
    except PermissionError as error:
        raise SessionError(
            f"A comparison cannot be kept in '{error.filename}'.", "Choose another folder with --out."
        ) from None
