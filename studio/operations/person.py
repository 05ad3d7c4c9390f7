"""The person in front of the cameras: size, shape, and the pose to begin with."""

import dataclasses
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, FiniteFloat

from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.body.subject import Subject
from studio.body.upright import LimbDrawing, limb_drawings
from studio.foundations.arrays import Array
from studio.foundations.declaring import Body, Model, OneOf, Seed, Terminal, Web, operation, taking
from studio.foundations.errors import ExportError
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.results.overlay_pictures import forget_composers
from studio.runs.setup.initialising import WEIGHTING, InitialPose, keep_pose
from studio.runs.setup.initialising import initialise as initialise_session
from studio.runs.setup.person_landmarks import person_landmarks
from studio.runs.setup.subject_choice import body_of_choice, choose_subject, keep_fitted, lengths_left_out
from studio.runs.setup.subject_fitting import (
    FitRequest,
    FittedSubject,
    Height,
    Shown,
    fit_session_subject,
    keep_subject,
)
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.devices import CPU, Device
from studio.sessions.atomic_files import check_writable
from studio.sessions.provenance import origin_of
from studio.sessions.session import SUBJECT_NAME, Session


@operation
@keeping_in_place
def subject(
    session: SessionName,
    height_mm: Annotated[
        Height, Field(description="Height of the person, mm; all lengths follow by published proportions.")
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
    size.

    With nothing given it returns the body as it is. With a height alone every length, hands and feet included, is its
    published share of it (sources: the body file). With a body alone, such as an animal's or one of your own, the sizes
    are those of its file. The earlier subject is kept beside it as subject-before.toml.

    Raises BodyError for an unknown body or length, or a size that is impossible.
    """
    opened = open_session(session)
    if height_mm is None and not lengths_mm and not body:
        tree, notes = opened.body_with_notes()
    else:
        wanted = Subject(
            body=body or opened.manifest.body, height_mm=height_mm, lengths_mm=dict(lengths_mm or {})
        )
        lost = lengths_left_out(opened, wanted)
        tree, notes = choose_subject(opened, wanted).body_with_notes()
        notes = (*notes, *lost)
    forget_composers()
    say(progress, notes)
    return tree


@dataclass(frozen=True, slots=True)
class SubjectInUse:
    """A session's subject.

    dimensions : mm (ratios without unit), by the body's own names.
    source : of the proportions.
    saved : whether the session has a subject at all.
    fitted : whether it was fitted to the footage.
    """

    body: str
    height_mm: float | None
    dimensions: dict[str, FiniteFloat]
    notes: tuple[str, ...]
    source: str
    limbs: list[LimbDrawing]
    saved: bool
    fitted: bool


def subject_in_use(session: Session, height_mm: float | None = None, body: str = "") -> SubjectInUse:
    """Every dimension of a session's body as a run would have it, and its limbs as it stands upright.

    height_mm, body : as if the person were so tall, or had this body.

    Raises BodyError.
    """
    known = session.subject()
    if height_mm is None and not body:
        tree, notes = session.body_with_notes()
    else:
        known = Subject(body=body or session.manifest.body, height_mm=height_mm)
        tree, notes = body_of_choice(session, known)
    return SubjectInUse(
        tree.name,
        known.height_mm if known else None,
        dict(tree.dimensions),
        tuple(notes),
        tree.definition.source if tree.definition else "",
        limb_drawings(tree),
        (session.path / SUBJECT_NAME).exists(),
        origin_of(session, "subject") is not None,
    )


@dataclass(frozen=True, slots=True, eq=False)
class FitSoFar:
    """A fit under way: the body and its poses (F, D) in F frames."""

    body: BodyModel
    frames: tuple[int, ...]
    poses: Array


@operation
@taking(FitRequest, without=("particles", "layers"))
@keeping_in_place
def fit_subject(
    session: SessionName,
    *,
    keep: Annotated[
        bool, Field(description="Make it the session's subject; the old one is kept beside it.")
    ] = True,
    into: Annotated[
        str | Path | None,
        Field(description="File to write instead of the session's own subject."),
        Terminal(kind=Path),
    ] = None,
    progress: Reporting = None,
    shown: Annotated[
        Shown | None,
        Field(description="Called with the body, the frames and their poses so far."),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> FittedSubject:
    """Find limb lengths and radii of the person in a session, together with the poses of a few frames.

    The result becomes the session's subject (the old one is kept beside it as subject-before.toml). ± is one standard
    deviation.

    Raises RunError where nothing is to be seen in a frame, or nothing may change.
    """
    opened = open_session(session)
    if keep or into is not None:
        check_writable(opened.path if into is None else Path(into).absolute().parent)
    with reporting(progress, f"{opened.name}: subject") as report:
        watched = {} if shown is None else {"shown": shown}
        fitted = fit_session_subject(opened, FitRequest(**options), progress=report, **watched)
    if into is not None:
        return dataclasses.replace(fitted, file=keep_subject(opened, fitted, Path(into)))
    return keep_fit(opened, fitted) if keep else fitted


def keep_fit(session: Session, fitted: FittedSubject) -> FittedSubject:
    """Make a fitted subject the session's own; the old one is kept beside it as subject-before.toml."""
    kept = dataclasses.replace(fitted, file=keep_fitted(session, fitted))
    forget_composers()
    return kept


@dataclass(frozen=True, slots=True, kw_only=True)
class StartPoseRequest:
    """How a start pose is searched, and whether it is kept."""

    body: Body = ""
    behaviour: Annotated[Model, Field(description="Its prototypes are poses to try.")] = ""
    weighting: Annotated[str, Field(description="The likelihood."), OneOf(WEIGHTINGS)] = WEIGHTING
    device: Annotated[
        Device, Field(description="What weighs poses, where the likelihood lets it be chosen.")
    ] = CPU
    seed: Seed = 0
    keep: Annotated[bool, Field(description="Write the pose to a file.")] = True
    replace: Annotated[
        bool, Field(description="Make it the session's start pose; the old one is kept beside it.")
    ] = False


@operation
@taking(StartPoseRequest)
@keeping_in_place
def initialise(
    session: SessionName,
    frame: Annotated[
        int, Field(ge=0, description="The frame in which the start pose is searched."), Terminal("--frame")
    ] = 0,
    *,
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> InitialPose:
    """Find the pose in a frame of a session with nothing given but the body's dimensions, and write it down.

    It becomes the session's start pose if there is none, else a file beside it that tracking takes as a start pose.

    Raises RunError where nothing is to be seen in the frame.
    """
    opened, request = open_session(session), StartPoseRequest(**options)
    opened.checked_frames(frame, frame + 1)
    tree, notes = opened.body_with_notes(request.body or None)
    say(progress, notes, opened.path)
    with reporting(progress, f"{opened.name}: frame {frame}") as report:
        pose = initialise_session(
            opened,
            frame,
            body=tree,
            behaviour=request.behaviour,
            weighting=request.weighting,
            device=request.device,
            seed=request.seed,
            progress=report,
        )
    if request.keep:
        pose = dataclasses.replace(pose, file=keep_pose(opened, pose, request.replace))
    say(progress, [pose.note] if pose.note else [])
    return pose


@dataclass(frozen=True, slots=True)
class Landmarks:
    """A person's joints as a network sees them.

    file : the TRC that was written.
    motion : the joints over time, mm.
    seen : share of the frames with all joints.
    """

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
    """Write where a network sees a person's joints, triangulated over the cameras, as a reference that a run is
    measured by.

    The network knows nothing of the studio's bodies and searches, and needs no markers. It gives shoulders, elbows,
    wrists, hips, knees and ankles of a person (of people only), off by some centimetres, and shifted against a body's
    own joints by as much: `studio evaluate --truth FILE` prints the error with and without that shift.

    Raises FootageError where no two cameras see the same person, ExportError for another kind of file.
    """
    opened, path = open_session(session), Path(to).absolute()
    if path.suffix.lower() != ".trc":
        raise ExportError(
            f"'{path.name}' is not a name of a TRC file.", f"Call it '{path.with_suffix('.trc').name}'."
        )
    check_writable(path.parent)
    with closing(opened.footage()) as footage, reporting(progress, f"{opened.name}: joints") as report:
        motion = person_landmarks(opened.cameras(), footage, report)
    write_trc(path, motion)
    seen = np.isfinite(motion.positions).all(axis=(1, 2))
    return Landmarks(path, motion, float(seen.mean()))
