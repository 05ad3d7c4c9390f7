"""`doctor` and `diagnostics`, which load all of the studio; no other command waits for that."""

from dataclasses import asdict

from studio.cli.deriving import Call, command_of
from studio.cli.diagnostics_archive import diagnostics
from studio.cli.output import EXIT_CODE, FOUND_FAULTS
from studio.cli.self_check import doctor


@command_of(doctor)
def doctor_command(call: Call) -> dict[str, object]:
    checks = call()
    lines = [f"{'ok   ' if one.good else 'FAULT'} {one.name:18} {one.found}" for one in checks]
    lines += [f"remedy for {one.name}: {one.remedy}" for one in checks if not one.good]
    return {
        EXIT_CODE: 0 if all(one.good for one in checks) else FOUND_FAULTS,
        "checks": [asdict(one) for one in checks],
        "text": "\n".join(lines),
    }


@command_of(diagnostics)
def diagnostics_command(call: Call) -> dict[str, object]:
    place, parts = call()
    return {
        "archive": str(place),
        "parts": list(parts),
        "text": f"{place}: {', '.join(parts)}. Look through it before you send it.",
    }
