"""What there is and how it stands: `gallery`, `inspect`, `runs`, `workflow`; bodies: `bodies`, `edit-body`,
`body-from-film`, `carry-clicks`.
"""

from collections.abc import Sequence
from dataclasses import asdict

import click

from studio.cli.deriving import Call, command_of
from studio.cli.output import EXIT_CODE, FOUND_FAULTS, command
from studio.foundations.words import counted
from studio.operations.filmed_bodies import body_from_film, carry_clicks
from studio.operations.foreign import inspect
from studio.operations.gallery import Gallery, gallery
from studio.operations.opening import bodies, workflow
from studio.operations.own_bodies import EditedBody, edit_body
from studio.operations.remote import runs_there
from studio.runs.carried_clicks import CarriedClicks
from studio.runs.setup.body_from_film import FilmedBody
from studio.runs.setup.workflow import Workflow
from studio.sessions.foreign_sessions import Inspection
from studio.sessions.remote_sessions import RemoteSession

REPORTED = ("sizes", "limbs", "landmarks", "disagreeing")
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
    inspection: Inspection = call()
    lines = [f"{one.place}: {one.what}." for one in inspection.oddities]
    verdict = "nothing is odd" if not lines else counted(len(lines), "oddity", "oddities")
    lines.append(
        f"{inspection.kind}: {counted(inspection.files, 'file')}, {inspection.bytes / 1e6:.1f} MB; {verdict}."
    )
    return {
        EXIT_CODE: 0 if inspection.harmless else FOUND_FAULTS,
        "kind": inspection.kind,
        "files": inspection.files,
        "bytes": inspection.bytes,
        "oddities": [asdict(one) for one in inspection.oddities],
        "text": "\n".join(lines),
    }


@command_of(gallery)
def gallery_command(call: Call) -> dict[str, object]:
    listed: Gallery = call()
    cards: list[dict[str, object]] = [
        {
            "name": one.card.name,
            "title": one.card.title,
            "kind": one.card.kind,
            "there": one.there,
            "missing": one.missing,
            "data": one.card.data,
            "commands": list(one.card.commands),
            "left": list(one.card.left),
        }
        for one in listed.cards
    ]
    if listed.made is not None:
        return {
            "session": listed.made.name,
            "cards": cards,
            "notes": list(listed.notes),
            "text": f"Session '{listed.made.name}' is there.",
        }
    how = {"sample": "bundled", "recipe": "rendered", "elsewhere": "imported"}
    lines: list[str] = []
    for one in listed.cards:
        card = one.card
        state = "there" if one.there else (one.missing and "cannot be made") or how[card.kind]
        lines.append(f"{card.name:18} {state:14} {card.title}. {card.words}")
        lines += [f"{'':18} {'':14} {line}" for line in (card.data, *card.commands) if line and not one.there]
    return {"session": "", "cards": cards, "text": "\n".join(lines)}


@command_of(edit_body)
def edit_body_command(call: Call) -> dict[str, object]:
    edited: EditedBody = call()
    return {
        "body": edited.body.name,
        "title": edited.body.title,
        "dimensions": dict(edited.body.dimensions),
        "notes": list(edited.notes),
        "file": str(edited.file or ""),
        "text": f"Saved as '{edited.body.name}' ({edited.file})."
        if edited.file
        else edited.text.rstrip("\n"),
    }


@command_of(body_from_film)
def body_from_film_command(call: Call) -> dict[str, object]:
    made: FilmedBody = call()
    lines = [
        f"{one.name:28} {one.before:8.1f} → {one.after:7.1f} mm "
        + (f"± {one.deviation:.1f}" if one.decided else "  not decided by itself")
        for one in made.sizes
    ]
    lines += [""] if made.limbs else []
    lines += [
        f"{one.limb:28} {one.length:8.1f} mm, in {counted(one.count, 'frame')} {one.mean:.1f} ± {one.scatter:.1f}"
        for one in made.limbs
    ]
    lines += [
        "",
        f"Clicks are {made.off:.1f} pixels off (median; 90 %: {made.off_most:.1f}) where sizes were fitted.",
    ]
    if made.checked:
        lines.append(
            f"In {counted(len(made.checked), 'frame')} not used they are {made.checked_off:.1f} off"
            f" (90 %: {made.checked_off_most:.1f})."
        )
    lines.append(
        f"Saved as '{made.saved}' ({made.file}): look at it on the page Bodies."
        if made.saved
        else "Nothing was saved: give it a name with --as."
    )
    entries = {key: [asdict(one) for one in getattr(made, key)] for key in REPORTED}
    return {
        "session": call.given["session"].name,
        "body": made.saved,
        "file": str(made.file or ""),
        "frames": list(made.frames),
        "checked": list(made.checked),
        "off": made.off,
        "off_most": made.off_most,
        "checked_off": made.checked_off,
        "checked_off_most": made.checked_off_most,
        "notes": list(made.notes),
        "text": "\n".join(lines),
        **entries,
    }


@command_of(carry_clicks)
def carry_clicks_command(call: Call) -> dict[str, object]:
    made: CarriedClicks = call()
    return {
        "session": call.given["session"].name,
        "run": made.run.name,
        "frames": made.frames,
        "clicked": list(made.clicked),
        "off": made.off,
        "unclicked": list(made.unclicked),
        "notes": list(made.notes),
        "text": f"Run '{made.run.name}': {counted(made.frames, 'frame')}. Where they were clicked, landmarks lie"
        f" {made.off:.1f} pixels off (median).",
    }


@click.command("runs")
@click.argument("session", required=False)
@command
def runs_command(session: str | None) -> dict[str, object]:
    """List the runs of a session, or of all sessions in the workspace; at an address those of a store."""
    listed = runs_there(session)
    if listed.stored is not None:
        return _list_stored(listed.place, listed.stored)
    entries: list[dict[str, object]] = [
        {
            "session": run.session,
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
        for run in listed.runs
    ]
    lines = [
        f"{run.session:18} {run.name:12} {run.tracker:14} {run.weighting:14} "
        f"{run.done:>5} of {run.last - run.first} frames  {run.status}"
        + (f"  {run.damage}" if run.damage else "")
        for run in listed.runs
    ]
    return {"workspace": listed.place, "runs": entries, "text": "\n".join(lines) or "No runs yet."}


def _list_stored(address: str, sessions: Sequence[RemoteSession]) -> dict[str, object]:
    lines = [
        f"{one.name:18} {one.bytes / 1e6:10.1f} MB  {', '.join(one.runs) if one.whole else 'half written'}"
        for one in sessions
    ]
    return {
        "address": address,
        "sessions": [asdict(one) for one in sessions],
        "text": "\n".join(lines) or "No sessions there.",
    }


@command_of(workflow)
def workflow_command(call: Call) -> dict[str, object]:
    now: Workflow = call()
    lines = [
        f"{MARKS[step.state]} {step.step:12} {step.words}{f'  ({step.why})' if step.why else ''}"
        for step in now.steps
    ]
    next_step = f"Next: {now.next}." if now.next else "Nothing is left to do."
    steps = [asdict(step) for step in now.steps]
    return {"steps": steps, "next": now.next, "text": "\n".join((*lines, next_step))}
