"""`studio bench`."""

import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path

import click

from studio.benchmarks.hulls import run_hull_benchmark
from studio.benchmarks.kernels import run_benchmark
from studio.benchmarks.live import run_live_benchmark
from studio.benchmarks.live_stages import in_words
from studio.benchmarks.reannealing import measure_reannealing
from studio.cli.output import command, progress
from studio.progress import Progress
from studio.runs.new_run import prepare_run
from studio.sessions.workspace import Workspace
from studio.web.samples import install_sample
from studio.worker.control import StudioControl


def _kernels(report: Progress) -> dict[str, object]:
    return dict(run_benchmark(progress=report))


def _hulls(report: Progress) -> dict[str, object]:
    return {"hull": run_hull_benchmark(progress=report)}


def _slider(report: Progress) -> dict[str, object]:
    report("re-annealing", 0, 1)
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace(Path(folder))
        session = install_sample(workspace, "walk")
        control = StudioControl(workspace)
        try:
            latency = measure_reannealing(control, session, prepare_run(session, last=2))
        finally:
            control.close()
    report("re-annealing", 1, 1)
    return {"reannealing": dataclasses.asdict(latency)}


def _live(report: Progress) -> dict[str, object]:
    return {"live": run_live_benchmark(report)}


PARTS: dict[str, Callable[[Progress], dict[str, object]]] = {
    "kernels": _kernels,
    "hulls": _hulls,
    "slider": _slider,
    "live": _live,
}


@click.command()
@click.option(
    "--only", type=click.Choice(tuple(PARTS)), multiple=True, help="Measure this alone; may be repeated."
)
@command
def bench(only: tuple[str, ...]) -> dict[str, object]:
    """Measure kernels against bare memory loads, hulls beside the paper's, a slider's answer, live tracking."""
    told: dict[str, object] = {}
    with progress("Measuring") as report:
        for name in only or tuple(PARTS):
            told |= PARTS[name](report)
    lines = [f"{key:24} {value}" for key, value in told.items() if key != "live"]
    live = told.get("live")
    if isinstance(live, dict):
        lines.append(in_words(live))
    return {**told, "text": "\n".join(lines)}
