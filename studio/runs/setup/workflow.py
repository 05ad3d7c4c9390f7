"""The guided set-up: the status of each step of a session, computed from its files.

A step is "done", "ready" to be done, "blocked" by an earlier one, "stale" if its inputs have changed since, or
"running". The status is not stored; `sessions.provenance` and the snapshots in the runs' folders have the inputs of a
result.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

from studio.body.scale import longest_side, rest_height
from studio.body.subject import Subject
from studio.footage.calibration.checks import check_calibration
from studio.footage.calibration.rig_checks import NO_FLOOR, TILTED, UNIT, room_findings
from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import read_file
from studio.foundations.words import counted, enumerated
from studio.runs.checking import kept_check
from studio.runs.setup.background_setup import MASK_SOURCES
from studio.runs.setup.levelling import floor_was_set
from studio.runs.setup.silhouette_faults import known_faults
from studio.runs.setup.turned_cameras import misses_in_words
from studio.runs.tracks import best_track
from studio.sessions.background_files import (
    ANIMAL_MASKS,
    CHOSEN_MASKS,
    PERSON_MASKS,
    STROKE_MASKS,
    SUBJECT_MASKS,
    has_made_masks,
    home_of_masks,
    read_evidence,
)
from studio.sessions.footage_changes import stale_runs
from studio.sessions.provenance import changed_inputs, origin_of
from studio.sessions.run_record import CAMERAS_NAME
from studio.sessions.session import START_POSE_NAME, SUBJECT_NAME, Session
from studio.sessions.stored_run import StoredRun

StepName = Literal[
    "footage", "calibration", "background", "subject", "start-pose", "track", "check", "export"
]
StepState = Literal["done", "ready", "blocked", "stale", "running"]
STEPS: tuple[StepName, ...] = get_args(StepName)


@dataclass(frozen=True, slots=True)
class StepStatus:
    """How a step stands.

    words : its result.
    why : why it is stale, blocked or unreadable, sentences.
    optional : whether tracking works without it.
    run : that it is about, "" for none.
    """

    step: StepName
    state: StepState
    words: str
    why: str = ""
    optional: bool = False
    run: str = ""


CHANGED = {
    "footage": "the footage",
    "calibration": "the calibration",
    "subject": "the subject",
    "masks": "the masks",
}


MADE_WORDS = {
    ANIMAL_MASKS: "the animal, cut out before the empty place",
    PERSON_MASKS: "the person, cut out by a network",
    STROKE_MASKS: "cut out by brush strokes",
    CHOSEN_MASKS: "each camera's best source",
    SUBJECT_MASKS: "one subject, cut from the masks",
}
"""What the studio's own masks are, by where they lie."""


def footage_step(session: Session) -> StepStatus:
    """Cameras, frames, rate; stale if a file is missing."""
    source = session.manifest.footage
    if not source.cameras:
        return StepStatus("footage", "ready", "no footage yet")
    words = f"{counted(len(source.cameras), 'camera')}, {counted(source.frame_count, 'frame')}, {source.fps:g} fps"
    missing = [camera.name for camera in source.cameras if not (session.path / camera.path).exists()]
    if missing:
        return StepStatus("footage", "stale", words, f"The file of camera {enumerated(missing)} is missing.")
    return StepStatus("footage", "done", words)


def calibration_step(session: Session) -> StepStatus:
    """Whether every camera with footage is calibrated."""
    if not session.is_calibrated:
        return StepStatus("calibration", "ready", "not calibrated yet")
    cameras = session.cameras()
    words = counted(len(cameras), "camera")
    source = session.manifest.calibration_source
    sizes = {camera.name: (camera.width, camera.height) for camera in cameras}
    other = [
        entry.name
        for entry in session.manifest.footage.cameras
        if (entry.width, entry.height) != sizes[entry.name]
    ]
    if other:
        return StepStatus(
            "calibration",
            "stale",
            words,
            f"The footage of camera {enumerated(other)} is of another size now.",
        )
    codes = (UNIT,) if floor_was_set(session) else (UNIT, TILTED, NO_FLOOR)
    findings = (*check_calibration(cameras), *room_findings(cameras, _size_mm(session)))
    if tilted := [finding for finding in findings if finding.code in codes]:
        why = " ".join([*(finding.message for finding in tilted), tilted[0].remedy])
        return StepStatus("calibration", "stale", words, why)
    if faults := known_faults(session):
        return StepStatus("calibration", "stale", words, f"The footage contradicts it: {faults[0]}")
    return StepStatus(
        "calibration", "done", f"{words}, {source}" if source else words, misses_in_words(session)
    )


