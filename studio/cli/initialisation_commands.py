"""`studio initialise`."""

import click

from studio.cli.output import MemberChoice, command, note, notes_once, progress
from studio.runs.initialising import WEIGHTING, InitialPose, initialise, keep_pose
from studio.runs.new_run import checked_frames
from studio.sessions.workspace import Workspace
from studio.weighting.catalogue import WEIGHTINGS

UNSURE = 0.75


@click.command(name="initialise")
@click.argument("session")
@click.option("--frame", type=int, default=0, show_default=True, help="Where the start pose is sought.")
@click.option("--body", default="", metavar="NAME", help="Kinematic tree; default: the session's.")
@click.option("--behaviour", default="", metavar="MODEL", help="Its prototypes are poses to try.")
@click.option(
    "--weighting",
    type=MemberChoice(WEIGHTINGS),
    default=WEIGHTING,
    show_default=True,
    help="What tells poses apart.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="The same seed finds the same pose.")
@click.option(
    "--replace", is_flag=True, help="Make it the session's start pose; the old one stays beside it."
)
@command
def initialise_command(
    session: str, frame: int, body: str, behaviour: str, weighting: str, seed: int, replace: bool
) -> dict[str, object]:
    """Find the pose in a frame of SESSION with nothing given but the body's dimensions, and write it down.

    It becomes the session's start pose if that has none, else a file beside it that 'studio track --start-pose'
    takes.
    """
    opened = Workspace().resolve(session)
    checked_frames(opened, frame, frame + 1)
    tree, notes = opened.body_with_notes(body or None)
    notes_once(opened.path, notes)
    with progress(f"{opened.name}: frame {frame}") as report:
        found = initialise(
            opened,
            frame,
            body=tree,
            behaviour=behaviour,
            weighting=weighting,
            seed=seed,
            progress=report,
        )
    place = keep_pose(opened, found, replace)
    if found.note:
        note(found.note)
    return {**_told(found), "session": opened.name, "file": str(place), "text": _in_words(found, place.name)}


def _told(found: InitialPose) -> dict[str, object]:
    """What `--json` prints of a pose."""
    return {
        "frame": found.frame,
        "body": found.body,
        "confidence": round(found.confidence, 4),
        "margin": found.margin,
        "agreement": round(found.agreement, 4),
        "overlap": round(found.overlap, 4),
        "hull_litres": round(found.hull_litres, 2),
        "evaluations": found.evaluations,
        "note": found.note,
        "pose": {name: float(value) for name, value in zip(found.names, found.pose, strict=True)},
    }


def _in_words(found: InitialPose, file: str) -> str:
    sure = f"confidence {100.0 * found.confidence:.0f} %"
    if found.confidence < UNSURE:
        sure += ", look at it before you track: it may face the other way"
    return f"Pose of {found.body} in frame {found.frame} written to {file} ({sure})."
