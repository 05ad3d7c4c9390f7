"""Live runs with the scene open: a viewer is connected, and the scene leaves time to the search."""

import dataclasses
import math

import pytest
from live_driving import live_run
from toy_session import make_session

from studio.app.scene.controller import LIVE_PICTURE_SECONDS, PICTURE_SECONDS, picture_pause
from studio.app.scene.panel import search_html
from studio.app.scene.scene_server import SceneServer
from studio.garden.benchmarks.light_viewer import LightViewer
from studio.garden.benchmarks.live import run_live_benchmark, track_watched
from studio.operations.jobs.control import StudioControl
from studio.operations.jobs.events import RunState, nothing_open
from studio.operations.jobs.live_tracking import replay_live
from studio.runs.live.live_replay import compare, prepare_replay
from studio.runs.live.live_summary import LiveStanding
from studio.sessions.workspace import Workspace


def test_a_light_viewer_connects() -> None:
    workspace = Workspace()
    control = StudioControl(workspace)
    stage = SceneServer(workspace, control)
    viewer = LightViewer(stage.port, stage.relay_headers())
    assert viewer.messages > 0
    assert viewer.size > 0
    viewer.close()
    stage.stop()
    control.close()


def test_pictures_come_less_often_while_a_live_run_is_tracked() -> None:
    state = dataclasses.replace(nothing_open(), state=RunState.TRACKING)
    live = dataclasses.replace(state, live=LiveStanding(3, 0.01, 24.2, 29.8))
    assert picture_pause(state) == PICTURE_SECONDS
    assert picture_pause(live) == LIVE_PICTURE_SECONDS > PICTURE_SECONDS
    assert picture_pause(dataclasses.replace(live, state=RunState.PAUSED)) == PICTURE_SECONDS
    assert picture_pause(dataclasses.replace(state, state=RunState.REANNEALING)) == LIVE_PICTURE_SECONDS


def test_the_panel_shows_a_live_runs_rate() -> None:
    state = dataclasses.replace(nothing_open(), session="toy", run="live", state=RunState.TRACKING)
    state = dataclasses.replace(state, live=LiveStanding(3, 0.01, 24.2, 29.8))
    assert "live · 29.8 fps · latency 24 ms · 3 dropped" in search_html(state)
    assert "The disk is full." in search_html(dataclasses.replace(state, message="The disk is full."))


@pytest.mark.slow
def test_a_live_run_with_the_scene_open() -> None:
    workspace = Workspace()
    session = make_session(workspace.place_for("toy"))
    run = live_run(session, last=120, ping_pong=True)
    steps: list[str] = []
    found = track_watched(workspace, session, run, lambda step, done, total: steps.append(step))
    assert run.summary().status == "finished"
    assert len(found.live.tracked) + len(found.live.dropped) == 120 - found.live.tracked[0]
    assert found.viewer_messages > 0.0
    assert found.viewer_bytes > 0.0
    early, late = found.memory
    assert 100.0 < early < 1.5 * late
    assert found.figures()["memory_growth"] == pytest.approx(late / early - 1.0, abs=1e-4)
    assert any("latency" in words for words in steps)
    made = prepare_replay(session, run)
    assert replay_live(session, run, made, lambda *_: None).different == ()
    assert compare(run, made).frames == len(found.live.tracked)


@pytest.mark.slow
def test_the_live_benchmark_measures_and_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studio.garden.benchmarks.live.SECONDS", 3.0)
    report = run_live_benchmark(lambda *_: None)
    stages = {row["stage"]: row for row in report["stages"]}  # pyright: ignore[reportGeneralTypeIssues]
    assert all(row["ms"] > 0.0 for name, row in stages.items() if name != "the rest")
    assert stages["reconstruction"]["paper_ms"] == 28.1
    parts = sum(row["ms"] for name, row in stages.items() if name != "whole frame")
    assert stages["whole frame"]["ms"] == pytest.approx(parts, rel=0.2)
    for name, frames in (("scene_open", 90), ("scene_open_pressed", 108), ("alone", 90), ("at_60_hz", 90)):
        figures = report[name]
        assert figures["tracked"] + figures["dropped"] <= frames  # pyright: ignore[reportIndexIssue]
        assert figures["tracked"] > 0  # pyright: ignore[reportIndexIssue]
        assert math.isfinite(figures["latency_ms"]["p95"])  # pyright: ignore[reportIndexIssue]
    assert isinstance(report["sustained"], bool)
    long = run_live_benchmark(lambda *_: None, minutes=0.1)
    assert long["scene_open"]["tracked"] + long["scene_open"]["dropped"] <= 180  # pyright: ignore[reportIndexIssue]
    assert not {"scene_open_pressed", "alone", "at_60_hz"} & set(long)
