"""The steps of the guided set-up before tracking: footage, calibration, background, subject, start pose."""

from studio.body.forward_kinematics import limb_ends
from studio.runs.background_setup import MODEL_OF
from studio.runs.silhouette_doubts import standing_doubts
from studio.runs.turned_cameras import misses_in_words
from studio.runs.workflow_step import StepName, StepStatus, counted, enumerated
from studio.sessions.background_files import (
    CHOSEN_MASKS,
    PERSON_MASKS,
    STROKE_MASKS,
    has_made_masks,
    home_of_masks,
    read_evidence,
)
from studio.sessions.made_from import changed_inputs, origin_of
from studio.sessions.session import START_POSE_NAME, SUBJECT_NAME, Session

CHANGED = {
    "footage": "the footage",
    "calibration": "the calibration",
    "subject": "the subject",
    "masks": "the masks",
}


MADE_WORDS = {
    PERSON_MASKS: "the person, cut out by a network",
    STROKE_MASKS: "cut out by brush strokes",
    CHOSEN_MASKS: "each camera's best source",
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
    if doubts := standing_doubts(session):
        return StepStatus("calibration", "stale", words, f"The footage contradicts it: {doubts[0]}")
    return StepStatus(
        "calibration", "done", f"{words}, {source}" if source else words, misses_in_words(session)
    )


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
    if made == len(sources) and made and model == MODEL_OF["person"]:
        words = MADE_WORDS[homes.pop()] if len(homes) == 1 else "masks that the studio made"
    elif model == MODEL_OF["threshold"]:
        words = "by brightness and colour"
    elif given and model in ("auto", "mask"):
        words = "masks came with the footage"
    elif plates:
        words = f"backgrounds of {counted(plates, 'camera')}"
    else:
        words = "background from the footage"
    if known is None:
        is_set = given or plates == len(sources) or bool(read_evidence(session).knobs)
        return StepStatus("background", "done" if is_set else "ready", words)
    words = known.words or words
    stale = _stale(session, "background", words, "Measured with")
    if stale is not None:
        return stale
    why = "" if known.good else f"Some views do not agree in the hull: {_what_to_look_at(session)}."
    return StepStatus("background", "done" if known.good else "ready", words, why)


def _what_to_look_at(session: Session) -> str:
    """The remedy for masks that disagree, by what was measured."""
    if misses_in_words(session) or standing_doubts(session):
        return "the calibration, which the silhouettes contradict, may be the cause: see there, then check the masks"
    return "check the masks, and measure whether the cameras agree"


def _standing_mm(session: Session) -> float:
    """The standing height of the session's body."""
    body = session.body()
    return float(limb_ends(body, body.neutral)[0, ..., 2].max())


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
    parts += ["fitted to the footage"] if known else ["by height"] if given else ["measures given"]
    if subject and not (known or given or subject.lengths_mm or subject.dimensions_mm or subject.ratios):
        parts[-1] = "as its file says"
    words = ", ".join(parts)
    return _stale(session, "subject", words, "Fitted with") or StepStatus("subject", "done", words)


def start_pose_step(session: Session) -> StepStatus:
    """The pose in the first frame; optional for bodies with limits on all parameters."""
    if not (session.path / START_POSE_NAME).exists():
        optional = all(_is_bounded(entry.lower, entry.upper) for entry in session.body().parameters)
        return StepStatus("start-pose", "ready", "not set yet", optional=optional)
    session.start_pose()
    known = origin_of(session, "start-pose")
    words = (known.words if known else "") or "set"
    return _stale(session, "start-pose", words, "Made with") or StepStatus("start-pose", "done", words)


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
