"""What becomes of a run: `refine`, `smooth`, `check`, `evaluate`, `export`, `share`, `verify`; the guide's
`course`.
"""

from collections.abc import Mapping
from dataclasses import asdict

import msgspec

from studio.cli.deriving import Call, command_of
from studio.cli.output import EXIT_CODE, FOUND_FAULTS
from studio.foundations.words import counted
from studio.operations.course import Course, course
from studio.operations.results import Verified, check, evaluate, export_run, refine, smooth, verify
from studio.operations.sharing import Shared, share
from studio.results.evaluation.report import as_document, in_words
from studio.results.export.formats import FORMATS
from studio.results.verifying import Repair, Verification
from studio.runs.refining import MadeTrack
from studio.runs.tracks import track_named
from studio.sessions.stored_run import StoredRun


@command_of(refine)
def refine_command(call: Call) -> dict[str, object]:
    made: MadeTrack = call()
    agreement = {"agreement_before": made.agreement_before, "agreement_after": made.agreement_after}
    words = (
        f"{made.moved} of {len(made.track.frames)} frames moved; the silhouettes agree by"
        f" {made.agreement_before:.3f} before, {made.agreement_after:.3f} after."
    )
    return _describe_track(call, made, {"moved": made.moved, **agreement}, words)


@command_of(smooth)
def smooth_command(call: Call) -> dict[str, object]:
    made: MadeTrack = call()
    words = (
        f"second difference of the markers {made.jitter_before:.1f} -> {made.jitter_after:.1f} mm RMS,"
        f" {len(made.filled)} frames filled, {len(made.left_out)} left out."
    )
    return _describe_track(call, made, {"filled": list(made.filled), "left_out": list(made.left_out)}, words)


def _describe_track(call: Call, made: MadeTrack, more: dict[str, object], words: str) -> dict[str, object]:
    run = call.given["run"]
    source = made.track.made_by["from"]
    return {
        "session": run.session_name,
        "run": run.name,
        "track": made.track.name,
        "frames": len(made.track.frames),
        "made_by": dict(made.track.made_by),
        "jitter_before_mm": made.jitter_before,
        "jitter_after_mm": made.jitter_after,
        **more,
        "text": f"{run.session_name} / {run.name}: track '{made.track.name}' made from '{source}', {words}",
    }


@command_of(check)
def check_command(call: Call) -> dict[str, object]:
    run, checked = call.given["run"], call()
    damage, result = run.damage(), msgspec.to_builtins(checked)
    return {
        "session": run.session_name,
        "run": run.name,
        "good": checked.good and not damage,
        "damage": damage,
        "inside_mean": checked.inside_mean,
        "poor": list(checked.poor),
        **{name: value for name, value in result.items() if name not in ("schema", "stamp", "count")},
        "text": f"{run.session_name} / {run.name}, track '{checked.track}': {checked.in_words()}. {damage}".rstrip(),
    }


@command_of(evaluate)
def evaluate_command(call: Call) -> Mapping[str, object]:
    track = track_named(call.given["run"], call.given["track"])
    evaluation = call()
    return {
        **as_document(evaluation),
        "track": track,
        "text": f"track                {track}\n{in_words(evaluation)}",
    }


@command_of(
    export_run,
    name="export",
    epilog="Formats: " + "  ".join(f".{form.name} {form.title};" for form in FORMATS.values()),
)
def export_command(call: Call) -> dict[str, object]:
    run, done = call.given["run"], call()
    names = ", ".join(str(path) for path in done.files)
    of_track = f"track '{done.track}', " if done.track else ""
    return {
        "session": run.session_name,
        "run": run.name,
        "format": done.format,
        "track": done.track,
        "files": [str(path) for path in done.files],
        "bytes": done.size,
        "frames": done.frames,
        "fps": done.fps,
        "checked": done.checked,
        "notes": list(done.notes),
        "text": f"{names} ({done.size / 1e6:.2f} MB): {of_track}{done.checked}.",
    }


@command_of(share)
def share_command(call: Call) -> dict[str, object]:
    run: StoredRun = call.given["run"]
    shared: Shared = call()
    words = f"{shared.path} ({shared.size / 1e6:.2f} MB): looks into frame {shared.frame}."
    return {
        "session": run.session_name,
        "run": run.name,
        "file": str(shared.path),
        "bytes": shared.size,
        "frame": shared.frame,
        "text": words,
    }


@command_of(verify)
def verify_command(call: Call) -> dict[str, object]:
    done: Verified = call()
    verification = done.verification
    return {
        EXIT_CODE: FOUND_FAULTS if verification.faults else 0,
        "session": call.given["session"].name,
        **{name: value for name, value in asdict(verification).items() if name != "faults"},
        "faults": [asdict(fault) for fault in verification.faults],
        "repaired": [asdict(entry) for entry in done.repaired],
        "text": "\n".join([_verified(verification), *map(_repaired, done.repaired)]),
    }


def _verified(verification: Verification) -> str:
    parts = [f"{counted(verification.files, 'file')} and {counted(verification.frames, 'frame')} read"]
    parts.append(f"{len(verification.faults)} damaged" if verification.faults else "all as written")
    if verification.unchecked:
        parts.append(f"{counted(verification.unchecked, 'frame')} from before there were checksums")
    if verification.written_again:
        parts.append(f"{counted(len(verification.written_again), 'file')} written again since the last time")
    if verification.new:
        parts.append(f"{counted(verification.new, 'file')} noted for the first time")
    if verification.left:
        parts.append(f"{counted(len(verification.left), 'unfinished part')} left behind")
    return f"{', '.join(parts)}."


def _repaired(entry: Repair) -> str:
    if entry.problem:
        return f"{entry.run}: not repaired. {entry.problem}"
    same = (
        f"; {entry.same} of {entry.compared} stored poses are the same bit for bit" if entry.compared else ""
    )
    return f"{entry.run}: {counted(len(entry.frames), 'frame')} tracked again{same}."


@command_of(course)
def course_command(call: Call) -> dict[str, object]:
    done: Course = call()
    names = [run.name for run in done.runs]
    words = f"{done.session.name}: {', '.join(names)} are there. Read on at /guide/course of 'studio serve'."
    return {"session": done.session.name, "runs": names, "text": words}
