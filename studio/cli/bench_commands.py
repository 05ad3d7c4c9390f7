"""`studio bench`."""

import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from studio.cli.output import command, progress
from studio.foundations.progress import Progress
from studio.foundations.typed_decoding import is_table
from studio.garden.benchmarks.devices import run_device_benchmark
from studio.garden.benchmarks.first_frame import measure_starts
from studio.garden.benchmarks.hulls import run_hull_benchmark
from studio.garden.benchmarks.kernels import run_benchmark
from studio.garden.benchmarks.live import run_live_benchmark
from studio.garden.benchmarks.live_stages import in_words
from studio.garden.benchmarks.reannealing import measure_reannealing
from studio.garden.benchmarks.results_table import in_lines, remember, rows_of, this_machine
from studio.garden.benchmarks.whole_frames import DEFAULT, WORKLOADS, measure_frames
from studio.operations.jobs.control import StudioControl
from studio.runs.new_run import prepare_run
from studio.sessions.samples import install_sample
from studio.sessions.workspace import Workspace


def _kernels(report: Progress) -> dict[str, object]:
    return dict(run_benchmark(progress=report))


def _hulls(report: Progress) -> dict[str, object]:
    return {"hull": run_hull_benchmark(progress=report)}


def _gpu(report: Progress) -> dict[str, object]:
    return {"gpu": run_device_benchmark(progress=report)}


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


def _start(report: Progress) -> dict[str, object]:
    return {"start": measure_starts(report)}


def _live(report: Progress, minutes: float | None = None) -> dict[str, object]:
    return {"live": run_live_benchmark(report, minutes)}


FRAMES, LIVE = "frames", "live"
PARTS: dict[str, Callable[[Progress], dict[str, object]]] = {
    "kernels": _kernels,
    "gpu": _gpu,
    "hulls": _hulls,
    "slider": _slider,
    "start": _start,
    LIVE: _live,
}


@click.command("bench")
@click.option(
    "--only", type=click.Choice((*PARTS, FRAMES)), multiple=True, help="Measure this alone; may be repeated."
)
@click.option(
    "--workload",
    type=click.Choice(tuple(WORKLOADS)),
    multiple=True,
    help="Whole frames of this: the default tracker, the improved filter's or the swarm's search alone, or what the "
    "published benchmark computes; default: all.",
)
@click.option(
    "--trace",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the stages of whole frames, thread by thread, for a viewer of Chrome traces.",
)
@click.option(
    "--minutes",
    type=click.FloatRange(0.1, 600.0),
    help="Track live with the scene open for so many minutes, and measure nothing else.",
)
@command
def bench_command(
    only: tuple[str, ...], workload: tuple[str, ...], trace: Path | None, minutes: float | None
) -> dict[str, object]:
    """Measure kernels against bare memory loads, whole frames, hulls beside the paper's, a slider's answer, the demo's
    start, live tracking: a table beside what is aimed at, and every figure below it. Each call is added to a history.
    """
    if trace is not None and len(workload) != 1:
        workload = (DEFAULT,)
    # Who asks for a workload or a trace asks for whole frames.
    parts = only or ((FRAMES,) if workload else (*PARTS, FRAMES))
    if minutes is not None:
        parts = (LIVE,)
    result: dict[str, Any] = {}
    machine = this_machine()
    with progress("Measuring") as report:
        for name in parts:
            if name == LIVE:
                result |= _live(report, minutes)
                continue
            if name != FRAMES:
                result |= PARTS[name](report)
                continue
            result[FRAMES] = {}
            for kind in workload or tuple(WORKLOADS):
                times = measure_frames(kind, report)
                result[FRAMES][kind] = times.figures()
                if trace is not None:
                    times.trace.write(trace)
    rows = rows_of(result)
    place = remember(machine, rows)
    lines = [
        f"{machine.processor}, {machine.cores} cores, {machine.system}, Python {machine.python}, Numba "
        f"{machine.numba}; load {machine.load:g} before",
        *in_lines(rows),
        "",
    ]
    lines += [f"{key:24} {value}" for key, value in result.items() if key not in ("live", FRAMES)]
    for kind, figures in result.get(FRAMES, {}).items():
        lines.append(f"whole frames, {kind}: {figures['ms']} ms, {figures['evaluations']} evaluations")
        lines += [
            f"  {stage['thread']:12} {stage['stage']:20} {stage['busy_ms']:7.2f} ms busy {stage['ms']:7.2f} ms"
            for stage in figures["stages"]
        ]
    live = result.get("live")
    if is_table(live):
        lines.append(in_words(live))
    lines.append(f"Added to the history in {place}.")
    document = {"machine": dataclasses.asdict(machine), "rows": rows, **result, "history": str(place)}
    return {**document, "text": "\n".join(lines)}
