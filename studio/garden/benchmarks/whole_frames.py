"""Whole frames from recorded video: decoding, masks, maps, search, refinement, verdict and store, as a run does them.

The bundled walk, four 640 × 480 videos. `DEFAULT` is the default tracker with its 1000 evaluations. `IMPROVED` and
`SWARM` are the papers' searches alone, nothing refined: the improved filter's 10 layers of 200 particles weighed by
edges and region, and 1000 evaluations of the swarm weighed by its own fitness. `BODYTRACK` is what
the benchmark published with the Lee-walk data computes for a frame: its likelihood, 5 layers of 1000 particles, its
edge maps, nothing refined. Every stage on every thread is recorded (`tracing`), so that a trace shows who waits
for whom.
"""

import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studio.foundations.progress import Progress
from studio.foundations.tracing import Trace, recorded
from studio.operations.jobs.open_run import OpenRun
from studio.runs.new_run import prepare_run
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.samples import install_sample
from studio.sessions.workspace import Workspace

DEFAULT, IMPROVED, SWARM, BODYTRACK = "default", "improved", "swarm", "bodytrack"
WORKLOADS: Mapping[str, Mapping[str, Any]] = {
    DEFAULT: {},
    IMPROVED: {
        "tracker": "annealed",
        "weighting": "edge-region",
        "knobs": {"layers": 10, "particles": 200, "refine_frames": False},
    },
    SWARM: {
        "tracker": "swarm",
        "weighting": "edge-silhouette",
        "knobs": {**TRACKERS["swarm"].evaluation_knobs(1000, 0), "refine_frames": False},
    },
    BODYTRACK: {
        "tracker": "annealed",
        "weighting": "bodytrack",
        "knobs": {"layers": 5, "particles": 1000, "refine_frames": False},
    },
}
"""What `prepare_run` is given."""
UNCOUNTED, FRAMES = 3, 60
"""Frames that warm up (the first is searched several times), and that are measured after them."""


@dataclass(frozen=True, slots=True)
class FrameTimes:
    """evaluations : of a frame. wall : seconds of each frame, from one result to the next. trace : of all of them."""

    evaluations: int
    wall: tuple[float, ...]
    trace: Trace

    def figures(self) -> dict[str, object]:
        """Milliseconds a frame: of the wall clock, and of processor time by thread and stage."""
        count = len(self.wall)
        busy: dict[tuple[str, str], float] = defaultdict(float)
        wall: dict[tuple[str, str], float] = defaultdict(float)
        for span in self.trace.spans:
            # Threads of a pool are one kind.
            thread = self.trace.threads[span.thread].split("_")[0]
            busy[thread, span.name] += 1e3 * span.busy / count
            wall[thread, span.name] += 1e3 * span.wall / count
        return {
            "evaluations": self.evaluations,
            "frames": count,
            "ms": round(1e3 * statistics.median(self.wall), 2),
            "quickest_ms": round(1e3 * min(self.wall), 2),
            "refinement_ms": round(busy.get(("MainThread", "refine"), 0.0), 2),
            "stages": [
                {
                    "thread": thread,
                    "stage": stage,
                    "busy_ms": round(busy[thread, stage], 2),
                    "ms": round(wall[thread, stage], 2),
                }
                for thread, stage in sorted(busy)
            ],
        }


def measure_frames(workload: str, progress: Progress, frames: int = FRAMES) -> FrameTimes:
    """Track the bundled walk with one of the WORKLOADS in a workspace of its own; returns the times of `frames` frames.

    progress : called with (step, done, total).
    """
    with tempfile.TemporaryDirectory(prefix="studio-bench-") as folder:
        session = install_sample(Workspace(Path(folder)), "walk")
        last = min(UNCOUNTED + frames, session.manifest.footage.frame_count)
        run = prepare_run(session, **WORKLOADS[workload], last=last)
        opened = OpenRun(str(session.path), str(run.folder))
        try:
            opened.warm_up()
            for _ in range(UNCOUNTED):
                _advanced(opened)
            wall, evaluations = list[float](), 0
            with recorded() as trace:
                while not opened.tracking.finished:
                    began = time.perf_counter()
                    evaluations = _advanced(opened)
                    wall.append(time.perf_counter() - began)
                    progress(f"whole frames, {workload}", len(wall), last - UNCOUNTED)
        finally:
            opened.close()
    return FrameTimes(evaluations, tuple(wall), trace)


def _advanced(run: OpenRun) -> int:
    """Track one frame; returns its evaluations."""
    while True:
        stepped = run.step_layer()
        if stepped is not None and stepped.result is not None:
            return stepped.result.evaluations
