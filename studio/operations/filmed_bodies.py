"""A body from its film: landmarks clicked in a few frames, the body that is made of them, and the run."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from studio.body.catalogue import load_body
from studio.body.film_fit import landmark_names
from studio.body.reader import parse_body
from studio.foundations.declaring import Terminal, operation, taking
from studio.foundations.errors import BodyError
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.own_bodies import save_body
from studio.operations.progress import Reporting, reporting, say
from studio.runs.carried_clicks import CarriedClicks, CarryRequest, run_of_clicks
from studio.runs.setup.body_from_film import FilmedBody, FilmRequest, body_of_film
from studio.sessions.landmark_clicks import LandmarkClick, clicks_of_file, keep_clicks, stored_clicks
from studio.sessions.session import BODIES_NAME, Session


@dataclass(frozen=True, slots=True)
class ClickedLandmarks:
    """The landmarks that were clicked in a session's pictures. known : names of what the body has."""

    body: str
    known: tuple[str, ...]
    clicks: tuple[LandmarkClick, ...]


ClicksFile = Annotated[
    str | Path,
    Field(
        description="CSV of clicks: frame,camera,landmark,x,y in pixels; default: those clicked in the browser."
    ),
    Terminal(option="--landmarks", metavar="FILE", kind=Path),
]


@operation
@taking(FilmRequest)
@keeping_in_place
def body_from_film(
    session: SessionName,
    landmarks: ClicksFile = "",
    *,
    like: Annotated[
        str,
        Field(
            max_length=64,
            description="The body whose tree it has; its sizes may be guesses. Default: the session's.",
        ),
        Terminal("--like", "BODY"),
    ] = "",
    save_as: Annotated[
        str,
        Field(max_length=64, description="Name of the new body of your own; default: nothing is saved."),
        Terminal("--as", "NAME"),
    ] = "",
    replace: Annotated[bool, Field(description="Replace your own body of that name.")] = False,
    progress: Reporting = None,
    **request: Any,  # noqa: ANN401 - of the types that are declared
) -> FilmedBody:
    """Make a body from its film: from landmarks clicked in two views or more of a few frames, in the tree of a body
    whose sizes are guesses.

    Landmarks are the body's markers and joints, and the tips of its limbs ("left foreleg tip"). Lengths are fitted
    together with a pose in each frame; radii are measured in the session's masks, if it has any; limits of joints are
    set by the angles seen. What the film does not tell keeps the template's proportion, and is named. The result is to
    be looked at, and corrected, on the page Bodies.

    Raises BodyError for landmarks that the body has not, and where the clicks say too little.
    """
    opened = open_session(session)
    clicks = _clicks(opened, landmarks)
    template = load_body(like or opened.manifest.body, opened.body_folders)
    with reporting(progress, f"{opened.name}: body from film") as report:
        made = body_of_film(opened, template, clicks, FilmRequest(**request), report)
    say(progress, made.notes)
    if not save_as:
        return made
    file = save_body(made.text, save_as, opened.path.parent / BODIES_NAME, replace=replace)
    return dataclasses.replace(made, body=parse_body(made.text, save_as, file.name), file=file, saved=save_as)


@operation
@taking(CarryRequest)
@keeping_in_place
def carry_clicks(
    session: SessionName,
    landmarks: ClicksFile = "",
    *,
    progress: Reporting = None,
    **request: Any,  # noqa: ANN401 - of the types that are declared
) -> CarriedClicks:
    """Make a run of landmarks clicked in a few frames: their poses, carried to the others by how the limbs look.

    For subjects that no mask shows, or whose limbs move in front of them. Needs no masks, and a body of the right sizes
    (`body_from_film`). The more frames are clicked, the fewer legs go astray; clicks in the frames where they did, and
    the run again, put it right.

    Raises BodyError for landmarks that the body has not, and where the clicks say too little; RunError.
    """
    opened = open_session(session)
    clicks = _clicks(opened, landmarks)
    with reporting(progress, f"{opened.name}: carrying clicks") as report:
        made = run_of_clicks(opened, clicks, CarryRequest(**request), report)
    say(progress, made.notes)
    return made


def _clicks(session: Session, landmarks: str | Path) -> tuple[LandmarkClick, ...]:
    """The clicks of a file, or those that the session keeps. Raises BodyError where there are none."""
    clicks = clicks_of_file(session, Path(landmarks)) if landmarks else stored_clicks(session)
    if not clicks:
        raise BodyError(
            f"No landmarks were clicked in session '{session.name}'.",
            "Click them in step Subject of the guided set-up, or give a CSV file of them.",
        )
    return clicks


def clicked_landmarks(session: Session, like: str = "") -> ClickedLandmarks:
    """The session's clicks, and what can be clicked of a body. like : default: the session's. Raises BodyError."""
    body = load_body(like or session.manifest.body, session.body_folders)
    return ClickedLandmarks(body.name, landmark_names(body), stored_clicks(session))


def keep_landmarks(session: Session, clicks: Sequence[LandmarkClick]) -> tuple[LandmarkClick, ...]:
    """Keep these clicks in place of the session's. Raises FootageError for clicks that do not fit it."""
    keep_clicks(session, clicks)
    return stored_clicks(session)