NOT_LOOKED_AT = "Its masks were not set up yet: look whether they show the subject."


def background_step(session: Session) -> StepStatus:
    """The masks: given, or from a background that was set; their measured quality."""
    sources = session.manifest.footage.cameras
    masks = sum(bool(source.masks) for source in sources)
    made = sum(map(has_made_masks, sources))
    plates = sum(bool(source.background) for source in sources)
    given = masks == len(sources)
    known = origin_of(session, "background")
    model = read_evidence(session).knobs.get("background_model", "auto")
    homes = {home_of_masks(source) for source in sources}
    if made == len(sources) and made and model == MASK_SOURCES["person"].model:
        words = MADE_WORDS[homes.pop()] if len(homes) == 1 else "masks that the studio made"
    elif model == MASK_SOURCES["threshold"].model:
        words = "by brightness and colour"
    elif given and model in ("auto", "mask"):
        words = "masks came with the footage"
    elif plates:
        words = f"backgrounds of {counted(plates, 'camera')}"
    else:
        words = "background from the footage"
    if known is None:
        is_set = given or plates == len(sources) or bool(read_evidence(session).knobs)
        if not is_set:
            return StepStatus("background", "ready", words)
        return StepStatus("background", "done", words, "" if given else NOT_LOOKED_AT)
    words = known.words or words
    stale = _stale(session, "background", words, "Measured with")
    if stale is not None:
        return stale
    why = "" if known.good else f"Some views do not agree in the hull: {_what_to_look_at(session)}."
    return StepStatus("background", "done" if known.good else "ready", words, why)


def _what_to_look_at(session: Session) -> str:
    """The remedy for masks that disagree, by what was measured."""
    if misses_in_words(session) or known_faults(session):
        return "the calibration, which the silhouettes contradict, may be the cause: see there, then check the masks"
    return "check the masks, and measure whether the cameras agree"


def _standing_mm(session: Session) -> float:
    """The standing height of the session's body."""
    return rest_height(session.body())


def _size_mm(session: Session) -> float:
    """The longest extent of the session's body, 0 where that cannot be read."""
    try:
        body = session.body()
    except StudioError:
        return 0.0
    return longest_side(body)


def subject_step(session: Session) -> StepStatus:
    """The subject: by height, or fitted."""
    if not (session.path / SUBJECT_NAME).exists():
        return StepStatus("subject", "ready", f"body {session.manifest.body}, of usual size", optional=True)
    subject = session.subject()
    known = origin_of(session, "subject")
    given = subject.height_mm if subject else None
    stands = _standing_mm(session) if known else given
    parts = [subject.body if subject else session.manifest.body]
    parts += [f"{stands / 1000:.2f} m"] if stands and given else []
    parts += ["fitted to the footage" if known else _measures_in_words(subject)]
    words = ", ".join(parts)
    return _stale(session, "subject", words, "Fitted with") or StepStatus("subject", "done", words)


def _measures_in_words(subject: Subject | None) -> str:
    """What is known of a subject's size."""
    if subject and subject.lengths_mm:
        return f"by {counted(len(subject.lengths_mm), 'measured length')}"
    if subject and (subject.dimensions_mm or subject.ratios):
        return "measures given"
    return "by height" if subject and subject.height_mm else "as its file says"


MAY_FACE_BACK = "It may face the other way: check left and right before you track."


