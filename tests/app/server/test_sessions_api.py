"""Sessions through the API: what the page's list shows and does."""

import cv2
import numpy as np
import pytest
from web_doubles import Studio, state_of

from studio.app.server.alignment_routes import ALIGNMENT, AlignmentJob
from studio.app.server.import_routes import IMPORT, ImportState
from studio.body.subject import DEFAULT_BODY
from studio.foundations.errors import NotFoundError
from studio.operations.jobs.commands import Close, Command
from studio.operations.jobs.job_runner import keep_in_place
from studio.operations.jobs.process import ProcessDiedError
from studio.search.settings import DEFAULT_WEIGHTING
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


def sessions(studio: Studio) -> dict[str, dict]:
    """The list, by name."""
    return {entry["name"]: entry for entry in studio.get("/api/sessions")["sessions"]}


def test_the_list_says_what_the_rail_shows(studio: Studio, tracked: StoredRun) -> None:
    entry = sessions(studio)["take1"]
    assert (entry["cameras"], entry["frame_count"], entry["fps"]) == (2, 4, 25.0)
    assert entry["camera_names"] == ["cam1", "cam2"]
    assert (entry["tracker"], entry["weighting"], entry["body"]) == (
        "annealed",
        DEFAULT_WEIGHTING,
        DEFAULT_BODY,
    )
    [run] = entry["runs"]
    assert (run["name"], run["done"], run["first"], run["last"]) == ("first", 2, 0, 4)
    assert run["status"] == "interrupted"
    assert run["describe"] == "annealed 10×100"
    assert run["mean_mm"] is None


def test_runs_come_newest_first(studio: Studio, tracked: StoredRun) -> None:
    studio.post("/api/sessions/take1/runs", {"name": "second"}, code=201)
    assert [run["name"] for run in sessions(studio)["take1"]["runs"]] == ["second", "first"]


def test_a_session_that_cannot_be_opened_says_why_and_spoils_nothing(studio: Studio) -> None:
    broken = studio.workspace.root / "broken"
    broken.mkdir()
    (broken / "session.json").write_text("{")
    found = sessions(studio)
    assert found["broken"]["problem"]
    assert found["take1"]["problem"] == ""


def test_the_detail_shows_cameras_matching_body_and_subject(studio: Studio, session: Session) -> None:
    response = studio.get("/api/sessions/take1")
    assert [camera["name"] for camera in response["cameras"]] == ["cam1", "cam2"]
    first = session.cameras()[0]
    assert np.allclose(response["cameras"][0]["centre"], first.centre)
    assert response["cameras"][0]["quarter_turns"] == first.quarter_turns
    assert response["cameras"][0]["picture_width"] == 96
    assert {match["camera"] for match in response["matching"]} == {"cam1", "cam2"}
    assert len(response["body"]["parameters"]) == 35
    assert {entry["unit"] for entry in response["body"]["parameters"]} == {"mm", "rad"}
    assert response["has_start_pose"] is True
    assert response["has_truth"] is False
    assert response["subject"] is None


def test_the_thumbnail_is_a_small_jpeg(studio: Studio) -> None:
    answer = studio.client.get(sessions(studio)["take1"]["thumbnail"])
    assert answer.headers["content-type"] == "image/jpeg"
    picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (64, 96, 3)


def test_rename_title_duplicate(studio: Studio, tracked: StoredRun) -> None:
    client = studio.client
    assert client.patch("/api/sessions/take1", json={"title": "A walk"}).json() == {"name": "take1"}
    assert sessions(studio)["take1"]["title"] == "A walk"
    assert client.post("/api/sessions/take1/duplicate").json() == {"name": "take1-2"}
    assert client.post("/api/sessions/take1/duplicate", json={"name": "take1"}).status_code == 409
    assert client.patch("/api/sessions/take1", json={"name": "take1-2"}).status_code == 409
    assert client.patch("/api/sessions/take1", json={"name": "../x"}).status_code == 422
    assert client.patch("/api/sessions/take1", json={"name": "moved"}).json() == {"name": "moved"}
    assert set(sessions(studio)) == {"moved", "take1-2"}
    frames = client.get("/api/sessions/take1-2/runs/first/frames").json()["frames"]
    assert [entry["frame"] for entry in frames] == [0, 1]


