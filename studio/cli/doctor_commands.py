"""`studio doctor`."""

from dataclasses import asdict

import click

from studio.cli.output import EXIT_CODE, FOUND_FAULTS, command
from studio.notebook.doctor import doctor


@click.command("doctor")
@command
def doctor_command() -> dict[str, object]:
    """Try all that the studio stands on, and say what to do where something fails; ends with 1 then."""
    found = doctor()
    lines = [f"{'ok   ' if one.good else 'FAULT'} {one.name:18} {one.found}" for one in found]
    lines += [f"remedy for {one.name}: {one.remedy}" for one in found if not one.good]
    return {
        EXIT_CODE: 0 if all(one.good for one in found) else FOUND_FAULTS,
        "checks": [asdict(one) for one in found],
        "text": "\n".join(lines),
    }
