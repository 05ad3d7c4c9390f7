"""Comparing trackers: start in the background, look, cancel, go on, throw away, download.

A comparison lies in its session's folder and is measured by processes of its own, one comparison at a time; how far
it is comes as `comparison` events and in every list.
"""

from functools import lru_cache
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Response
from pydantic import Field

from studio.comparison.candidates import LINEUPS, VARIANTS, WEIGHTING
from studio.comparison.folders import (
    kept_comparison,
    kept_comparisons,
    new_comparison,
    place_of,
    throw_away,
)
from studio.comparison.kept_comparison import FRAMES_NAME, RESULT_NAME, KeptComparison
from studio.comparison.plan import Plan
from studio.errors import NotFoundError, StudioError, WorkCancelledError
from studio.operations.comparing import MOST_TRACKERS, compare, planned
from studio.sessions.session import Session
from studio.tracking.catalogue import TRACKERS
from studio.web.comparison_schemas import (
    ComparisonChoices,
    ComparisonDetail,
    ComparisonLine,
    ComparisonList,
    ComparisonState,
    EntrantChoice,
    EntrantRequest,
    LineupChoice,
)
from studio.web.doors import Door, Doors
from studio.web.error_responses import log
from studio.web.job_kinds import COMPARISON
from studio.web.requests import Asked, body_of
from studio.web.schemas import RunName, TrashEntry, Value
from studio.web.session_routes import OpenSession, trash_entry
from studio.weighting.catalogue import WEIGHTINGS
from studio.worker.comparison_run import done_before, run_comparison
from studio.worker.jobs import Job
from studio.worker.process_executor import cores

router = APIRouter(prefix="/api/comparisons", tags=["comparisons"])

WHO: dict[str, Any] = {
    "session": (RunName, ...),
    "trackers": (Annotated[list[EntrantRequest], Field(min_length=1, max_length=MOST_TRACKERS)], ...),
    "settings": (dict[str, Value], Field({}, description="Knobs of all trackers that have them.")),
}
ONE = "/{session}/{comparison}"


