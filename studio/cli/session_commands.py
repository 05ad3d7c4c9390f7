"""What there is and how it stands: `gallery`, `bodies`, `edit-body`, `inspect`, `runs`, `workflow`."""

from dataclasses import asdict

import click

from studio.cli.deriving import Call, command_of
from studio.cli.output import EXIT_CODE, FOUND_FAULTS, command
from studio.foundations.words import counted
from studio.operations.foreign import inspect
from studio.operations.gallery import Gallery, gallery
from studio.operations.opening import bodies, workflow
from studio.operations.own_bodies import EditedBody, edit_body
from studio.runs.setup.workflow import Workflow
from studio.sessions.foreign_sessions import Inspection
from studio.sessions.object_stores import is_address
from studio.sessions.remote_sessions import sessions_at
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


@command_of(inspect)
def inspect_command(call: Call) -> dict[str, object]:
    found: Inspection = call()
    lines = [f"{one.place}: {one.what}." for one in found.oddities]
    said = "nothing is odd" if not lines else counted(len(lines), "oddity", "oddities")
    lines.append(f"{found.kind}: {counted(found.files, 'file')}, {found.bytes / 1e6:.1f} MB; {said}.")
    return {
        EXIT_CODE: 0 if found.harmless else FOUND_FAULTS,
        "kind": found.kind,
        "files": found.files,
        "bytes": found.bytes,
        "oddities": [asdict(one) for one in found.oddities],
        "text": "\n".join(lines),
    }


@command_of(gallery)
def gallery_command(call: Call) -> dict[str, object]:
    found: Gallery = call()
    cards: list[dict[str, object]] = [
        {
            "name": one.card.name,
            "title": one.card.title,
            "kind": one.card.kind,
            "there": one.there,
            "missing": one.missing,
            "data": one.card.data,
            "commands": list(one.card.commands),
        }
        for one in found.cards
    ]
    if found.made is not None:
        return {"session": found.made.name, "cards": cards, "text": f"Session '{found.made.name}' is there."}
    how = {"sample": "bundled", "recipe": "rendered", "elsewhere": "imported"}
    lines: list[str] = []
    for one in found.cards:
        card = one.card
        state = "there" if one.there else (one.missing and "data missing") or how[card.kind]
        lines.append(f"{card.name:18} {state:14} {card.title}. {card.words}")
        lines += [f"{'':18} {'':14} {line}" for line in (card.data, *card.commands) if line and not one.there]
    return {"session": "", "cards": cards, "text": "\n".join(lines)}


@command_of(edit_body)
def edit_body_command(call: Call) -> dict[str, object]:
    found: EditedBody = call()
    return {
        "body": found.body.name,
        "title": found.body.title,
        "dimensions": dict(found.body.dimensions),
        "notes": list(found.notes),
        "file": str(found.file or ""),
        "text": f"Saved as '{found.body.name}' ({found.file})." if found.file else found.text.rstrip("\n"),
    }


@click.command("runs")
@click.argument("session", required=False)
@command
def runs_command(session: str | None) -> dict[str, object]:
    """List the runs of a session, or of all sessions in the workspace; at an address those of a store."""
    if session and is_address(session):
        return _runs_at(session)
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


def _runs_at(address: str) -> dict[str, object]:
    found = sessions_at(address)
    lines = [
        f"{one.name:18} {one.bytes / 1e6:10.1f} MB  {', '.join(one.runs) if one.whole else 'half written'}"
        for one in found
    ]
    return {
        "address": address,
        "sessions": [asdict(one) for one in found],
        "text": "\n".join(lines) or "No sessions there.",
    }


@command_of(workflow)
def workflow_command(call: Call) -> dict[str, object]:
    found: Workflow = call()
    lines = [
        f"{MARKS[step.state]} {step.step:12} {step.words}{f'  ({step.why})' if step.why else ''}"
        for step in found.steps
    ]
    said = f"Next: {found.next}." if found.next else "Nothing is left to be done."
    steps = [asdict(step) for step in found.steps]
    return {"steps": steps, "next": found.next, "text": "\n".join((*lines, said))}
