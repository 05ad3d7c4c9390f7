"""The person: `subject`, `fit-subject`, `initialise`, `landmarks`."""

from dataclasses import asdict

from studio.body.model import BodyModel
from studio.cli.deriving import Call, command_of
from studio.operations.person import Landmarks, fit_subject, initialise, landmarks, subject
from studio.operations.subjects import subjects, together
from studio.runs.setup.initialising import InitialPose
from studio.runs.setup.subject_fitting import FittedSubject


@command_of(subject)
def subject_command(call: Call) -> dict[str, object]:
    body: BodyModel = call()
    return {
        "session": call.given["session"].name,
        "body": body.name,
        "height_mm": call.given.get("height_mm"),
        "dimensions": dict(body.dimensions),
        "source": body.definition.source if body.definition else "",
        "text": "\n".join(f"{key:28} {value:8.1f}" for key, value in body.dimensions.items()),
    }


@command_of(fit_subject)
def fit_subject_command(call: Call) -> dict[str, object]:
    fitted: FittedSubject = call()
    lines = [
        f"{one.name:24} {one.before:7.0f} → {one.after:5.0f} mm ± {one.deviation:.0f}" for one in fitted.sizes
    ]
    fit = (
        f"silhouettes overlap by {fitted.overlap_before.mean():.2f} before, {fitted.overlap.mean():.2f} after"
    )
    kept = f"Subject written to {fitted.file.name}" if fitted.file else "Nothing was written"
    names = ("name", "kind", "before", "after", "deviation")
    return {
        "session": call.given["session"].name,
        "body": fitted.body.name,
        "file": str(fitted.file or ""),
        "frames": list(fitted.frames),
        "poses_from": fitted.poses_from,
        "sizes": [{name: getattr(one, name) for name in names} for one in fitted.sizes],
        "overlap_before": fitted.overlap_before.tolist(),
        "overlap": fitted.overlap.tolist(),
        "evaluations": fitted.evaluations,
        "text": "\n".join([*lines, f"{kept}; {fit}."]),
    }


@command_of(initialise)
def initialise_command(call: Call) -> dict[str, object]:
    initial: InitialPose = call()
    sure = f"confidence {100.0 * initial.confidence:.0f} %"
    if initial.unsure:
        sure += ", look at it before you track: it may face the other way"
    kept = f"written to {initial.file.name}" if initial.file else "found, and not written"
    return {
        "frame": initial.frame,
        "body": initial.body,
        "confidence": round(initial.confidence, 4),
        "margin": initial.margin,
        "agreement": round(initial.agreement, 4),
        "overlap": round(initial.overlap, 4),
        "hull_litres": round(initial.hull_litres, 2),
        "evaluations": initial.evaluations,
        "note": initial.note,
        "pose": {name: float(value) for name, value in zip(initial.names, initial.pose, strict=True)},
        "session": call.given["session"].name,
        "file": str(initial.file or ""),
        "text": f"Pose of {initial.body} in frame {initial.frame} {kept} ({sure}).",
    }


@command_of(landmarks)
def landmarks_command(call: Call) -> dict[str, object]:
    tracked: Landmarks = call()
    session = call.given["session"].name
    return {
        "session": session,
        "file": str(tracked.file),
        "frames": len(tracked.motion.times),
        "seen": tracked.seen,
        "text": f"{tracked.file}: in {100.0 * tracked.seen:.0f} % of the frames all twelve joints. Measure a run by"
        f" them with 'studio evaluate {session} RUN --truth {tracked.file}'.",
    }


@command_of(subjects)
def subjects_command(call: Call) -> dict[str, object]:
    answer = call()
    lines = [
        f"at {one.in_words()}: {one.litres:.0f} litres, {one.height:.2f} m high (hull)" for one in answer.seen
    ]
    lines += [f"Session {one.name} in {one.path}" for one in answer.sessions]
    return {
        "seen": [asdict(one) for one in answer.seen],
        "sessions": [one.name for one in answer.sessions],
        "notes": list(answer.notes),
        "text": "\n".join(lines) or "Nobody is seen in the first frame.",
    }


@command_of(together)
def together_command(call: Call) -> dict[str, object]:
    tracked = call()
    count = len(tracked.poses[0])
    return {
        "first": tracked.first,
        "frames": count,
        "bodies": len(tracked.poses),
        "text": f"{len(tracked.poses)} bodies tracked over {count} frames; each session has its subject's masks.",
    }
