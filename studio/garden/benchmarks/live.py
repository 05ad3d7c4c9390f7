"""The live benchmark as a whole: footage and model are made, stages timed, and live runs measured with and without the
scene."""

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from studio.app.scene.scene_server import SceneServer
from studio.footage.capture.frame_clock import ReplayClock
from studio.foundations.errors import RunError
from studio.foundations.progress import Progress
from studio.garden.benchmarks.light_viewer import LightViewer
from studio.garden.benchmarks.live_footage import learn_walk, make_footage
from studio.garden.benchmarks.live_stages import (
    CHANGES,
    SECONDS,
    WANTED,
    live_figures,
    live_request,
    measure_stages,
    stage_rows,
)
from studio.garden.benchmarks.timing import IdleShare, resident_megabytes
from studio.operations.jobs.control import StudioControl
from studio.operations.jobs.events import Event, RunState, StateChanged
from studio.operations.jobs.live_tracking import track_live
from studio.operations.jobs.watchers import Subscription
from studio.runs.live.live_summary import LiveSummary, summary_of
from studio.runs.new_run import prepare_run
from studio.sessions.manifest import write_manifest
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

# A live run in its own process as in the studio, with the scene open and a viewer connected.


PATIENCE_SECONDS = 120.0
EARLY = 0.1
"""Share of a run after which its processes have all the memory that they should need."""


@dataclass(frozen=True, slots=True)
class Watched:
    """live : summary of the run. viewer_messages, viewer_bytes : sent to the viewer a second, NaN without one. idle :
    share of all cores' time while it was tracked (`IdleShare`). memory : megabytes of the tracking process and of this
    one, which has the scene, when a tenth of the frames had come and at the end.
    """

    live: LiveSummary
    viewer_messages: float
    viewer_bytes: float
    idle: float
    memory: tuple[float, float]

    def figures(self) -> dict[str, object]:
        """The run's figures, the idle share, and memory."""
        early, late = self.memory
        return live_figures(self.live) | {
            "idle_share": round(self.idle, 3),
            "memory_mb": {"early": round(early, 1), "end": round(late, 1)},
            "memory_growth": round(late / early - 1.0, 4),
        }


def track_watched(
    workspace: Workspace, session: Session, run: StoredRun, report: Progress, *, scene: bool = True
) -> Watched:
    """Track a prepared live run of a session of the workspace to its end. scene : open it, with a viewer; else track
    without it.

    Raises RunError when the tracking fails or falls silent.
    """
    control, stage, viewer = StudioControl(workspace), None, None
    messages = size = float("nan")
    try:
        if scene:
            stage = SceneServer(workspace, control)
            viewer = LightViewer(stage.port, stage.relay_headers())
            stage.show_run(session.name, run.name)
        events = control.subscribe()
        control.track(session.name, run.name)
        _until(events, lambda state: state.live is not None and state.done > 0, report)
        before, began = (viewer.messages, viewer.size) if viewer else (0, 0), time.monotonic()
        idle, frames = IdleShare(), run.record.frame_count
        _until(events, lambda state: state.frame - state.first >= EARLY * frames, report)
        early = _memory(control)
        if control.state.state is not RunState.FINISHED:
            _until(events, lambda state: state.state == "finished", report)
        spent, idle_share, late = time.monotonic() - began, idle.so_far(), _memory(control)
        if viewer:
            messages, size = (viewer.messages - before[0]) / spent, (viewer.size - before[1]) / spent
    finally:
        if viewer is not None:
            viewer.close()
        if stage is not None:
            stage.stop()
        control.close()
    return Watched(summary_of(run), messages, size, idle_share, (early, late))


def _memory(control: StudioControl) -> float:
    return resident_megabytes(os.getpid(), control.process_identifier or 0)


def _until(events: Subscription[Event], is_reached: Callable[[StateChanged], bool], report: Progress) -> None:
    """Wait for a state of the tracking process, reporting its frame rate."""
    while True:
        event = events.get(timeout=PATIENCE_SECONDS)
        if not isinstance(event, StateChanged):
            continue
        if event.state in ("failed", "lost"):
            raise RunError(event.message, event.hint)
        if event.live is not None:
            report(event.live.in_words, event.frame - event.first, event.last - event.first)
        if is_reached(event):
            return


PRESSED = 36.0
"""Frames a second: a clock of 30 cannot show more than 30, nor make up for a dropped frame; a slightly faster one
can."""
FASTER = 2.0
"""Times the footage's rate: the rate sustained then is the machine's maximum."""


def run_live_benchmark(report: Progress, minutes: float | None = None) -> dict[str, object]:
    """Stages of a live frame beside Table 1, and whether 30 frames a second are sustained.

    A run with the scene open at 30 Hz, one at 36, and without a scene at 30 and 60, of SECONDS of video each; sustained
    are 30 frames a second where the first run drops almost nothing, or the second tracks as many. minutes : the first
    run alone, so long.
    """
    seconds = SECONDS if minutes is None else 60.0 * minutes
    with tempfile.TemporaryDirectory(prefix="studio-bench-") as folder:
        workspace = Workspace(Path(folder))
        longest = seconds * (PRESSED / WANTED if minutes is None else 1.0)
        session = make_footage(workspace.place_for("live-walk"), longest, report)
        report("learning the walk", 0, 1)
        model = learn_walk(Path(folder) / "walk.behaviour")
        stages = measure_stages(session, model, report)
        request = live_request(model, seconds)
        watched = track_watched(workspace, session, prepare_run(session, **request), report)
        figures: dict[str, object] = {
            "setting": f"five 320x240 views at {WANTED:g} Hz, {seconds:g} s of video, hulls of depth "
            f"{CHANGES['hull_depth']}, blob fitting, {CHANGES['particles']} particles, {os.cpu_count()} cores",
            "stages": stage_rows(stages),
            "frame_ms": round(stages["whole frame"], 2),
            "scene_open": watched.figures(),
            "scene_viewer": {
                "messages_per_second": round(watched.viewer_messages, 1),
                "megabytes_per_second": round(watched.viewer_bytes / 1e6, 2),
            },
        }
        sustained = watched.live.frames_per_second >= WANTED * ENOUGH
        if minutes is not None:
            return {**figures, "sustained": sustained}
        pressed = _pressed(workspace, session, {**request, "name": "pressed", "last": None}, report)
        alone_run = prepare_run(session, **dict[str, Any](request, name="alone"))
        alone = track_watched(workspace, session, alone_run, report, scene=False)
        fast_run = prepare_run(session, **dict[str, Any](request, name="fast"))
        fast = track_live(
            session,
            fast_run,
            report,
            lambda run, cameras: ReplayClock(FASTER * run.record.fps, run.record.last, cameras),
        )
    return {
        **figures,
        "scene_open_pressed": pressed.figures(),
        "alone": alone.figures(),
        "at_60_hz": live_figures(fast),
        "sustained": sustained or pressed.live.frames_per_second >= WANTED,
    }


def _pressed(workspace: Workspace, session: Session, request: dict[str, Any], report: Progress) -> Watched:
    """The whole video at 36 Hz with the scene open."""
    manifest = session.manifest
    faster = replace(manifest.footage, fps=PRESSED)
    write_manifest(session.path, msgspec.structs.replace(manifest, footage=faster))
    try:
        again = workspace.session(session.name)
        return track_watched(workspace, again, prepare_run(again, **request), report)
    finally:
        write_manifest(session.path, manifest)


ENOUGH = 0.995
"""A clock of 30 Hz gives no more than 30 frames a second, and the last digit is rounding."""
