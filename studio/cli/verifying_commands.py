"""`studio verify`."""

from dataclasses import asdict

import click

from studio.cli.output import EXIT_CODE, FOUND_FAULTS, command, note, progress
from studio.runs.verifying import Repair, Verification, repair, verify
from studio.runs.way_step import counted
from studio.sessions.workspace import Workspace


@click.command("verify")
@click.argument("session")
@click.option(
    "--repair",
    "mend",
    is_flag=True,
    help="Track damaged frames again, bit for bit where nothing else has changed.",
)
@command
def verify_command(session: str, mend: bool) -> dict[str, object]:
    """Compare all that a SESSION stores with its checksums, and name what is damaged.

    Ends with 1 where something is damaged and was not repaired.
    """
    opened = Workspace().resolve(session)
    repaired: tuple[Repair, ...] = ()
    with progress(f"{opened.name}: verifying") as report:
        found = verify(opened, report)
        if mend and any(fault.run for fault in found.faults):
            repaired = repair(opened, found.faults, report)
            found = verify(opened, report)
    for fault in found.faults:
        note(f"damaged: {fault.place}: {fault.what}. {fault.remedy}")
    return {
        EXIT_CODE: FOUND_FAULTS if found.faults else 0,
        "session": opened.name,
        **{name: value for name, value in asdict(found).items() if name != "faults"},
        "faults": [asdict(fault) for fault in found.faults],
        "repaired": [asdict(entry) for entry in repaired],
        "text": "\n".join([_in_words(found), *map(_repair_in_words, repaired)]),
    }


def _in_words(found: Verification) -> str:
    parts = [f"{counted(found.files, 'file')} and {counted(found.frames, 'frame')} read"]
    parts.append(f"{len(found.faults)} damaged" if found.faults else "all as written")
    if found.unchecked:
        parts.append(f"{counted(found.unchecked, 'frame')} from before there were checksums")
    if found.written_again:
        parts.append(f"{counted(len(found.written_again), 'file')} written again since the last time")
    if found.new:
        parts.append(f"{counted(found.new, 'file')} noted for the first time")
    return f"{', '.join(parts)}."


def _repair_in_words(entry: Repair) -> str:
    if entry.problem:
        return f"{entry.run}: not repaired. {entry.problem}"
    same = (
        f"; {entry.same} of {entry.compared} stored poses are the same bit for bit" if entry.compared else ""
    )
    return f"{entry.run}: {counted(len(entry.frames), 'frame')} tracked again{same}."
