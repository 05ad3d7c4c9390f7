"""Several subjects in view: who there is, a session for each, all of them tracked at once."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, FiniteFloat

from studio.foundations.declaring import Terminal, Web, operation
from studio.foundations.errors import SessionError
from studio.foundations.geometry.projection import project
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.runs.setup.subject_masks import SeenSubject, seen_subjects
from studio.runs.setup.subject_sessions import make_subject_sessions
from studio.runs.together import BodiesTogether, track_together
from studio.sessions.names import free_name
from studio.sessions.session import Session
from studio.sessions.work_under_way import working_on
from studio.sessions.workspace import Workspace


@dataclass(frozen=True, slots=True, eq=False)
class Subjects:
    """Who is in view.

    seen : in the first frame, the largest first.
    sessions : that were made, one for each place.
    notes : sentences.
    """

    seen: tuple[SeenSubject, ...]
    sessions: tuple[Session, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SubjectInView(SeenSubject):
    """A subject in view.

    points : by camera, where its middle is seen, as shares of the picture's width and height.
    """

    points: dict[str, tuple[FiniteFloat, FiniteFloat]]


@dataclass(frozen=True, slots=True)
class SubjectsInView:
    """Who is in view in a frame, the largest first."""

    frame: int
    subjects: tuple[SubjectInView, ...]


def subjects_in_view(session: Session, frame: int = 0) -> SubjectsInView:
    """Who is in view in a frame, by the masks' hull. Raises FootageError, NotFoundError."""
    seen = seen_subjects(session, frame)
    return SubjectsInView(
        frame, tuple(SubjectInView(one.at, one.litres, one.height, _points(session, one)) for one in seen)
    )


def _points(session: Session, subject: SeenSubject) -> dict[str, tuple[float, float]]:
    x, y = (1000.0 * value for value in subject.at)
    points: dict[str, tuple[float, float]] = {}
    for camera in session.cameras():
        pixels, depths = project(camera, np.array([[x, y, 500.0 * subject.height]]))
        u, v = (float(value) for value in pixels[0])
        if depths[0] > 0.0 and 0.0 <= u < camera.width and 0.0 <= v < camera.height:
            points[camera.name] = (u / camera.width, v / camera.height)
    return points


@operation
@keeping_in_place
def subjects(
    session: SessionName,
    *,
    at: Annotated[
        Sequence[tuple[float, float]],
        Field(
            max_length=16,
            description="Where a subject who gets a session stands in the first frame: x and y on the floor in"
            " metres. Without any, the subjects in view are listed.",
        ),
        Terminal(metavar="X,Y"),
    ] = (),
    into: Annotated[
        Sequence[str],
        Field(max_length=16, description="Name of the new session, for each place; default: numbered."),
    ] = (),
    progress: Reporting = None,
) -> Subjects:
    """List who is in view, and make a session for each subject that is wanted: the same footage, masks of that subject
    alone.

    The masks in use are cut by the pieces of their visual hull, followed over time. Give each session its subject's
    measures, then let `together` share the masks by bodies, which separates subjects who touch.

    Raises FootageError where no subject stands at a place; then nothing is made.
    """
    opened = open_session(session)
    if not at:
        with reporting(progress, f"{opened.name}: who is in view") as report:
            report("carving the hull", 0, 1)
            return Subjects(seen_subjects(opened))
    if into and len(into) != len(at):
        raise SessionError(
            f"{len(into)} names were given for {len(at)} places.", "Give one --into for each --at."
        )
    places = [Workspace().place_for(name) for name in into] or _numbered_places(opened, len(at))
    if len(set(places)) < len(places):
        raise SessionError("Two new sessions have the same name.", "Give each --into another one.")
    with reporting(progress, f"{opened.name}: subjects") as report:
        made, notes = make_subject_sessions(opened, at, places, report)
    say(progress, notes)
    return Subjects((), made, notes)


@operation
@keeping_in_place
def together(
    session: SessionName,
    beside: Annotated[
        Sequence[str],
        Field(min_length=1, max_length=15, description="Sessions of the other subjects in view."),
        Terminal("--beside", metavar="SESSION"),
        Web(kind=list[str]),
    ],
    *,
    progress: Reporting = None,
) -> BodiesTogether:
    """Track several bodies at once, each in its own session, and share the masks by who explains which pixel.

    Each session (as `subjects` makes them) is left with masks of its own subject, in which runs are tracked as usual.

    Raises RunError for sessions that do not belong together; then nothing is changed.
    """
    opened = [open_session(session), *(open_session(name) for name in beside)]
    with ExitStack() as kept:
        for other in opened[1:]:
            kept.enter_context(working_on(other.path, "together"))
        report = kept.enter_context(reporting(progress, f"{opened[0].name} and {len(opened) - 1} more"))
        return track_together(opened, report)


def _numbered_places(session: Session, count: int) -> list[Path]:
    """Folders beside a session's, named after it."""
    taken = {path.name for path in session.path.parent.iterdir()}
    places: list[Path] = []
    for _ in range(count):
        name = free_name(f"{session.name}-{len(places) + 1}", taken)
        taken.add(name)
        places.append(session.path.with_name(name))
    return places