def test_a_tracking_process_that_dies_just_now_holds_nothing(
    studio: Studio, tracked: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The server has not heard of its end yet, so that it still counts as idle."""

    def die(command: Command) -> None:
        raise ProcessDiedError(f"The tracking process has died before {command}.", "Resume.")

    monkeypatch.setattr(studio.control, "request", die)
    assert studio.patch("/api/sessions/take1", {"name": "moved"}) == {"name": "moved"}


def test_delete_goes_to_the_trash_and_comes_back(studio: Studio, tracked: StoredRun) -> None:
    client = studio.client
    gone = client.delete("/api/sessions/take1").json()
    assert gone["name"] == "take1"
    assert sessions(studio) == {}
    [entry] = client.get("/api/trash").json()["entries"]
    assert (entry["id"], entry["name"], entry["kind"]) == (gone["id"], "take1", "session")
    back = client.post("/api/trash/restore", json={"entry": entry["id"]})
    assert back.json() == {"name": "take1", "run": "", "comparison": "", "model": ""}
    assert [run["name"] for run in sessions(studio)["take1"]["runs"]] == ["first"]
    assert client.post("/api/trash/restore", json={"entry": "none"}).status_code == 404
    assert client.post("/api/trash/restore", json={"entry": "../take1"}).status_code == 422


def test_what_is_open_is_let_go_of_before_it_moves(studio: Studio, tracked: StoredRun) -> None:
    studio.control.state = state_of("take1", "first", "finished")
    studio.patch("/api/sessions/take1", {"name": "moved"})
    assert [type(command) for command in studio.control.commands] == [Close]
    (sent,) = studio.control.commands
    assert (sent.session, sent.run) == (str(studio.workspace.root / "take1"), "")
    studio.control.state = state_of("other", "first", "tracking")
    studio.delete("/api/sessions/moved")
    assert len(studio.control.commands) == 1, "a search elsewhere is not waited for"


def test_a_run_is_renamed_and_deleted(studio: Studio, tracked: StoredRun) -> None:
    client = studio.client
    client.post("/api/sessions/take1/runs", json={"name": "second"})
    assert client.patch("/api/sessions/take1/runs/first", json={"name": "second"}).status_code == 409
    assert client.patch("/api/sessions/take1/runs/first", json={"name": "best"}).json() == {"name": "best"}
    detail = client.get("/api/sessions/take1/runs/best").json()
    assert detail["run"]["name"] == "best"
    assert detail["run"]["done"] == 2
    gone = client.delete("/api/sessions/take1/runs/best").json()
    assert (gone["kind"], gone["name"]) == ("run", "take1 / best")
    assert [run["name"] for run in sessions(studio)["take1"]["runs"]] == ["second"]
    assert client.get("/api/sessions/take1/runs/best").status_code == 404
    assert client.get("/api/trash").json()["entries"] == [gone]

    # It comes back into its session under a free name, also if the session has another name by now.
    client.post("/api/sessions/take1/runs", json={"name": "best"})
    client.patch("/api/sessions/take1", json={"name": "moved"})
    lost = client.post("/api/trash/restore", json={"entry": gone["id"]})
    assert lost.status_code == 404
    client.patch("/api/sessions/moved", json={"name": "take1"})
    back = client.post("/api/trash/restore", json={"entry": gone["id"]}).json()
    assert back == {"name": "take1", "run": "best-2", "comparison": "", "model": ""}
    frames = client.get("/api/sessions/take1/runs/best-2/frames").json()["frames"]
    assert [entry["frame"] for entry in frames] == [0, 1]
    assert client.get("/api/trash").json()["entries"] == []


def test_a_job_of_a_session_that_was_moved_before_it_began_says_so(studio: Studio) -> None:
    with (
        pytest.raises(NotFoundError, match="'gone' was renamed or deleted meanwhile"),
        keep_in_place(studio.workspace, ALIGNMENT, AlignmentJob(session="gone")),
    ):
        pass
    # One that makes its session finds none.
    with keep_in_place(studio.workspace, IMPORT, ImportState(session="gone", name="gone")):
        pass
    assert not (studio.workspace.root / "gone").exists()
