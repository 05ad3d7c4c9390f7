"""Makes a new run: fills in defaults, checks everything, then writes the record.

Defaults come from the session (body, subject, start pose, σ0, tracker, likelihood), else from the studio, so that a
run's record has everything that its poses depend on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata, resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studio.body.branches import within_limits
from studio.body.model import BodyModel
from studio.body.subject import Subject
from studio.errors import BodyError, RunError, StudioError
from studio.geometry.reach import within_reach
from studio.runs.behaviour_models import chosen_model
from studio.runs.initialising import InitialPose, Progress, initialise
from studio.runs.live_request import check_live, live_changes
from studio.runs.search_space import parameter_names, session_sigma
from studio.runs.session_settings import session_settings
from studio.runs.shape_on_the_way import session_shape
from studio.runs.silhouette_doubts import accepted_doubts
from studio.sessions.manifest import now
from studio.sessions.run_record import RunRecord
from studio.sessions.session import Session, free_run_name
from studio.sessions.stored_run import StoredRun
from studio.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING, values

Array = NDArray[np.float64]

DISTRIBUTION = "capture-studio"
DESPITE = "Tracked despite: "
"""Prefix of a run's note on an accepted fault of the calibration."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """The parameters of a new run; all have defaults.

    tracker, weighting, body : names, "" for the session's own. subject : measures instead of the session's.
    start_pose : (D,) radians and mm, instead of the session's; start_source : its origin, as text.
    first, last : frames, half open; first None means the frame that the session's start pose is of (0 where none is
    used, and live), last None all. changes : knobs by flat name. name : "" for run-1,
    run-2, … behaviour : a behaviour model, by its name in the workspace's models or by path; "" for the only one that
    fits where the settings need one. live : frames come on the footage's clock and are dropped where they come too
    fast (`live_run`). to_and_fro : a live run plays the footage forwards and backwards; `last` may lie behind its end.
    despite_findings : also where the footage contradicts the calibration. fit_shape : fit the body's radii, hands,
    feet and head to the first frames (`shape_on_the_way`); not for live runs, which cannot look ahead.
    """

    tracker: str = ""
    weighting: str = ""
    body: str = ""
    subject: Subject | None = None
    start_pose: Array | None = None
    start_source: str = ""
    first: int | None = None
    last: int | None = None
    seed: int = 0
    changes: Mapping[str, object] = field(default_factory=dict)
    name: str = ""
    behaviour: str = ""
    live: bool = False
    to_and_fro: bool = False
    despite_findings: bool = False
    fit_shape: bool = True


def prepare_run(
    session: Session, request: RunRequest | None = None, progress: Progress | None = None
) -> StoredRun:
    """Make a run's folder, ready to be tracked. Raises StudioError; then nothing was made.

    Without a start pose in request and session, and limits of the body to start between, the first frame is searched
    for one, which takes a while. progress : of that search.
    """
    request = request or RunRequest()
    doubts = accepted_doubts(session, request.despite_findings)
    tracker = request.tracker or session.manifest.tracker or DEFAULT_TRACKER
    weighting = request.weighting or session.manifest.weighting or DEFAULT_WEIGHTING
    changes = live_changes(request.changes) if request.live else request.changes
    settings = session_settings(session, tracker, weighting, changes)
    check_live(settings, live=request.live, to_and_fro=request.to_and_fro)
    own_start = request.start_pose is None and not request.live
    first, last = checked_frames(
        session, _first(session, request, own_start), request.last, endless=request.to_and_fro
    )
    if not 0 <= request.seed < 2**63:
        raise RunError(f"The seed {request.seed} cannot be used.", "Give a whole number of 0 or more.")
    body, notes = session.body_with_notes(request.body or None, request.subject)
    notes = (*notes, *(f"{DESPITE}{doubt}" for doubt in doubts))
    behaviour = chosen_model(session, body, settings, request.behaviour)
    if behaviour is not None and behaviour.note:
        notes = (*notes, behaviour.note)
    start, source = start_pose(session, body, request.start_pose, request.start_source)
    if own_start and start is not None and first != session.start_pose_frame():
        of = session.start_pose_frame()
        notes = (*notes, f"The run begins in frame {first}, the session's start pose is of frame {of}.")
    if start is None and not _limited(body):
        model = str(behaviour.path) if behaviour else ""
        found = _found(session, first, body, model, request.seed, progress)
        start, source = within_limits(body, found.pose), found.source
        notes = (*notes, *([found.note] if found.note else []))
    subject = dict(body.dimensions)
    if request.fit_shape and not request.live and start is not None:
        body, start, words = session_shape(session, body, settings, start, first, progress)
        notes = (*notes, *([words] if words else []))
    record = RunRecord(
        name=request.name or free_run_name(session),
        session=session.name,
        created=now(),
        tracker=tracker,
        weighting=weighting,
        body=body.name,
        dimensions=dict(body.dimensions),
        parameters=parameter_names(body),
        seed=request.seed,
        first=first,
        last=last,
        fps=session.manifest.fps,
        settings=dict(values(settings)),
        sigma=tuple(float(value) for value in session_sigma(session, body, session.manifest.fps)),
        start_pose=None if start is None else tuple(float(value) for value in start),
        start_source=source,
        software=software_version(),
        notes=tuple(notes),
        behaviour=behaviour.name if behaviour else "",
        live=request.live,
        to_and_fro=request.to_and_fro,
        subject_dimensions=subject if subject != body.dimensions else {},
    )
    text = _body_text(session, request.body or body.name)
    return session.new_run(record, text, behaviour.path if behaviour else None)


def _first(session: Session, request: RunRequest, own_start: bool) -> int:
    """The frame that a run begins in. Raises RunError where it would end before its start pose."""
    if request.first is not None:
        return request.first
    first = session.start_pose_frame() if own_start else 0
    if first and request.last is not None and request.last <= first:
        raise RunError(
            f"The start pose of session '{session.name}' is of frame {first}, after the last requested frame"
            f" ({request.last - 1}).",
            "Give the first frame, too, or find a start pose in an earlier frame.",
        )
    return first


def checked_frames(
    session: Session, first: int, last: int | None, *, endless: bool = False
) -> tuple[int, int]:
    """The frames of a run, half open. endless : the last may lie behind the footage's end. Raises RunError if any lies
    outside the footage, or there are none.
    """
    session.cameras()  # report missing footage or calibration first
    count = session.manifest.frame_count
    end = count if last is None else last
    if not 0 <= first < (min(end, count) if endless else end) <= count:
        raise RunError(
            f"Frames {first}:{end} do not lie in the footage of '{session.name}'.",
            f"It has frames 0:{count} (the last one not included).",
        )
    return first, end


def start_pose(
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


def _found(
    session: Session, frame: int, body: BodyModel, model: str, seed: int, progress: Progress | None
) -> InitialPose:
    """The start pose found in a run's first frame. Raises RunError if there is none."""
    try:
        return initialise(session, frame, body=body, behaviour=model, seed=seed, progress=progress)
    except StudioError as error:
        raise RunError(
            f"Session '{session.name}' has no start pose, and none can be found: {error.message}",
            "Give one with --start-pose FILE (a CSV row, or a TRC), or set it in the studio.",
        ) from None


def _limited(body: BodyModel) -> bool:
    return all(np.isfinite(entry.lower) and np.isfinite(entry.upper) for entry in body.parameters)


def software_version() -> str:
    """The studio's version."""
    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "not installed"


def _body_text(session: Session, name: str) -> str:
    """The text of the body's file, stored so that later changes of it do not affect the run."""
    if name.endswith(".toml"):
        return Path(name).read_text(encoding="utf-8")
    for folder in session.body_folders:
        if (folder / f"{name}.toml").is_file():
            return (folder / f"{name}.toml").read_text(encoding="utf-8")
    return (resources.files("studio.body") / "models" / f"{name}.toml").read_text(encoding="utf-8")
