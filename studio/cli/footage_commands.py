"""`studio synchronise`."""

from pathlib import Path

import click

from studio.capture.synchrony import MOST_SECONDS, Synchrony, in_words
from studio.capture.timestamps import TimedOffsets
from studio.cli.arguments import OFFSET_OPTION, ROTATE_OPTION, camera_numbers
from studio.cli.output import command, note, progress
from studio.errors import FootageError
from studio.sessions.footage_changes import (
    FootageChange,
    change_footage,
    recorded_offsets,
    stale_runs,
    synchrony_of,
)
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@click.command()
@click.argument("session")
@OFFSET_OPTION
@ROTATE_OPTION
@click.option(
    "--timestamps",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="A recorder's times of the frames (timestamps.csv), instead of an estimate.",
)
@click.option(
    "--within",
    type=float,
    default=MOST_SECONDS,
    show_default=True,
    help="Largest offset that is looked for, seconds.",
)
@click.option("--apply", "applied", is_flag=True, help="Write what was estimated or read into the session.")
@command
def synchronise(
    session: str,
    offsets: tuple[str, ...],
    rotations: tuple[str, ...],
    timestamps: Path | None,
    within: float,
    applied: bool,
) -> dict[str, object]:
    """Tell by how many frames the cameras of a SESSION began apart.

    Without options, estimates it from what moves in the pictures and shows how far to trust it; nothing is changed
    unless --apply is given. --offset and --rotate are written at once.
    """
    opened = Workspace().resolve(session)
    by_hand, turns = camera_numbers(offsets, "--offset"), camera_numbers(rotations, "--rotate")
    if by_hand or turns:
        if applied or timestamps is not None:
            raise FootageError(
                "Offsets cannot be given by hand and estimated or read at once.",
                "Leave out --apply and --timestamps.",
            )
        return _told(opened, change_footage(opened, by_hand, turns))
    if timestamps is not None:
        return _recorded(opened, timestamps, applied)
    return _estimated(opened, within, applied)


def _estimated(session: Session, within: float, applied: bool) -> dict[str, object]:
    """Offsets by motion energy, applied only where they can be trusted and were asked for."""
    if not 0.0 < within <= 600.0:
        raise FootageError(f"--within {within:g} is no time to look in.", "Give seconds between 0 and 600.")
    with progress("Estimating") as report:
        found = synchrony_of(session, report, within)
    said = in_words(found)
    if not applied:
        note("Nothing was changed; write it with --apply, or by hand with --offset CAMERA=FRAMES.")
        return {**_answer(session), "estimate": _values(found), "text": said}
    if not found.sure:
        note(said)
        raise FootageError(
            "The estimate is not reliable enough to be applied.",
            "Give the offsets by hand with --offset CAMERA=FRAMES.",
        )
    told = _told(session, change_footage(session, found.offsets))
    return {**told, "estimate": _values(found), "text": f"{said}\n{told['text']}"}


def _recorded(session: Session, path: Path, applied: bool) -> dict[str, object]:
    """Offsets by recorded times."""
    found: TimedOffsets = recorded_offsets(session, path)
    lines = [f"{name}: {offset:+d} frames" for name, offset in found.offsets.items()]
    said = "\n".join(
        [*lines, f"At most {found.apart:.2f} frames apart at {found.fps:.2f} frames a second.", *found.notes]
    )
    if not applied:
        note("Nothing was changed; write it with --apply.")
        return {
            **_answer(session),
            "recorded": {"offsets": found.offsets, "apart": found.apart},
            "text": said,
        }
    told = _told(session, change_footage(session, found.offsets))
    return {**told, "text": f"{said}\n{told['text']}"}


def _told(session: Session, change: FootageChange) -> dict[str, object]:
    lines = [f"{camera.name}: {camera.offset}" for camera in change.session.manifest.footage.cameras]
    return {
        **_answer(change.session),
        "notes": list(change.notes),
        "text": "\n".join(
            [f"Session {session.name}, first frames of each file: {', '.join(lines)}", *change.notes]
        ),
    }


def _answer(session: Session) -> dict[str, object]:
    """The session's offsets and turns as they are."""
    footage = session.manifest.footage
    return {
        "frames": footage.frame_count,
        "offsets": {camera.name: camera.offset for camera in footage.cameras},
        "rotations": {camera.name: camera.turned for camera in footage.cameras},
        "stale_runs": list(stale_runs(session)),
    }


def _values(found: Synchrony) -> dict[str, object]:
    return {
        "offsets": found.offsets,
        "confidence": found.confidence,
        "within": found.within,
        "sure": found.sure,
        "notes": list(found.notes),
    }
