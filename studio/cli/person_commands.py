"""The person: `subject`, `fit-subject`, `initialise`, `landmarks`."""

from dataclasses import asdict

from studio.body.model import BodyModel
from studio.cli.deriving import Call, command_of
from studio.operations.person import Landmarks, fit_subject, initialise, landmarks, subject
from studio.operations.subjects import subjects, together
from studio.runs.setup.initialising import InitialPose
from studio.runs.setup.subject_fitting import FittedSubject

UNSURE = 0.75


@command_of(subject)
def subject_command(call: Call) -> dict[str, object]:
    found: BodyModel = call()
    return {
        "session": call.given["session"].name,
        "body": found.name,
        "height_mm": call.given.get("height_mm"),
        "dimensions": dict(found.dimensions),
        "source": found.definition.source if found.definition else "",
        "text": "\n".join(f"{key:28} {value:8.1f}" for key, value in found.dimensions.items()),
    }


@command_of(fit_subject)
def fit_subject_command(call: Call) -> dict[str, object]:
    found: FittedSubject = call()
    lines = [
        f"{one.name:24} {one.before:7.0f} → {one.after:5.0f} mm ± {one.deviation:.0f}" for one in found.sizes
    ]
    fit = f"silhouettes overlap by {found.overlap_before.mean():.2f} before, {found.overlap.mean():.2f} after"
    kept = f"Subject written to {found.file.name}" if found.file else "Nothing was written"
    names = ("name", "kind", "before", "after", "deviation")
    return {
        "session": call.given["session"].name,
        "body": found.body.name,
        "file": str(found.file or ""),
        "frames": list(found.frames),
        "poses_from": found.poses_from,
        "sizes": [{name: getattr(one, name) for name in names} for one in found.sizes],
        "overlap_before": found.overlap_before.tolist(),
        "overlap": found.overlap.tolist(),
        "evaluations": found.evaluations,
        "text": "\n".join([*lines, f"{kept}; {fit}."]),
    }


@command_of(initialise)
def initialise_command(call: Call) -> dict[str, object]:
    found: InitialPose = call()
    sure = f"confidence {100.0 * found.confidence:.0f} %"
    if found.confidence < UNSURE:
        sure += ", look at it before you track: it may face the other way"
    kept = f"written to {found.file.name}" if found.file else "found, and not written"
    return {
        "frame": found.frame,
        "body": found.body,
        "confidence": round(found.confidence, 4),
        "margin": found.margin,
        "agreement": round(found.agreement, 4),
        "overlap": round(found.overlap, 4),
        "hull_litres": round(found.hull_litres, 2),
        "evaluations": found.evaluations,
        "note": found.note,
        "pose": {name: float(value) for name, value in zip(found.names, found.pose, strict=True)},
        "session": call.given["session"].name,
        "file": str(found.file or ""),
        "text": f"Pose of {found.body} in frame {found.frame} {kept} ({sure}).",
    }


@command_of(landmarks)
def landmarks_command(call: Call) -> dict[str, object]:
    found: Landmarks = call()
    session = call.given["session"].name
    return {
        "session": session,
        "file": str(found.file),
        "frames": len(found.motion.times),
        "seen": found.seen,
        "text": f"{found.file}: in {100.0 * found.seen:.0f} % of the frames all twelve joints. Measure a run by them"
        f" with 'studio evaluate {session} RUN --truth {found.file}'.",
    }


@command_of(subjects)
def subjects_command(call: Call) -> dict[str, object]:
    found = call()
    lines = [
        f"at {one.in_words()}: {one.litres:.0f} litres, {one.height:.2f} m high (hull)" for one in found.seen
    ]
    lines += [f"Session {one.name} in {one.path}" for one in found.sessions]
    return {
        "seen": [asdict(one) for one in found.seen],
        "sessions": [one.name for one in found.sessions],
        "notes": list(found.notes),
        "text": "\n".join(lines) or "Nobody is seen in the first frame.",
    }


@command_of(together)
def together_command(call: Call) -> dict[str, object]:
    found = call()
    count = len(found.poses[0])
    return {
        "first": found.first,
        "frames": count,
        "bodies": len(found.poses),
        "text": f"{len(found.poses)} bodies tracked over {count} frames; each session has its subject's masks.",
    }
