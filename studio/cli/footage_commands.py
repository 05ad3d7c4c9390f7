"""Footage into sessions: `import`, `new`, `add-footage`, `synthesize`, `record`, `synchronise`."""

from collections.abc import Mapping

from studio.cli.deriving import Call, command_of
from studio.cli.output import note
from studio.footage.capture.live_cameras import SpreadFigures
from studio.footage.capture.synchrony import Synchrony, in_words
from studio.footage.capture.timestamps import TimedOffsets
from studio.operations.footage import (
    Synchronised,
    add_footage,
    import_footage,
    new_session,
    record,
    synchronise,
    synthesize,
)
from studio.sessions.footage_changes import stale_runs
from studio.sessions.session import Session


@command_of(import_footage, name="import")
def import_command(call: Call) -> dict[str, object]:
    session: Session = call()
    said = session.manifest
    return {
        "session": str(session.path),
        "layout": said.layout,
        "cameras": [f"{match.footage} → {match.camera} ({match.how})" for match in said.matching],
        "notes": list(said.notes),
        "warnings": list(said.warnings),
        "text": "\n".join(
            [
                f"Session {session.name} in {session.path}",
                *(f"  {match.footage} → {match.camera}" for match in said.matching),
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
    found = call()
    footage = found.session.manifest.footage
    result: dict[str, object] = {
        "session": found.session.name,
        "frames": footage.frame_count,
        "fps": footage.fps,
        "offsets": {camera.name: camera.offset for camera in footage.cameras},
        **spread_figures(found.spread),
        "warnings": list(found.warnings),
    }
    if found.standing is not None:
        result["cameras"] = {
            name: {
                "pictures": one.pictures,
                "repeated": one.repeated,
                "left_out": one.left_out,
                "missed": found.standing.missed[name],
            }
            for name, one in found.standing.figures.items()
        }
    words = f"{found.session.name}: {footage.frame_count} frames of {len(footage.cameras)} cameras at {footage.fps:g}"
    return {**result, "text": f"{words} a second; {found.spread.in_words}"}


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
        "stale_runs": list(stale_runs(done.session)),
    }
    words: list[str] = []
    found = done.found
    if isinstance(found, Synchrony):
        names = ("offsets", "confidence", "within", "sure")
        answer["estimate"] = {name: getattr(found, name) for name in names} | {"notes": list(found.notes)}
        words.append(in_words(found))
    elif isinstance(found, TimedOffsets):
        answer["recorded"] = {"offsets": found.offsets, "apart": found.apart}
        words += [f"{name}: {offset:+d} frames" for name, offset in found.offsets.items()]
        words.append(f"At most {found.apart:.2f} frames apart at {found.fps:.2f} frames a second.")
        words += found.notes
    if done.change is None:
        note("Nothing was changed; write it with --apply, or by hand with --offset CAMERA=FRAMES.")
    else:
        first = ", ".join(f"{camera.name}: {camera.offset}" for camera in footage.cameras)
        words += [f"Session {done.session.name}, first frames of each file: {first}", *done.change.notes]
        answer["notes"] = list(done.change.notes)
    return {**answer, "text": "\n".join(words)}
