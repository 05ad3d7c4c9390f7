"""`studio evaluate` and `bench`."""

from collections.abc import Mapping
from pathlib import Path

import click
import numpy as np

from studio.capture.trc import read_trc
from studio.cli.output import command, progress
from studio.errors import TruthError
from studio.evaluation.errors import evaluate
from studio.evaluation.report import as_document, in_words
from studio.experiments.benchmark import run_benchmark
from studio.sessions.workspace import Workspace


@click.command("evaluate")
@click.argument("session")
@click.argument("run")
@click.option("--truth", type=click.Path(path_type=Path), help="TRC file; default: the session's own truth.")
@command
def evaluate_command(session: str, run: str, truth: Path | None) -> Mapping[str, object]:
    """Measure a RUN against the true markers: mm without alignment, root-aligned, after Procrustes."""
    opened = Workspace().resolve(session)
    stored = opened.run(run)
    path = truth or opened.truth_path
    if path is None:
        raise TruthError(f"Session '{opened.name}' has no truth.", "Give one with --truth FILE.trc.")
    reader = stored.results()
    try:
        frames, poses = reader.poses()
    finally:
        reader.close()
    found = evaluate(np.asarray(poses), frames, stored.body(), read_trc(path), stored.record.fps)
    return {**as_document(found), "text": in_words(found)}


@click.command()
@command
def bench() -> dict[str, object]:
    """Measure the weighting kernels against the speed of bare memory loads, in the same run."""
    with progress("Measuring") as report:
        return dict(run_benchmark(progress=report))
