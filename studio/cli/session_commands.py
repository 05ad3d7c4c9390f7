"""What there is and how it stands: `bodies`, `runs`, `way`."""

from dataclasses import asdict

import click

from studio.cli.deriving import Call, command_of
from studio.cli.output import command
from studio.operations.opening import bodies, way
from studio.runs.way import Way
from studio.sessions.stored_run import damage_in_words
from studio.sessions.workspace import Workspace

MARKS = {"done": "✓", "ready": "·", "blocked": " ", "stale": "!", "running": "…"}


@command_of(bodies)
def bodies_command(call: Call) -> dict[str, object]:
    entries: list[dict[str, object]] = [
        {
            "name": body.name,
            "title": body.title,
            "parameters": len(body.parameters),
            "limbs": len(body.drawn),
            "markers": [marker.name for marker in body.markers],
        }
        for body in call()
    ]
    lines = [
        f"{entry['name']:18} {entry['parameters']:>3} parameters {entry['limbs']:>3} limbs   {entry['title']}"
        for entry in entries
    ]
    return {"bodies": entries, "text": "\n".join(lines)}


@click.command("runs")
@click.argument("session", required=False)
@command
def runs_command(session: str | None) -> dict[str, object]:
    """List the runs of a session, or of all sessions in the workspace."""
    workspace = Workspace()
    if session:
        opened = workspace.resolve(session)
        found = [(opened.name, run.summary()) for run in opened.runs()]
    else:
        found = [(entry.name, run) for entry in workspace.sessions() for run in entry.runs]
    entries: list[dict[str, object]] = [
        {
            "session": name,
            "run": run.name,
            "tracker": run.tracker,
            "weighting": run.weighting,
            "body": run.body,
            "seed": run.seed,
            "frames": [run.first, run.last],
            "done": run.done,
            "status": run.status,
            "damaged": list(run.damaged),
        }
        for name, run in found
    ]
    lines = [
        f"{entry['session']:18} {entry['run']:12} {entry['tracker']:14} {entry['weighting']:14} "
        f"{entry['done']:>5} of {run.last - run.first} frames  {entry['status']}"
        + (f"  {damage_in_words(run.damaged)}" if run.damaged else "")
        for entry, (_, run) in zip(entries, found, strict=True)
    ]
    return {"workspace": str(workspace.root), "runs": entries, "text": "\n".join(lines) or "No runs yet."}


@command_of(way)
def way_command(call: Call) -> dict[str, object]:
    found: Way = call()
    lines = [
        f"{MARKS[step.state]} {step.step:12} {step.words}{f'  ({step.why})' if step.why else ''}"
        for step in found.steps
    ]
    said = f"Next: {found.next}." if found.next else "Nothing is left to be done."
    steps = [asdict(step) for step in found.steps]
    return {"steps": steps, "next": found.next, "text": "\n".join((*lines, said))}
