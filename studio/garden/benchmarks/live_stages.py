"""Cost of each stage of a live frame on one core, compared with the paper's Table 1 (Caillette, Galata & Howard 2007).

Five views of 320 × 240, hulls of depth 7, blobs fitted, 1000 particles guided by a behaviour model. A stage's time is
one core's, the median over the frames that come after the blobs are learnt; one thread does them one after the other.
In a live run decoding and the hull are done on one core while the frame before is searched on the other
(`runs.live.live_run`), so the slower of the two sets the rate, and a pose comes after both.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from studio.evidence.backgrounds import Backgrounds
from studio.evidence.pipeline import EvidenceMaker
from studio.foundations.numba_in_threads import numba
from studio.foundations.progress import Progress
from studio.foundations.typed_decoding import is_table
from studio.runs.live.live_summary import LiveSummary
from studio.runs.search_space import search_space, session_sigma
from studio.search.behaviour.model_file import read_model
from studio.search.likelihood.blobs import BlobLikelihood
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import changed_settings, default_settings
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.tracker import FilterState, start_of
from studio.sessions.session import Session

TRACKER, WEIGHTING = "behaviour", "blobs"
CHANGES: Mapping[str, object] = {"particles": 1000, "hull_depth": 7}
SECONDS = 20.0
WANTED = 30.0
"""Frames a second."""
STAGES = {
    "decoding": None,
    "reconstruction": 28.1,
    "blob fitting": 14.8,
    "prediction and evaluation": 45.3,
    "the rest": None,
}
"""Milliseconds in Table 1: five views at depth 7, blobs at depth 7, 1000 particles (six blobs a limb)."""
LEARNING, MEASURED = 22, 60
"""Frames: until the blobs are learnt, and that are measured after."""


def live_request(model: Path, seconds: float = SECONDS, fps: float = WANTED) -> dict[str, Any]:
    """The live run of Show 6."""
    last = round(seconds * fps)
    return dict(
        tracker=TRACKER,
        weighting=WEIGHTING,
        last=last,
        knobs=CHANGES,
        name="live",
        behaviour=str(model),
        live=True,
    )


@dataclass(slots=True)
class StageClock:
    """Milliseconds by stage, frame by frame."""

    spent: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in STAGES})
    _since: float = 0.0

    def start(self) -> None:
        self._since = time.thread_time()
        for times in self.spent.values():
            times.append(0.0)

    def lap(self, stage: str) -> None:
        """Assign the time since the last lap to this stage."""
        now = time.thread_time()
        self.spent[stage][-1] += 1e3 * (now - self._since)
        self._since = now

    def medians(self, begin: int) -> dict[str, float]:
        """Medians of each stage over the frames from `begin` on, and of whole frames."""
        table = np.array(list(self.spent.values()))[:, begin:]
        medians = dict(zip(self.spent, np.median(table, axis=1).tolist(), strict=True))
        return medians | {"whole frame": float(np.median(table.sum(axis=0)))}


def measure_stages(session: Session, model: Path, progress: Progress | None = None) -> dict[str, float]:
    """Milliseconds of each stage of a frame, and of a whole one, on one thread. progress : called with (step, done,
    total).
    """
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        return _measured(session, model, progress)
    finally:
        numba.set_num_threads(threads)


def _measured(session: Session, model: Path, progress: Progress | None) -> dict[str, float]:
    settings = changed_settings(default_settings(TRACKER, WEIGHTING), CHANGES)
    body, cameras, tracker = session.body(), session.cameras(), TRACKERS[TRACKER]
    fps = session.manifest.fps
    space = search_space(body, session_sigma(session, body, fps), read_model(model).at_rate(fps))
    footage = session.footage()
    maker = EvidenceMaker(
        cameras, footage, Backgrounds(footage), settings.evidence, WEIGHTINGS[WEIGHTING].edge_kind
    )
    maker.evidence(0)
    likelihood, clock = BlobLikelihood(body, cameras, settings.weighting), StageClock()
    start = session.start_pose(body)
    carried = start_of(None if start is None else tuple(start.tolist()))
    frames = min(LEARNING + MEASURED, footage.frame_count)
    for frame in range(frames):
        clock.start()
        footage.pictures(frame)
        clock.lap("decoding")
        problem = likelihood.problem(maker.evidence(frame))
        clock.lap("reconstruction")
        particles = tracker.begin_frame(
            RandomNumbers.of_beginning(0, frame), carried, space, settings.tracker
        )
        clock.lap("prediction and evaluation")
        expected = tracker.expectations(particles, space, settings.tracker)
        informed = problem.expecting(expected, carried.memory)
        clock.lap("blob fitting")
        weighed, _ = tracker.step_layer(
            RandomNumbers(0, frame, 0), particles, 0, informed, space, settings.tracker
        )
        pose = tracker.end_frame(weighed, space, settings.tracker).pose
        clock.lap("prediction and evaluation")
        carried = FilterState(weighed, pose, carried.estimate, informed.remembered(pose))
        clock.lap("the rest")
        if progress is not None:
            progress("a live frame's stages", frame + 1, frames)
    footage.close()
    return clock.medians(min(LEARNING, frames // 2))


def stage_rows(medians: Mapping[str, float]) -> list[dict[str, object]]:
    """The stages beside Table 1."""
    paper = {**STAGES, "whole frame": sum(value for value in STAGES.values() if value)}
    return [{"stage": name, "ms": round(medians[name], 2), "paper_ms": paper[name]} for name in medians]


def live_figures(summary: LiveSummary) -> dict[str, object]:
    return {
        "frames_per_second": round(summary.frames_per_second, 2),
        "tracked": len(summary.tracked),
        "dropped": len(summary.dropped),
        "dropped_share": round(summary.dropped_share, 4),
        "latency_ms": {
            "median": round(summary.latency(0.5), 1),
            "p95": round(summary.latency(0.95), 1),
            "worst": round(summary.latency(1.0), 1),
        },
    }


def in_words(report: Mapping[str, Any]) -> str:
    """The benchmark's document as a table for a person."""
    lines = [f"Live: {report['setting']}", f"  {'stage, ms on one core':32}{'ours':>8}{'Table 1':>10}"]
    for row in report["stages"]:
        paper = "" if row["paper_ms"] is None else f"{row['paper_ms']:.1f}"
        lines.append(f"  {row['stage']:32}{row['ms']:8.1f}{paper:>10}")
    for key, words in RUNS.items():
        run = report.get(key)
        if is_table(run):
            latency = run["latency_ms"]
            lines.append(
                f"  {words}: {run['frames_per_second']:.1f} frames a second, {run['dropped']} of "
                f"{run['tracked'] + run['dropped']} dropped, picture to pose {latency['median']:.0f} ms "
                f"(95 %: {latency['p95']:.0f}, worst {latency['worst']:.0f})"
                + (
                    f", {run['idle_share']:.0%} of all cores idle, memory {run['memory_mb']['early']:.0f} to "
                    f"{run['memory_mb']['end']:.0f} MB"
                    if "idle_share" in run
                    else ""
                )
            )
    return "\n".join(lines)


RUNS = {
    "scene_open": "at 30 Hz with the scene open",
    "scene_open_pressed": "at 36 Hz with the scene open",
    "alone": "at 30 Hz without a scene",
    "at_60_hz": "at 60 Hz without a scene",
}
"""The live runs of the benchmark, by their keys in its document."""