def start_pose_step(session: Session) -> StepStatus:
    """The pose in the first frame; optional for bodies with limits on all parameters."""
    if not (session.path / START_POSE_NAME).exists():
        optional = all(_is_bounded(entry.lower, entry.upper) for entry in session.body().parameters)
        return StepStatus("start-pose", "ready", "not set yet", optional=optional)
    session.start_pose()
    known = origin_of(session, "start-pose")
    words = (known.words if known else "") or "set"
    why = MAY_FACE_BACK if known and not known.good else ""
    return _stale(session, "start-pose", words, "Made with") or StepStatus("start-pose", "done", words, why)


def _stale(session: Session, step: StepName, words: str, how: str) -> StepStatus | None:
    """The step as stale if its inputs have changed, else None."""
    changed = [CHANGED[name] for name in changed_inputs(session, step)]
    if not changed:
        return None
    has = "have" if len(changed) > 1 or changed[0].endswith("masks") else "has"
    why = f"{how} an earlier state of {enumerated(changed)}, which {has} changed since."
    return StepStatus(step, "stale", words, why)


def _is_bounded(lower: float, upper: float) -> bool:
    return lower > float("-inf") and upper < float("inf")


@dataclass(frozen=True, slots=True)
class ExportedFile:
    """A file exported from the run that is used. stale : why it is out of date, a clause; "" if it is not."""

    name: str
    stale: str = ""


NOT_EVERYWHERE = "It does not fit everywhere: look at the frames that step Check names."


def newest_run(session: Session) -> StoredRun | None:
    """The newest run that plays its footage once; None without one."""
    runs = _runs_once(session)
    return runs[-1] if runs else None


def run_to_use(session: Session) -> StoredRun | None:
    """The run to check and export: the newest with frames, unless cancelled and an older one is complete."""
    cancelled = None
    for run in reversed(_runs_once(session)):
        summary = run.summary()
        if not summary.done:
            continue
        if summary.status != "cancelled":
            if cancelled is None or summary.status == "finished":
                return run
        elif cancelled is None:
            cancelled = run
    return cancelled


def _runs_once(session: Session) -> list[StoredRun]:
    return [run for run in session.runs() if not run.record.ping_pong]


def run_changes(session: Session, run: StoredRun) -> list[str]:
    """The inputs of a run that have changed since, in words."""
    changed: list[str] = []
    if run.name in stale_runs(session):
        changed.append("the footage's offsets or turns")
    if session.is_calibrated and session.calibration_of_footage() != read_file(run.folder / CAMERAS_NAME):
        changed.append("the calibration")
    measured = run.record.subject_dimensions or run.record.dimensions
    if session.body(run.record.body).dimensions != measured:
        changed.append("the subject's measures")
    return changed


def track_step(session: Session) -> StepStatus:
    """The newest run, and whether its inputs are unchanged; where it was cancelled, the one that is used instead."""
    newest = newest_run(session)
    if newest is None:
        return StepStatus("track", "ready", "nothing tracked yet")
    summary = newest.summary()
    if summary.status == "tracking":
        words = f"{newest.name}: {summary.done} of {counted(newest.record.frame_count, 'frame')}"
        return StepStatus("track", "running", words, run=newest.name)
    run = run_to_use(session)
    if run is None:
        ended = "was cancelled before its first frame" if summary.status == "cancelled" else "has not begun"
        return StepStatus("track", "ready", f"{newest.name} {ended}", run=newest.name)
    before = ""
    if run.name != newest.name:
        ended = "was cancelled" if summary.status == "cancelled" else "has not begun"
        before, summary = f"{newest.name} {ended}: {run.name} is used.", run.summary()
    words = f"{run.name}: {summary.done} of {counted(run.record.frame_count, 'frame')}"
    if summary.damaged:
        return StepStatus("track", "stale", words, summary.damage, run=run.name)
    changed = run_changes(session, run)
    if changed:
        why = f"{run.name} was tracked before {enumerated(changed)} changed: track again."
        return StepStatus("track", "stale", words, why, run=run.name)
    missing = run.record.frame_count - summary.done
    why = (
        f"{counted(missing, 'frame')} of it {'is' if missing == 1 else 'are'} not tracked." if missing else ""
    )
    return StepStatus("track", "done", words, " ".join(filter(None, (before, why))), run=run.name)


