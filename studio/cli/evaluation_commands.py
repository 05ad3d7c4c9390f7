"""`studio evaluate`."""

from collections.abc import Mapping
from pathlib import Path

import click

from studio.cli.output import command
from studio.evaluation.report import as_document, in_words
from studio.notebook.results import evaluate
from studio.runs.tracks import RAW
from studio.sessions.workspace import Workspace


@click.command("evaluate")
@click.argument("session")
@click.argument("run")
@click.option("--truth", type=click.Path(path_type=Path), help="TRC file; default: the session's own truth.")
@click.option("--track", default=RAW, show_default=True, help="Which of the run's tracks: raw, refined, …")
@command
def evaluate_command(session: str, run: str, truth: Path | None, track: str) -> Mapping[str, object]:
    """Measure a RUN against the true markers: mm without alignment, root-aligned, after Procrustes."""
    opened = Workspace().resolve(session)
    found = evaluate(opened.run(run), truth=truth, track=track)
    return {**as_document(found), "track": track, "text": in_words(found)}
