"""The live benchmark as a whole: footage and model made, stages timed, and live runs with and without the scene."""

import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from studio.capture.frame_clock import ReplayClock
from studio.experiments.live_benchmark import (
    CHANGES,
    SECONDS,
    WANTED,
    live_figures,
    live_request,
    measure_stages,
    stage_rows,
)
from studio.experiments.live_footage import learn_walk, make_footage
from studio.runs.new_run import prepare_run
from studio.scene.live_watching import track_watched
from studio.sessions.workspace import Workspace
from studio.worker.live_tracking import track_live

# Called with a step in words, what is done of it and how much it is.
Report = Callable[[str, int, int], None]

FASTER = 2.0
"""Times the footage's rate: what is sustained of that is all that the machine can do."""


def run_live_benchmark(report: Report, seconds: float = SECONDS) -> dict[str, object]:
    """Show 6 of the real-time tracker: stages beside Table 1, and whether 30 frames a second are sustained.

    seconds : of replayed video in each live run; at twice the rate they take half as long.
    """
    with tempfile.TemporaryDirectory(prefix="studio-bench-") as folder:
        workspace = Workspace(Path(folder))
        session = make_footage(workspace.place_for("live-walk"), seconds, report)
        report("learning the walk", 0, 1)
        model = learn_walk(Path(folder) / "walk.behaviour")
        stages = measure_stages(session, model, report)
        request = live_request(model, seconds)
        watched = track_watched(workspace, session, prepare_run(session, request), report)
        alone_run = prepare_run(session, replace(request, name="alone"))
        alone = track_watched(workspace, session, alone_run, report, scene=False)
        fast_run = prepare_run(session, replace(request, name="fast"))
        fast = track_live(
            session,
            fast_run,
            report,
            lambda run, cameras: ReplayClock(FASTER * run.record.fps, run.record.last, cameras),
        )
    return {
        "setting": f"five 320x240 views at {WANTED:g} Hz, {seconds:g} s of video, hulls of depth "
        f"{CHANGES['hull_depth']}, blob fitting, {CHANGES['particles']} particles, {os.cpu_count()} cores",
        "stages": stage_rows(stages),
        "scene_open": live_figures(watched.live),
        "scene_viewer": {
            "messages_per_second": round(watched.viewer_messages, 1),
            "megabytes_per_second": round(watched.viewer_bytes / 1e6, 2),
        },
        "alone": live_figures(alone.live),
        "at_60_hz": live_figures(fast),
        "sustained": watched.live.frames_per_second >= WANTED * ENOUGH,
    }


ENOUGH = 0.995
"""A clock of 30 Hz gives no more than 30 frames a second, and the last digit is rounding."""
