"""`studio correct`."""

from pathlib import Path

import click

from studio.cli.output import command, note, progress
from studio.errors import RunError
from studio.notebook.tracking import corrected_pose
from studio.progress import Progress
from studio.runs.correcting import prepare_correction, track_backwards
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace
from studio.worker.batch import track_to_end


@click.command()
@click.argument("session")
@click.argument("run")
@click.option("--at", "frame", type=int, required=True, metavar="K", help="The frame that is corrected.")
@click.option(
    "--pose", type=click.Path(path_type=Path), help="Its pose: a CSV row, or a TRC met by inverse kinematics."
)
@click.option("--from-track", default="", metavar="NAME", help="Take its pose from a track of the run.")
@click.option(
    "--back-to",
    type=int,
    metavar="J",
    help="Track backwards from K to J; all other frames stay. Default: forwards from K to the end.",
)
@click.option("--name", default="", help="Name of the corrected run; default: numbered.")
@command
def correct(
    session: str, run: str, frame: int, pose: Path | None, from_track: str, back_to: int | None, name: str
) -> dict[str, object]:
    """Give a RUN the right pose in one frame and track on from there, into a new run; the old one stays.

    Ctrl-C stops; what was tracked stays, and forwards 'studio track --resume' goes on with it.
    """
    opened = Workspace().resolve(session)
    old = opened.run(run)
    if (pose is None) == (not from_track):
        raise RunError("A corrected frame needs a pose.", "Give one with --pose FILE or --from-track NAME.")
    given, source = corrected_pose(old, frame, pose, from_track)
    corrected = prepare_correction(opened, old, frame, given, source=source, backwards_to=back_to, name=name)
    with progress(f"{opened.name} / {corrected.name}") as report:
        if back_to is None:
            track_to_end(opened, corrected, report)
            tracked = corrected.record.last - frame
        else:
            tracked = _backwards(opened, corrected, report)
    way = "on" if back_to is None else "backwards"
    text = f"{opened.name} / {corrected.name}: run '{run}' corrected in frame {frame}, {tracked} frames tracked {way}."
    return {
        "session": opened.name,
        "run": corrected.name,
        "made_from": run,
        "corrected": frame,
        "back_to": back_to,
        "frames": tracked,
        "text": text,
    }


def _backwards(session: Session, run: StoredRun, report: Progress) -> int:
    """Frames tracked; Ctrl-C keeps those that are done, and says how many."""
    done = [0]

    def told(step: str, count: int, total: int) -> None:
        done[0] = count
        report(step, count, total)

    try:
        return track_backwards(session, run, told)
    except KeyboardInterrupt:
        note(
            f"{session.name} / {run.name}: {done[0]} frames tracked backwards, the others are the old run's."
        )
        raise
