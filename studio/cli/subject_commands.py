"""`studio subjects` and `studio together`."""

from dataclasses import asdict

from studio.cli.deriving import Call, command_of
from studio.operations.subjects import subjects, together


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
