"""Makes a new run: fills in defaults, checks everything, then writes the record.

Defaults come from the session (body, subject, start pose, σ0, tracker, likelihood), else from the studio, so that a
run's record has everything that its poses depend on.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from studio.body.branches import within_limits
from studio.body.catalogue import body_file_text
from studio.body.model import BodyModel
from studio.body.subject import Subject, height_spread, read_subject
from studio.foundations.arrays import Array
from studio.foundations.declaring import (
    AllowInconsistent,
    Body,
    First,
    Knobs,
    Last,
    Model,
    OneOf,
    Seed,
    Target,
    Terminal,
    Values,
    Web,
)
from studio.foundations.errors import BodyError, RunError, StudioError
from studio.foundations.geometry.reach import within_reach
from studio.foundations.knobs import Knob
from studio.foundations.package import software_version
from studio.foundations.progress import Progress, no_progress
from studio.runs.behaviour_models import chosen_model
from studio.runs.live.live_request import check_live, live_changes, live_search
from studio.runs.search_space import parameter_names, session_sigma
from studio.runs.setup.contrast import KnownPoses, contrast_notes
from studio.runs.setup.initialising import InitialPose, initialise
from studio.runs.setup.mask_quality import look_before_the_first_run
from studio.runs.setup.session_settings import session_settings
from studio.runs.setup.shape_on_the_way import fit_session_shape
from studio.runs.setup.silhouette_faults import accepted_faults
from studio.runs.setup.start_pose_file import frame_of_file, start_pose_from_file
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING, knob_table, values
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.random_numbers import COUNTED
from studio.sessions.manifest import now
from studio.sessions.run_record import RunRecord
from studio.sessions.session import Session, free_run_name, make_numbered_run
from studio.sessions.stored_run import StoredRun

DESPITE = "Tracked despite: "
"""Prefix of a run's note on an accepted fault of the calibration."""


OPTION_KNOBS = ("particles", "layers", "survival", "crossover", "device")


def own_knobs() -> list[Knob]:
    """The knobs of a search that have an option of their own on the command line."""
    known = {entry.name: entry for entry in reversed(knob_table())}
    return [known[name] for name in OPTION_KNOBS]


Pose = ArrayLike | InitialPose | str | Path
"""(D,) radians and mm in the body's order, what `initialise` found, or a file: a CSV row or a TRC."""
Numbers = list[float] | None
TrackerName = Annotated[
    str, Field(description=f"Default: the session's own, else {DEFAULT_TRACKER}."), OneOf(TRACKERS)
]
WeightingName = Annotated[
    str,
    Field(description=f"The likelihood; default: the session's own, else {DEFAULT_WEIGHTING}."),
    OneOf(WEIGHTINGS),
]