def check_step(session: Session) -> StepStatus:
    run = run_to_use(session)
    if run is None:
        return StepStatus("check", "blocked", "", "It needs a run that has frames.")
    name = best_track(run).name
    check = kept_check(run, name)
    if check is None:
        return StepStatus("check", "ready", f"{run.name}, track {name}: not checked yet", run=run.name)
    words = f"{name}: {check.in_words()}"
    changed = run_changes(session, run)
    if changed:
        why = f"Measured before {enumerated(changed)} changed."
        return StepStatus("check", "stale", words, why, run=run.name)
    return StepStatus("check", "done", words, "" if check.good else NOT_EVERYWHERE, run=run.name)


def export_step(session: Session, exports: Sequence[ExportedFile]) -> StepStatus:
    """The files exported from the run that is used, and whether they are up to date."""
    run = run_to_use(session)
    if run is None:
        return StepStatus("export", "blocked", "", "It needs a run that has frames.")
    if not exports:
        return StepStatus("export", "ready", "no file yet", run=run.name)
    words = f"{counted(len(exports), 'file')} of {run.name}"
    old = [file for file in exports if file.stale]
    if old:
        why = f"{'; '.join(f'{file.name}: {file.stale}' for file in old[:3])}{' …' if len(old) > 3 else ''}."
        why = f"{why} Export again, or delete the old files."
        return StepStatus("export", "stale", words, why, run=run.name)
    return StepStatus("export", "done", words, run=run.name)


NEEDS: Mapping[str, tuple[str, ...]] = {
    "footage": (),
    "calibration": ("footage",),
    "background": ("footage",),
    "subject": ("footage", "calibration"),
    "start-pose": ("footage", "calibration"),
    "track": ("footage", "calibration"),
    "check": ("footage", "calibration"),
    "export": ("footage", "calibration"),
}
"""Steps that have to be done (stale counts) before a step."""


@dataclass(frozen=True, slots=True)
class Workflow:
    """All steps in order.

    next : the first that needs work, "" if none does.
    """

    steps: tuple[StepStatus, ...]
    next: str


def workflow_of(
    session: Session, running: Mapping[str, str] | None = None, exports: Sequence[ExportedFile] | None = None
) -> Workflow:
    """The status of a session. running : step to the progress of its job. exports : files exported from the run
    that is used, None if unknown.

    Never raises for a part that cannot be read: its step reports it.
    """
    makers: dict[StepName, Callable[[], StepStatus]] = {
        "footage": lambda: footage_step(session),
        "calibration": lambda: calibration_step(session),
        "background": lambda: background_step(session),
        "subject": lambda: subject_step(session),
        "start-pose": lambda: start_pose_step(session),
        "track": lambda: track_step(session),
        "check": lambda: check_step(session),
        "export": lambda: export_step(session, exports or ()),
    }
    steps: dict[str, StepStatus] = {}
    for step in STEPS:
        steps[step] = _status(step, makers[step], steps, running or {})
    return Workflow(tuple(steps.values()), _next(tuple(steps.values())))


def _status(
    step: StepName,
    make: Callable[[], StepStatus],
    before: Mapping[str, StepStatus],
    running: Mapping[str, str],
) -> StepStatus:
    lacking = next((need for need in NEEDS[step] if before[need].state not in ("done", "stale")), None)
    if lacking is not None:
        return StepStatus(step, "blocked", "", f"It needs {LACKING[lacking]}.")
    try:
        status = make()
    except StudioError as error:
        status = StepStatus(step, "ready", "", str(error))
    return replace(status, state="running", words=running[step]) if step in running else status


LACKING = {"footage": "footage", "calibration": "a calibration"}


def _next(steps: Sequence[StepStatus]) -> str:
    """The first step to do or redo; else the first optional one that is ready."""
    pressing = [
        step.step for step in steps if not step.optional and step.state in ("stale", "ready", "running")
    ]
    return pressing[0] if pressing else next((step.step for step in steps if step.state == "stale"), "")
