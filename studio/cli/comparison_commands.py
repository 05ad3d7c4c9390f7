"""Trackers compared, knobs swept: `compare`, `sweep`."""

from collections.abc import Mapping

import click

from studio.cli.deriving import Call, command_of
from studio.cli.reading import frame_range, read_assignments, read_grid
from studio.operations.comparing import USUAL, Compared, SweptGrid, compare, sweep
from studio.results.comparison.candidates import LINEUPS, VARIANTS

LABELS = "\n".join(f"  {name}: {variant.help}" for name, variant in VARIANTS.items())
GROUPS = "\n".join(f"  {name}: {', '.join(members)}" for name, members in LINEUPS.items())
EPILOG = f"""\b
A tracker may take part several times, each with a label of your own and a change:
  --trackers annealed,annealed:few --set annealed:few.layers=4
--set NAME.KNOB=VALUE changes the one of that name (KNOB may be weighting or body),
--set KNOB=VALUE all that have the knob.
\b
Labels that bring their knobs:
{LABELS}
\b
Names that stand for several:
{GROUPS}
"""
TRACKERS = click.option(
    "--trackers", metavar="A,B,C", default=",".join(USUAL), show_default=True, help="The trackers to compare."
)
FRAMES = click.option("--frames", metavar="A:B", default=":", help="Half open, from 0; default: all.")
SET = click.option(
    "--set",
    "assignments",
    multiple=True,
    metavar="NAME.KNOB=VALUE",
    help="Any knob of one of them; see below.",
)


@command_of(compare, TRACKERS, FRAMES, SET, without=("trackers", "first", "last", "changes"), epilog=EPILOG)
def compare_command(
    call: Call, trackers: str, frames: str, assignments: tuple[str, ...]
) -> Mapping[str, object]:
    first, last = frame_range(frames)
    names = [one.strip() for one in trackers.split(",") if one.strip()]
    done: Compared = call(trackers=names, first=first, last=last, changes=read_assignments(assignments))
    return {**done.document, "folder": str(done.kept.folder), "text": done.in_words}


VARY = click.option(
    "--vary",
    "grid",
    multiple=True,
    required=True,
    metavar="KNOB=A,B,…",
    help="A knob and its values; again for more knobs, whose combinations are tracked.",
)


@command_of(sweep, VARY, FRAMES, without=("vary", "first", "last"))
def sweep_command(call: Call, grid: tuple[str, ...], frames: str) -> Mapping[str, object]:
    first, last = frame_range(frames)
    done: SweptGrid = call(vary=read_grid(grid), first=first, last=last)
    return {**done.document, "folder": str(done.kept.folder), "text": done.in_words}
