"""Footage into sessions: `import`, `new`, `add-footage`, `synthesize`, `record`, `synchronise`."""

from collections.abc import Mapping

from studio.cli.deriving import Call, command_of
from studio.cli.output import note
from studio.footage.capture.live_cameras import SpreadFigures
from studio.footage.capture.synchrony import Synchrony
from studio.operations.footage import (
    Synchronised,
    add_footage,
    footage_state,
    import_footage,
    new_session,
    record,
    synchronise,
    synthesize,
)
from studio.sessions.session import Session


@command_of(import_footage, name="import")
def import_command(call: Call) -> dict[str, object]:
    session: Session = call()
    manifest = session.manifest
    return {
        "session": str(session.path),
        "layout": manifest.layout,
        "cameras": [f"{match.footage} → {match.camera} ({match.how})" for match in manifest.matching],
        "notes": list(manifest.notes),
        "warnings": list(manifest.warnings),
        "text": "\n".join(
            [
                f"Session {session.name} in {session.path}",
                *(f"  {match.footage} → {match.camera}" for match in manifest.matching),
            ]
        ),
    }


@command_of(new_session, name="new")
def new_command(call: Call) -> dict[str, object]:
    return {"session": str(call().path), "next": "footage"}


@command_of(add_footage)
def add_footage_command(call: Call) -> dict[str, object]:
    added = call()
    footage = added.session.manifest.footage
    return {
        "session": str(added.session.path),
        "cameras": [camera.name for camera in footage.cameras],
        "frames": footage.frame_count,
        "fps": footage.fps,
        "calibrated": added.session.is_calibrated,
        "warnings": list(added.warnings),
    }


@command_of(synthesize)
def synthesize_command(call: Call) -> dict[str, object]:
    session: Session = call()
    return {"session": str(session.path), "text": f"Session {session.name} in {session.path}"}


@command_of(record)
def record_command(call: Call) -> dict[str, object]:
    recorded = call()
    footage = recorded.session.manifest.footage
    result: dict[str, object] = {
        "session": recorded.session.name,
        "frames": footage.frame_count,
        "fps": footage.fps,
        "offsets": {camera.name: camera.offset for camera in footage.cameras},
        **spread_figures(recorded.spread),
        "warnings": list(recorded.warnings),
    }
    if recorded.standing is not None:
        result["cameras"] = {
            name: {
                "pictures": one.pictures,
                "repeated": one.repeated,
                "left_out": one.left_out,
                "missed": recorded.standing.missed[name],
            }
            for name, one in recorded.standing.figures.items()
        }
    count, many = footage.frame_count, len(footage.cameras)
    words = f"{recorded.session.name}: {count} frames of {many} cameras at {footage.fps:g}"
    return {**result, "text": f"{words} a second; {recorded.spread.in_words}"}


def spread_figures(spread: SpreadFigures) -> dict[str, object]:
    """How far apart pictures came, as `--json` has it."""
    return {
        "spread_ms": {"median": spread.median, "p95": spread.most, "worst": spread.worst},
        "apart": spread.apart,
        "lagging": spread.lagging,
    }


@command_of(synchronise)
def synchronise_command(call: Call) -> Mapping[str, object]:
    done: Synchronised = call()
    footage = done.session.manifest.footage
    answer: dict[str, object] = {
        "frames": footage.frame_count,
        "offsets": {camera.name: camera.offset for camera in footage.cameras},
        "rotations": {camera.name: camera.turned for camera in footage.cameras},
        "stale_runs": list(footage_state(done.session).stale_runs),
    }
    words = done.in_words()
    if isinstance(done.synchrony, Synchrony):
        names = ("offsets", "confidence", "within", "sure")
        answer["estimate"] = {name: getattr(done.synchrony, name) for name in names} | {
            "notes": list(done.synchrony.notes)
        }
    elif done.synchrony is not None:
        answer["recorded"] = {"offsets": done.synchrony.offsets, "apart": done.synchrony.apart}
    if done.change is None:
        note("Nothing was changed; write it with --apply, or by hand with --offset CAMERA=FRAMES.")
    else:
        first = ", ".join(f"{camera.name}: {camera.offset}" for camera in footage.cameras)
        words += [f"Session {done.session.name}, first frames of each file: {first}", *done.change.notes]
        answer["notes"] = list(done.change.notes)
    return {**answer, "text": "\n".join(words)}
