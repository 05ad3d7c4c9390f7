"""Live runs through the API."""

import dataclasses

import pytest
from web_doubles import Studio

from studio.app.server.event_encoding import message_of, plain
from studio.operations.jobs.events import nothing_open
from studio.runs.live.live_summary import LiveStanding
from studio.search.trackers.tracker import Estimate, FilterState, FrameResult
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session

LIVE = "/api/sessions/take1/runs/now/live"


def test_a_live_run_is_made_and_says_how_it_went(studio: Studio, session: Session) -> None:
    request = {"name": "now", "live": True, "ping_pong": True, "last": 50}
    studio.post("/api/sessions/take1/runs", request, code=201)
    assert studio.get("/api/sessions/take1/runs/now")["live"] is True
    run = session.run("now")
    assert run.record.ping_pong
    assert studio.get(LIVE)["tracked"] == 0
    pose = run.body().neutral
    with ResultsWriter(run.folder) as writer:
        for frame, ready in ((0, 0.02), (3, 0.15)):
            result = FrameResult(
                frame, Estimate(pose, pose, pose, -1.0), 1, 10, 1, 5.0, FilterState(None, pose)
            )
            writer.write_frame(result, [], came=(0.04 * frame, ready))
    response = studio.get(LIVE)
    assert response["tracked"] == 2
    assert response["dropped"] == [1, 2]
    assert response["dropped_share"] == 0.5
    assert response["latencies_ms"] == pytest.approx([20.0, 30.0])
    assert response["latency_median_ms"] == pytest.approx(25.0)
    assert response["frames_per_second"] == pytest.approx(1 / 0.13)


def test_other_runs_have_no_live_figures(studio: Studio) -> None:
    studio.post("/api/sessions/take1/runs", {"name": "plain"})
    answer = studio.get("/api/sessions/take1/runs/plain/live", code=404)
    assert "not tracked live" in answer["message"]
    studio.post("/api/sessions/take1/runs", {"ping_pong": True}, code=409)


def test_the_state_event_says_how_it_keeps_up() -> None:
    state = nothing_open()
    assert plain(message_of(state))["live"] is None
    live = LiveStanding(3, 0.1, float("nan"), 29.8)
    response = plain(message_of(dataclasses.replace(state, live=live)))
    assert response["live"] == {
        "dropped": 3,
        "dropped_share": 0.1,
        "incomplete": 0,
        "latency_ms": None,
        "frames_per_second": 29.8,
    }


def test_frames_behind_the_footages_end_have_pictures(studio: Studio) -> None:
    request = {"name": "now", "live": True, "ping_pong": True, "last": 50}
    studio.post("/api/sessions/take1/runs", request)
    place = "/api/sessions/take1/runs/now/frames/{}/views/cam1.jpg?show="
    inside, behind = (studio.client.get(place.format(frame)) for frame in (2, 4))
    assert inside.status_code == behind.status_code == 200
    assert inside.content == behind.content, "4 is 2 on the way back of four frames"
    studio.get(place.format(50), code=404)
    studio.get("/api/sessions/take1/frames/4/views/cam1.jpg", code=404)
