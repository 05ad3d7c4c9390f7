"""The person in front of the cameras: size, shape, and the pose to begin with."""

import dataclasses
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.body.subject import Subject
from studio.foundations.declaring import Body, Model, OneOf, Seed, Terminal, Web, operation, taking
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.runs.new_run import checked_frames
from studio.runs.setup.initialising import WEIGHTING, InitialPose, keep_pose
from studio.runs.setup.initialising import initialise as initialise_session
from studio.runs.setup.person_landmarks import person_landmarks
from studio.runs.setup.subject_choice import body_of_choice, choose_body, choose_subject, keep_fitted
from studio.runs.setup.subject_fitting import (
    FitRequest,
    FittedSubject,
    Height,
    Shown,
    fit_session_subject,
    keep_subject,
)
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.sessions.atomic_files import check_writable


@operation
@keeping_in_place
def subject(
    session: SessionName,
    height_mm: Annotated[
        Height, Field(description="Of the person, mm; all lengths follow by published proportions.")
    ] = None,
    *,
    lengths_mm: Annotated[
        Mapping[str, float] | None,
        Field(description="Measured lengths between markers, such as RHip_RKnee, mm."),
        Terminal("--length", "PAIR=MM"),
    ] = None,
    body: Body = "",
    progress: Reporting = None,
) -> BodyModel:
    """Write down who is in front of a session's cameras (new runs then have that body), and return the body in that
    size; with nothing given, as it is. A body alone, such as an animal's or one of your own, is as large as its file
    says; the subject before stays beside it as subject-before.toml.

    With nothing but a height every length, hands and feet included, is its published share of it (sources: the body
    file).

    Raises BodyError.
    """
    opened = open_session(session)
    if height_mm is None and not lengths_mm:
        found, notes = (choose_body(opened, body) if body else opened).body_with_notes()
    else:
        wanted = Subject(
            body=body or opened.manifest.body, height_mm=height_mm, lengths_mm=dict(lengths_mm or {})
        )
        choose_subject(opened, wanted)
        found, notes = body_of_choice(opened, wanted)
    say(progress, notes)
    return found


@operation
@taking(FitRequest, without=("particles", "layers"))
@keeping_in_place
def fit_subject(
    session: SessionName,
    *,
    keep: Annotated[
        bool, Field(description="Make it the session's subject; the old one stays beside it.")
    ] = True,
    into: Annotated[
        str | Path | None,
        Field(description="File instead of the session's own subject."),
        Terminal(kind=Path),
    ] = None,
    progress: Reporting = None,
    shown: Annotated[
        Shown | None,
        Field(description="Called with the body, the frames and the poses found so far."),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> FittedSubject:
    """Find limb lengths and radii of the person in a session, together with the poses of a few frames.

    The result becomes the session's subject (the old one stays beside it as subject-before.toml). ± is one standard
    deviation.

    Raises RunError where nothing is to be seen in a frame, or nothing may change.
    """
    opened = open_session(session)
    if keep or into is not None:
        check_writable(opened.path if into is None else Path(into).absolute().parent)
    with reporting(progress, f"{opened.name}: subject") as report:
        watched = {} if shown is None else {"shown": shown}
        found = fit_session_subject(opened, FitRequest(**options), progress=report, **watched)
    if into is not None:
        return dataclasses.replace(found, file=keep_subject(opened, found, Path(into)))
    return dataclasses.replace(found, file=keep_fitted(opened, found)) if keep else found


@operation
@keeping_in_place
def initialise(
    session: SessionName,
    frame: Annotated[
        int, Field(ge=0, description="Where the start pose is sought."), Terminal("--frame")
    ] = 0,
    *,
    body: Body = "",
    behaviour: Annotated[Model, Field(description="Its prototypes are poses to try.")] = "",
    weighting: Annotated[str, Field(description="What tells poses apart."), OneOf(WEIGHTINGS)] = WEIGHTING,
    seed: Seed = 0,
    keep: Annotated[bool, Field(description="Write the pose down.")] = True,
    replace: Annotated[
        bool, Field(description="Make it the session's start pose; the old one stays beside it.")
    ] = False,
    progress: Reporting = None,
) -> InitialPose:
    """Find the pose in a frame of a session with nothing given but the body's dimensions, and write it down.

    It becomes the session's start pose if that has none, else a file beside it that tracking takes as a start pose.

    Raises RunError where nothing is to be seen in the frame.
    """
    opened = open_session(session)
    checked_frames(opened, frame, frame + 1)
    tree, notes = opened.body_with_notes(body or None)
    say(progress, notes, opened.path)
    with reporting(progress, f"{opened.name}: frame {frame}") as report:
        found = initialise_session(
            opened, frame, body=tree, behaviour=behaviour, weighting=weighting, seed=seed, progress=report
        )
    if keep:
        found = dataclasses.replace(found, file=keep_pose(opened, found, replace))
    say(progress, [found.note] if found.note else [])
    return found


@dataclass(frozen=True, slots=True)
class Landmarks:
    """What the network sees of a person. file : the TRC file. seen : share of the frames with all of its joints."""

    file: Path
    motion: MarkerMotion
    seen: float


@operation
@keeping_in_place
def landmarks(
    session: SessionName,
    to: Annotated[
        str | Path,
        Field(description="The TRC file that is written."),
        Terminal(metavar="FILE", kind=Path),
        Web(left_out=True),
    ],
    *,
    progress: Reporting = None,
) -> Landmarks:
    """Write where a network sees a person's joints, triangulated over the cameras: a witness to measure a run by.

    It knows nothing of the studio's bodies and searches, and needs no markers: shoulders, elbows, wrists, hips, knees
    and ankles of a person (of people only), coarse by some centimetres and constantly beside a body's own joints by as
    much: `studio evaluate --truth FILE` prints the error with and without that.

    Raises FootageError where no two cameras see the same person.
    """
    opened, path = open_session(session), Path(to).absolute()
    check_writable(path.parent)
    with closing(opened.footage()) as footage, reporting(progress, f"{opened.name}: joints") as report:
        motion = person_landmarks(opened.cameras(), footage, report)
    write_trc(path, motion)
    seen = np.isfinite(motion.positions).all(axis=(1, 2))
    return Landmarks(path, motion, float(seen.mean()))