def comparison_of(session: OpenSession, comparison: str) -> KeptComparison:
    """The comparison that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    return kept_comparison(session, comparison)


Kept = Annotated[KeptComparison, Depends(comparison_of)]


@router.get("/choices")
def choices() -> ComparisonChoices:
    """Who can be compared: trackers, labels that bring their knobs, line-ups of several."""
    entrants = [
        EntrantChoice(
            name=name,
            tracker=tracker.name,
            help=entry.help if entry else tracker.label,
            sized_by=[knob for names in tracker.size_knobs for knob in names],
            changes=dict(entry.changes) if entry else {},
        )
        for name, entry in {**dict.fromkeys(TRACKERS), **VARIANTS}.items()
        for tracker in (TRACKERS[name.partition(":")[0]],)
    ]
    return ComparisonChoices(
        entrants=entrants,
        lineups=[LineupChoice(name=name, trackers=list(members)) for name, members in LINEUPS.items()],
        weightings=list(WEIGHTINGS),
    )


@router.get("")
def comparisons(doors: Door, session: str | None = None) -> ComparisonList:
    """The comparisons of a session, or of all."""
    names = (
        [session] if session else [entry.name for entry in doors.workspace.sessions() if not entry.problem]
    )
    found: list[ComparisonLine] = []
    for name in names:
        opened = doors.workspace.session(name)
        found += [line for kept in kept_comparisons(opened) if (line := _line_or_none(doors, opened, kept))]
    return ComparisonList(comparisons=found)


@router.post("", status_code=202)
def begin(
    asked: Annotated[Asked, body_of(compare, "ComparisonRequest", **WHO)], doors: Door
) -> ComparisonLine:
    """Begin a comparison. 409 while another one runs; 422 for a session without a truth or for wrong knobs."""
    session = doors.workspace.session(asked.more["session"])
    plan = _plan(session, asked)
    doors.jobs.check_free(COMPARISON)
    kept = new_comparison(place_of(session, asked.get("name", "")), plan)
    return _start(doors, session, kept)


@router.get(ONE)
def detail(session: OpenSession, kept: Kept, doors: Door) -> ComparisonDetail:
    """Everything about one comparison."""
    plan = kept.plan(session)
    return ComparisonDetail(
        comparison=_line(doors, session, kept),
        body=plan.body,
        behaviour=plan.behaviour,
        fps=plan.fps,
        settings={
            candidate.name: {WEIGHTING: candidate.weighting, **candidate.changes}
            for candidate in plan.entrants
        },
        result=kept.result(),
    )


@router.post(ONE + "/cancel", status_code=202)
def cancel(session: OpenSession, kept: Kept, doors: Door) -> ComparisonLine:
    """Stop it; what is measured stays, and it can go on."""
    doors.jobs.cancel(COMPARISON, f"{session.name}/{kept.name}")
    return _line(doors, session, kept)


@router.post(ONE + "/resume", status_code=202)
def resume(session: OpenSession, kept: Kept, doors: Door) -> ComparisonLine:
    """Go on with what is not finished. 409 while any comparison runs."""
    if kept.status() == "done":
        return _line(doors, session, kept)
    return _start(doors, session, kept)


@router.delete(ONE)
def delete(session: OpenSession, kept: Kept, doors: Door) -> TrashEntry:
    """Move it to the trash. 409 while it runs."""
    place = throw_away(doors.workspace, session, kept)
    doors.events.session_changed(session.name)
    return trash_entry(place)


@router.get(ONE + "/result.json", response_class=Response)
def result_json(session: OpenSession, kept: Kept) -> Response:
    """The whole result as a file."""
    return _file(session, kept, RESULT_NAME, "application/json", "json")


@router.get(ONE + "/frames.csv", response_class=Response)
def frames_as_csv(session: OpenSession, kept: Kept) -> Response:
    """A row a tracker, seed and frame: its error in mm and the limbs lost."""
    return _file(session, kept, FRAMES_NAME, "text/csv; charset=utf-8", "csv")


def _plan(session: Session, asked: Asked) -> Plan:
    """What is asked for, checked. Raises StudioError for what cannot be compared."""
    shared, entrants = asked.more["settings"], asked.more["trackers"]
    changes: dict[str, dict] = {"": shared} if shared else {}
    for candidate in entrants:
        own = dict(candidate.settings) | ({WEIGHTING: candidate.weighting} if candidate.weighting else {})
        if own:
            changes[candidate.name] = own
    return planned(session, [candidate.name for candidate in entrants], changes=changes, **asked)


def _start(doors: Doors, session: Session, kept: KeptComparison) -> ComparisonLine:
    def work(job: Job) -> dict[str, object]:
        try:
            # One core stays free for the studio itself, which is being looked at meanwhile.
            run_comparison(kept, session, job.report, processes=max(1, cores() - 1), checkpoint=job.check)
        except WorkCancelledError:
            if not job.closing:
                kept.end("cancelled")
            raise
        except Exception as error:
            words = str(error) if isinstance(error, StudioError) else f"{type(error).__name__}: {error}"
            kept.end("failed", words)
            raise
        return {}

    doors.jobs.begin(COMPARISON, ComparisonState(session=session.name, name=kept.name), work)
    doors.events.session_changed(session.name)
    return _line(doors, session, kept)


def _line_or_none(doors: Doors, session: Session, kept: KeptComparison) -> ComparisonLine | None:
    """A line; None for a folder that cannot be read, which its own address tells about."""
    try:
        return _line(doors, session, kept)
    except StudioError as error:
        log.warning("comparison '%s' is left out of the list: %s", kept.folder, error)
        return None


def _line(doors: Doors, session: Session, kept: KeptComparison) -> ComparisonLine:
    record, plan = kept.record(), kept.plan(session)
    job = doors.jobs.known(COMPARISON, f"{session.name}/{kept.name}")
    going = job if job is not None and job.state.is_going else None
    status = going.state.value if going else kept.status()
    total = len(plan.seeds) * len(plan.entrants)
    if status == "done":
        done = total
    else:
        done = going.done if going and going.total else done_before(kept, plan)
    line = ComparisonLine(
        session=session.name,
        name=kept.name,
        created=record.created,
        status=status,  # pyright: ignore[reportArgumentType]
        trackers=[candidate.name for candidate in plan.entrants],
        evaluations=plan.evaluations,
        seeds=len(plan.seeds),
        first=plan.first,
        last=plan.last,
        done=done,
        total=total,
        problem=record.problem,
    )
    if going:
        return line.model_copy(update={"step": going.step, "seconds_left": going.seconds_left})
    return _with_best(line, kept) if status == "done" else line


def _with_best(line: ComparisonLine, kept: KeptComparison) -> ComparisonLine:
    path = kept.folder / RESULT_NAME
    tracker, mean_mm = _best_of(kept, path.stat().st_mtime_ns)
    return line.model_copy(update={"best": tracker, "best_mm": mean_mm})


@lru_cache(maxsize=512)
def _best_of(kept: KeptComparison, _written: int) -> tuple[str, float | None]:
    """The tracker with the smallest mean error of a result that was written at a moment."""
    trackers = (kept.result() or {}).get("trackers", [])
    best = min(trackers, key=lambda entry: entry["mean_mm"], default=None)
    return ("", None) if best is None else (best["tracker"], best["mean_mm"])


def _file(session: Session, kept: KeptComparison, name: str, kind: str, ending: str) -> Response:
    path = kept.folder / name
    if not path.is_file():
        raise NotFoundError(f"Comparison '{kept.name}' is not finished.", "Wait for it, or let it go on.")
    headers = {"content-disposition": f'attachment; filename="{session.name}-{kept.name}.{ending}"'}
    return Response(path.read_bytes(), media_type=kind, headers=headers)
