"""`studio evaluate`."""

from collections.abc import Mapping
from pathlib import Path

import click

from studio.cli.output import command, note
from studio.evaluation.report import as_document, in_words
from studio.notebook.results import evaluate
from studio.runs.tracks import BEST, best_track
from studio.sessions.workspace import Workspace


@click.command("evaluate")
@click.argument("session")
@click.argument("run")
@click.option("--truth", type=click.Path(path_type=Path), help="TRC file; default: the session's own truth.")
@click.option(
    "--track",
    default=BEST,
    show_default=True,
    help="Best: smoothed, else refined, else raw; or any track's name.",
)
@command
def evaluate_command(session: str, run: str, truth: Path | None, track: str) -> Mapping[str, object]:
    """Measure a RUN against the true markers: mm without alignment, root-aligned, after Procrustes."""
    stored = Workspace().resolve(session).run(run)
    if track == BEST:
        best = best_track(stored)
        track = best.name
        if best.note:
            note(best.note)
    found = evaluate(stored, truth=truth, track=track)
    text = f"track                {track}\n{in_words(found)}"
    return {**as_document(found), "track": track, "text": text}
