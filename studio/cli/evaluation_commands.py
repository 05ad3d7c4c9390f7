"""`studio evaluate` and `bench`."""

import dataclasses
import tempfile
from collections.abc import Mapping
from pathlib import Path

import click

from studio.capture.trc import read_trc
from studio.cli.output import command, progress
from studio.errors import TruthError
from studio.evaluation.errors import evaluate
from studio.evaluation.report import as_document, in_words
from studio.experiments.benchmark import run_benchmark
from studio.experiments.hull_benchmark import run_hull_benchmark
from studio.runs.new_run import RunRequest, prepare_run
from studio.runs.tracks import RAW, read_track
from studio.sessions.workspace import Workspace
from studio.web.samples import install_sample
from studio.worker.control import StudioControl
from studio.worker.latency import measure_reannealing


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


@click.command()
@command
def bench() -> dict[str, object]:
    """Measure the kernels against bare memory loads in the same run, hulls beside the paper's, a slider's answer."""
    with progress("Measuring") as report:
        told = dict(run_benchmark(progress=report))
        told["hull"] = run_hull_benchmark(progress=report)
        report("re-annealing", 0, 1)
        with tempfile.TemporaryDirectory() as folder:
            workspace = Workspace(Path(folder))
            session = install_sample(workspace, "walk")
            control = StudioControl(workspace)
            try:
                latency = measure_reannealing(control, session, prepare_run(session, RunRequest(last=2)))
            finally:
                control.close()
        report("re-annealing", 1, 1)
    return {**told, "reannealing": dataclasses.asdict(latency)}
