"""`studio check`."""

import click
import msgspec

from studio.cli.output import command, progress
from studio.runs.checking import EVERY, check_run
from studio.runs.tracks import BEST
from studio.sessions.workspace import Workspace


@click.command("check")
@click.argument("session")
@click.argument("run")
@click.option(
    "--track",
    default=BEST,
    show_default=True,
    metavar="NAME",
    help="Best: smoothed, else refined, else raw, as in an export.",
)
@click.option(
    "--every", type=click.IntRange(1), default=EVERY, show_default=True, help="Look at so-many-th frames."
)
@command
def check_command(session: str, run: str, track: str, every: int) -> dict[str, object]:
    """Tell how well a RUN fits its pictures: share in the masks, lost frames and limbs, sudden turns, jumps, jitter.

    What was measured is kept beside the run, and shown in the guided way's step Check.
    """
    opened = Workspace().resolve(session)
    with progress(f"{opened.name} / {run}") as report:
        stored = opened.run(run)
        found, damage = check_run(opened, stored, track, every, progress=report), stored.damage()
    told = msgspec.to_builtins(found)
    return {
        "session": opened.name,
        "run": run,
        "good": found.good and not damage,
        "damage": damage,
        "inside_mean": found.inside_mean,
        "poor": list(found.poor),
        **{name: value for name, value in told.items() if name not in ("schema", "stamp", "count")},
        "text": f"{opened.name} / {run}, track '{found.track}': {found.in_words()}. {damage}".rstrip(),
    }