def prepare_run(
    session: Annotated[Session, Target("session")],
    *,
    tracker: TrackerName = "",
    weighting: WeightingName = "",
    body: Body = "",
    subject: Annotated[
        Subject | str | Path | None,
        Field(description="subject.toml to use instead of the session's."),
        Terminal(kind=Path),
    ] = None,
    start_pose: Annotated[
        Pose | None,
        Field(
            description="Radians and mm in the body's order, or a file: a CSV row, a TRC fitted by inverse kinematics."
        ),
        Terminal(kind=Path),
        Web(kind=Numbers),
    ] = None,
    start_source: Annotated[
        str,
        Field(max_length=200, description="The origin of that pose, as text."),
        Terminal(left_out=True),
        Web(kind=str),
    ] = "",
    behaviour: Annotated[
        Model,
        Field(
            description="Behaviour model, by name or file, for tracker behaviour or prediction=behaviour; default: the"
            " only one that fits, where one is needed."
        ),
    ] = "",
    first: First = None,
    last: Last = None,
    seed: Seed = 0,
    knobs: Annotated[
        Values,
        Field(description="Any other knob, by name; the guide lists them."),
        Knobs(own_knobs, others=True, with_defaults=False),
    ] = None,
    name: Annotated[str, Field(description="Of the run (letters, digits, - and _); default: numbered.")] = "",
    allow_inconsistent: AllowInconsistent = False,
    fit_shape: Annotated[
        bool,
        Field(
            description="Begin with the radii, hands, feet and head that the first frames show, and with bone lengths"
            " where none was measured. Not live."
        ),
        Terminal("--fit-shape/--keep-shape"),
    ] = True,
    live: Annotated[
        bool,
        Field(description="Track at the footage's rate, dropping frames rather than falling behind."),
        Terminal(left_out=True),
    ] = False,
    ping_pong: Annotated[
        bool,
        Field(
            description="A live run plays the footage forwards and backwards; last may lie behind the end."
        ),
        Terminal(left_out=True),
    ] = False,
    note: Annotated[
        str,
        Field(description="A line for the run's record: what it was made for."),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = "",
    progress: Progress = no_progress,
) -> StoredRun:
    """A new run, ready to be tracked; what is left out is the session's own or the studio's default.

    Without a start pose in request and session, and limits of the body to start between, the first frame is searched
    for one, which takes a while.

    Raises StudioError; then nothing was made.
    """
    of_masks = look_before_the_first_run(session, progress)
    faults = accepted_faults(session, allow_inconsistent)
    if live:
        tracker, weighting = live_search(tracker, weighting, behaviour)
    tracker = tracker or session.manifest.tracker or DEFAULT_TRACKER
    weighting = weighting or session.manifest.weighting or DEFAULT_WEIGHTING
    settings = session_settings(session, tracker, weighting, live_changes(knobs or {}) if live else knobs)
    check_live(settings, live=live, ping_pong=ping_pong)
    own = session.manifest.body
    measures = subject if isinstance(subject, Subject | None) else read_subject(Path(subject), own)
    given: Array | None = None
    if start_pose is not None:
        tree, fps = session.body(body or None, measures), session.manifest.fps
        given, start_source, first = given_pose(start_pose, start_source, tree, fps, first)
    own_start = given is None and not live
    tree, notes = session.body_with_notes(body or None, measures)
    of = session.start_pose_frame(tree.name) if own_start else 0
    first, last = session.checked_frames(_first(session, first, last, of), last, endless=ping_pong)
    if not 0 <= seed < 2**63:
        raise RunError(f"The seed {seed} cannot be used.", "Give a whole number of 0 or more.")
    notes = (*([note] if note else []), *notes, *(f"{DESPITE}{fault}" for fault in faults), *(of_masks or ()))
    model = chosen_model(session, tree, settings, behaviour)
    if model is not None and model.note:
        notes = (*notes, model.note)
    start, source = start_of(session, tree, given, start_source)
    if own_start and start is not None and first != of:
        notes = (*notes, f"The run begins in frame {first}, the session's start pose is of frame {of}.")
    if start is None and not _has_limits(tree):
        path = str(model.path) if model else ""
        begin = _find_start(session, first, tree, path, seed, progress)
        start, source = within_limits(tree, begin.pose), begin.source
        notes = (*notes, *([begin.note] if begin.note else []))
    if of_masks is not None and start is not None:
        notes = (
            *notes,
            *contrast_notes(session, settings.evidence, KnownPoses(tree, {first: start}, source)),
        )
    before = dict(tree.dimensions)
    if fit_shape and not live and start is not None and not tree.meshes:
        spread = height_spread(tree, measures or session.subject())
        tree, start, words = fit_session_shape(
            session, tree, settings, start, first, progress, height_spread=spread
        )
        notes = (*notes, *([words] if words else []))
    record = RunRecord(
        name=name or free_run_name(session),
        session=session.name,
        created=now(),
        tracker=tracker,
        weighting=weighting,
        body=tree.name,
        dimensions=dict(tree.dimensions),
        parameters=parameter_names(tree),
        seed=seed,
        first=first,
        last=last,
        fps=session.manifest.fps,
        settings=dict(values(settings)),
        sigma=tuple(float(value) for value in session_sigma(session, tree, session.manifest.fps)),
        start_pose=None if start is None else tuple(float(value) for value in start),
        start_source=source,
        software=software_version(),
        random_numbers=COUNTED,
        notes=tuple(notes),
        behaviour=model.name if model else "",
        live=live,
        ping_pong=ping_pong,
        subject_dimensions=before if before != tree.dimensions else {},
    )
    text = body_file_text(body or tree.name, session.body_folders)
    path = model.path if model else None
    return make_numbered_run(session, record, name, lambda record: session.new_run(record, text, path))


def given_pose(
    pose: Pose, source: str, body: BodyModel, fps: float, frame: int | None = None
) -> tuple[Array, str, int | None]:
    """A pose (D,) of a body, where it came from in words, and its frame.

    frame : if known.
    fps : of the footage.

    Raises BodyError, TruthError.
    """
    if isinstance(pose, InitialPose):
        return pose.pose, pose.source, pose.frame if frame is None else frame
    if isinstance(pose, str | Path):
        path = Path(pose)
        frame = frame_of_file(path) if frame is None else frame
        return *start_pose_from_file(path, body, frame, fps), frame
    return np.asarray(pose, dtype=np.float64), source or "given", frame


def _first(session: Session, first: int | None, last: int | None, of: int) -> int:
    """The frame that a run begins in. of : that of its start pose. Raises RunError where it would end before it."""
    if first is not None:
        return first
    if of and last is not None and last <= of:
        raise RunError(
            f"The start pose of session '{session.name}' is of frame {of}, after the last requested frame"
            f" ({last - 1}).",
            "Give the first frame, too, or find a start pose in an earlier frame.",
        )
    return of


def start_of(
    session: Session, body: BodyModel, given: Array | None, given_source: str = ""
) -> tuple[Array | None, str]:
    """The pose that the first frame starts from (its angles rewritten into the limits), and where it came from.

    None, if neither the request nor the session has one: then the search starts uniformly between the limits (Fig.
    12a), or without limits the first frame is searched for one. Raises BodyError for a wrong one.
    """
    if given is not None:
        pose = np.asarray(given, dtype=np.float64)
        if pose.shape != (len(body.parameters),) or not within_reach(pose):
            raise BodyError(
                f"A start pose of {body.name} has {len(body.parameters)} finite numbers, this one does not.",
                "Give radians and mm in the order of the body's parameters.",
            )
        return within_limits(body, pose), given_source or "given"
    stored = session.start_pose(body)
    if stored is not None:
        return stored, "the session's start pose"
    return None, "uniform over the limits"


def _find_start(
    session: Session, frame: int, body: BodyModel, model: str, seed: int, progress: Progress
) -> InitialPose:
    """The start pose found in a run's first frame. Raises RunError if there is none."""
    try:
        return initialise(session, frame, body=body, behaviour=model, seed=seed, progress=progress)
    except StudioError as error:
        raise RunError(
            f"Session '{session.name}' has no start pose, and none can be found: {error.message}",
            error.hint or "Give one with --start-pose FILE (a CSV row, or a TRC), or set it in the studio.",
        ) from None


def _has_limits(body: BodyModel) -> bool:
    return all(np.isfinite(entry.lower) and np.isfinite(entry.upper) for entry in body.parameters)
