"""`studio evaluate`."""

from collections.abc import Mapping
from pathlib import Path

import click

from studio.capture.trc import read_trc
from studio.cli.output import command
from studio.errors import TruthError
from studio.evaluation.errors import evaluate
from studio.evaluation.report import as_document, in_words
from studio.runs.tracks import RAW, read_track
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
    stored = opened.run(run)
    path = truth or opened.truth_path
    if path is None:
        raise TruthError(f"Session '{opened.name}' has no truth.", "Give one with --truth FILE.trc.")
    chosen = read_track(stored, track)
    found = evaluate(chosen.poses, chosen.frames, stored.body(), read_trc(path), stored.record.fps)
    return {**as_document(found), "track": track, "text": in_words(found)}
