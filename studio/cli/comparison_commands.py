"""`studio compare`."""

from collections.abc import Mapping
from pathlib import Path

import click

from studio.cli.arguments import frame_range
from studio.cli.output import MemberChoice, command, note, progress
from studio.comparison.candidates import DEFAULT_LAYERS, LINEUPS, VARIANTS, Lineup, read_assignments
from studio.comparison.comparison_findings import document, table_text
from studio.comparison.folders import differences, new_comparison, place_of, unfinished_like
from studio.comparison.kept_comparison import RECORD_NAME, KeptComparison
from studio.comparison.plan import Plan, plan_comparison
from studio.errors import RunError, SessionError
from studio.runs.behaviour_models import needs_model
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace
from studio.tracking.catalogue import TRACKERS
from studio.weighting.catalogue import WEIGHTINGS
from studio.worker.comparison_run import done_before, run_comparison

LABELS = "\n".join(f"  {name}: {variant.help}" for name, variant in VARIANTS.items())
GROUPS = "\n".join(f"  {name}: {', '.join(members)}" for name, members in LINEUPS.items())
EPILOG = f"""\b
A tracker may take part several times, each with a label of your own and a change:
  --trackers annealed,annealed:few --set annealed:few.layers=4
--set NAME.KNOB=VALUE changes the one of that name (KNOB may be weighting), --set KNOB=VALUE all that have the knob.
\b
Labels that bring their knobs:
{LABELS}
\b
Names that stand for several:
{GROUPS}
"""


@click.command(epilog=EPILOG)
@click.argument("session")
@click.option(
    "--trackers",
    metavar="A,B,C",
    default=",".join(name for name in sorted(TRACKERS) if not needs_model(name, None)),
    show_default=True,
    help="Who is compared.",
)
@click.option(
    "--evaluations",
    type=click.IntRange(1),
    default=1000,
    show_default=True,
    help="Poses weighed a frame, by each.",
)
@click.option(
    "--seeds", type=click.IntRange(1), default=5, show_default=True, help="How many seeds each, from 0 on."
)
@click.option(
    "--weighting",
    type=MemberChoice(WEIGHTINGS),
    default=None,
    help="Of all; default: the session's own.",
)
@click.option(
    "--body", default="", metavar="NAME", help="Kinematic tree; the session's subject still scales it."
)
@click.option(
    "--behaviour",
    default="",
    metavar="MODEL",
    help="Behaviour model of those that need one, by name or file.",
)
@click.option("--frames", metavar="A:B", default=":", help="Half open, from 0; default: all.")
@click.option(
    "--layers",
    type=click.IntRange(1),
    default=DEFAULT_LAYERS,
    show_default=True,
    help="Of annealed trackers.",
)
@click.option(
    "--set",
    "assignments",
    multiple=True,
    metavar="NAME.KNOB=VALUE",
    help="Any knob of one of them; see below.",
)
@click.option("--name", default="", help="Name of the comparison; default: numbered.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder to keep it in, instead of the session's.",
)
@click.option("--processes", type=click.IntRange(1), help="Trials at once; default: one a core.")
@command
def compare(
    session: str,
    trackers: str,
    evaluations: int,
    seeds: int,
    weighting: str | None,
    body: str,
    behaviour: str,
    frames: str,
    layers: int,
    assignments: tuple[str, ...],
    name: str,
    out: Path | None,
    processes: int | None,
) -> Mapping[str, object]:
    """Compare trackers on a SESSION with a truth: same evidence, same number of evaluations a frame, same seeds.

    Prints a table and sign tests over frames and seeds; keeps each trial as soon as it is done (in the session, or in
    --out), so that after Ctrl-C the same command goes on. The studio shows what is kept in the session.
    """
    opened = Workspace().resolve(session)
    first, last = frame_range(frames)
    first = opened.start_pose_frame() if first is None else first
    names = tuple(one.strip() for one in trackers.split(",") if one.strip())
    lineup = Lineup(names, weighting or "", evaluations, layers, read_assignments(assignments))
    plan = plan_comparison(
        opened, lineup, range(seeds), first=first, last=last, body=body, behaviour=behaviour
    )
    kept = _kept(opened, plan, name, out)
    before = done_before(kept, plan)
    if before:
        note(f"{before} of {seeds * len(plan.entrants)} trials are there already.")
    with progress(f"{opened.name} / {kept.name}") as report:
        comparison = run_comparison(kept, opened, report, processes=processes)
    note(f"Kept in {kept.folder}")
    return {**document(comparison), "folder": str(kept.folder), "text": table_text(comparison)}


def _kept(session: Session, plan: Plan, name: str, out: Path | None) -> KeptComparison:
    """The folder to work in: one that asked for the same and is not finished, else a new one.

    Raises SessionError for a folder that holds something else, or cannot be written.
    """
    try:
        if out is None and not name:
            return unfinished_like(session, plan) or new_comparison(place_of(session), plan)
        folder = (out or place_of(session, name)).absolute()
        if (folder / RECORD_NAME).is_file():
            kept = KeptComparison(folder)
            other = differences(plan, kept.plan())
            if other:
                raise RunError(
                    f"'{folder}' holds a comparison with other {', '.join(other)}.",
                    "Choose another folder or name.",
                )
            return kept
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        return new_comparison(folder, plan)
    except PermissionError as error:
        raise SessionError(
            f"A comparison cannot be kept in '{error.filename}'.", "Choose another folder with --out."
        ) from None
