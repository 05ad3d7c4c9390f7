"""A new run of a session: what was not asked for is filled in, everything is checked, then it is written
down.

What is filled in comes from the session (body, subject, start pose, σ0, tracker, weighting) and else from the
studio's defaults, so that a run's record says everything that its poses depend on.
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
"""How a run's note on an accepted fault of the calibration begins."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What a person asks of a new run; everything has a default.

    tracker, weighting, body : names, "" for the session's own. subject : measures instead of the session's.
    start_pose : (D,) radians and mm, instead of the session's; start_source : where it came from, in words.
    first, last : frames, half open; first None means the frame that the session's start pose is of (0 where none is
    used, and live), last None all. changes : knobs by flat name. name : "" for run-1,
    run-2, … behaviour : a behaviour model, by its name in the workspace's models or by path; "" for the only one that
    fits where the settings need one. live : frames come on the footage's clock and are dropped where they come too
    fast (`live_run`). to_and_fro : a live run goes forth and back through the footage; `last` may lie behind its end.
    despite_findings : also where the footage speaks against the calibration. fit_shape : the first frames show the
    body's radii, hands, feet and head (`shape_on_the_way`); not for live runs, which cannot look ahead.
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
    """Make a run's folder, ready to be tracked. Raises StudioError naming what is wrong; then nothing was made.

    Where neither the request nor the session has a start pose and the body has no limits to begin between, the first
    frame is searched for one, which takes a while. progress : told how far that is.
    """
    asked = request or RunRequest()
    doubts = accepted_doubts(session, asked.despite_findings)
    tracker = asked.tracker or session.manifest.tracker or DEFAULT_TRACKER
    weighting = asked.weighting or session.manifest.weighting or DEFAULT_WEIGHTING
    changes = live_changes(asked.changes) if asked.live else asked.changes
    settings = session_settings(session, tracker, weighting, changes)
    check_live(settings, live=asked.live, to_and_fro=asked.to_and_fro)
    own_start = asked.start_pose is None and not asked.live
    first, last = checked_frames(
        session, _first(session, asked, own_start), asked.last, endless=asked.to_and_fro
    )
    if not 0 <= asked.seed < 2**63:
        raise RunError(f"The seed {asked.seed} cannot be used.", "Give a whole number of 0 or more.")
    body, notes = session.body_with_notes(asked.body or None, asked.subject)
    notes = (*notes, *(f"{DESPITE}{doubt}" for doubt in doubts))
    behaviour = chosen_model(session, body, settings, asked.behaviour)
    if behaviour is not None and behaviour.note:
        notes = (*notes, behaviour.note)
    start, source = start_pose(session, body, asked.start_pose, asked.start_source)
    if own_start and start is not None and first != session.start_pose_frame():
        of = session.start_pose_frame()
        notes = (*notes, f"The run begins in frame {first}, the session's start pose is of frame {of}.")
    if start is None and not _limited(body):
        model = str(behaviour.path) if behaviour else ""
        found = _found(session, first, body, model, asked.seed, progress)
        start, source = within_limits(body, found.pose), found.source
        notes = (*notes, *([found.note] if found.note else []))
    subject = dict(body.dimensions)
    if asked.fit_shape and not asked.live and start is not None:
        body, start, words = session_shape(session, body, settings, start, first, progress)
        notes = (*notes, *([words] if words else []))
    record = RunRecord(
        name=asked.name or free_run_name(session),
        session=session.name,
        created=now(),
        tracker=tracker,
        weighting=weighting,
        body=body.name,
        dimensions=dict(body.dimensions),
        parameters=parameter_names(body),
        seed=asked.seed,
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
        live=asked.live,
        to_and_fro=asked.to_and_fro,
        subject_dimensions=subject if subject != body.dimensions else {},
    )
    text = _body_text(session, asked.body or body.name)
    return session.new_run(record, text, behaviour.path if behaviour else None)


def _first(session: Session, asked: RunRequest, own_start: bool) -> int:
    """The frame that a run begins in. Raises RunError where it would end before its start pose."""
    if asked.first is not None:
        return asked.first
    first = session.start_pose_frame() if own_start else 0
    if first and asked.last is not None and asked.last <= first:
        raise RunError(
            f"The start pose of session '{session.name}' is of frame {first}, after the last frame wanted"
            f" ({asked.last - 1}).",
            "Name the first frame, too, or find a start pose in an earlier frame.",
        )
    return first


def checked_frames(
    session: Session, first: int, last: int | None, *, endless: bool = False
) -> tuple[int, int]:
    """The frames of a run, half open. endless : the last may lie behind the footage's end. Raises RunError if any lies
    outside the footage, or there are none.
    """
    session.cameras()  # what a session lacks altogether is said first
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

    None, where neither the request nor the session has one: then a search starts uniformly between the limits (Fig.
    12a), or where there are none the body is looked for. Raises BodyError for a wrong one.
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
    """The pose in a run's first frame. Raises RunError where there is none to be found."""
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
    """The studio's version, for records."""
    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "not installed"


def _body_text(session: Session, name: str) -> str:
    """The body's file as it is now, so that a later version of it cannot change what a run means."""
    if name.endswith(".toml"):
        return Path(name).read_text(encoding="utf-8")
    for folder in session.body_folders:
        if (folder / f"{name}.toml").is_file():
            return (folder / f"{name}.toml").read_text(encoding="utf-8")
    return (resources.files("studio.body") / "models" / f"{name}.toml").read_text(encoding="utf-8")
