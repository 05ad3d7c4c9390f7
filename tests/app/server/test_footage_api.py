"""Offsets, turns and their estimate over the API."""

import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from waiting import PATIENCE
from web_doubles import Studio

from studio.footage.capture.synchrony import PairLag, Synchrony
from studio.foundations.errors import FootageError
from studio.operations import footage
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

HERE = "/api/sessions/take1/footage"
SYNCHRONY = "/api/sessions/take1/synchrony"
FOUND = Synchrony(
    {"cam1": 0, "cam2": 3}, {"cam1": 2.5, "cam2": 2.5}, {"cam1": 1, "cam2": 1},
    (PairLag("cam1", "cam2", 3, 0.9, 2.5, 1),), True, (),
)  # fmt: skip


def test_the_footage_as_it_is(studio: Studio) -> None:
    response = studio.get(HERE)
    assert (response["frame_count"], response["fps"], response["stale_runs"]) == (4, 25.0, [])
    assert response["layout"] == "folder in the studio's layout"
    assert [(camera["name"], camera["offset"], camera["turned"]) for camera in response["cameras"]] == [
        ("cam1", 0, 0),
        ("cam2", 0, 0),
    ]


def test_a_change_is_written_and_says_what_it_makes_stale(studio: Studio, tracked: StoredRun) -> None:
    studio.get("/api/sessions/take1/thumbnail.jpg")
    response = studio.patch(HERE, {"offsets": {"cam2": 1}, "rotations": {"cam1": 180}})
    assert [(camera["offset"], camera["turned"]) for camera in response["cameras"]] == [(0, 180), (1, 0)]
    assert response["frame_count"] == 3
    assert response["stale_runs"] == ["first"]
    assert any("Run first was tracked before this change" in note for note in response["notes"])
    assert any("start pose" in note for note in response["notes"])
    # The run keeps its numbers.
    studio.get("/api/sessions/take1/runs/first")
    assert tracked.record.last == 4
    again = studio.get(HERE)
    assert again["stale_runs"] == ["first"]
    footage = Session(tracked.folder.parent.parent).footage()
    other = cv2.imread(str(Path(footage.folder) / "pictures" / "cam1" / "0002.png"))
    np.testing.assert_array_equal(footage.picture("cam1", 2), cv2.rotate(other, cv2.ROTATE_180))
    nothing = studio.patch(HERE, {"offsets": {"cam2": 1}})
    assert nothing["notes"] == ["Nothing changes."]


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        ({"offsets": {"cam9": 1}}, "There is no camera 'cam9'"),
        ({"offsets": {"cam1": 4}}, "no frame is left"),
        ({"rotations": {"cam1": 90}}, "are 64x96, and its calibration is for 96x64"),
    ],
)
def test_what_cannot_be_changed(studio: Studio, sent: dict, said: str) -> None:
    answer = studio.client.patch(HERE, json=sent)
    assert 400 <= answer.status_code < 500
    assert said in answer.json()["message"]
    assert answer.json()["hint"]
    assert [camera["offset"] for camera in studio.get(HERE)["cameras"]] == [0, 0]


def test_requests_that_make_no_sense(studio: Studio) -> None:
    for request in ({"rotations": {"cam1": 45}}, {"offsets": {"cam1": "x"}}, {"speed": 3}):
        studio.patch(HERE, request, code=422)


def test_an_estimate_is_shown_and_not_applied(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    def estimate(session: Session, report: object, within: float) -> Synchrony:
        asked.append(within)
        assert callable(report)
        report("motion in cam1", 2, 4)
        return FOUND

    monkeypatch.setattr(footage, "synchrony_of", estimate)
    assert studio.get(SYNCHRONY) is None
    studio.post(SYNCHRONY, {"within": 2.0}, code=202)
    response = studio.ended(SYNCHRONY)
    assert (response["state"], response["offsets"], response["sure"]) == (
        "done",
        {"cam1": 0, "cam2": 3},
        True,
    )
    assert response["confidence"] == {"cam1": 2.5, "cam2": 2.5}
    assert response["spread"] == {"cam1": 1, "cam2": 1}
    assert response["pairs"][0]["lag"] == 3
    assert asked == [2.0]
    assert [camera["offset"] for camera in studio.get(HERE)["cameras"]] == [0, 0]


def test_a_real_estimate_of_too_few_frames_says_why(studio: Studio) -> None:
    studio.post(SYNCHRONY)
    response = studio.ended(SYNCHRONY)
    assert response["state"] == "failed"
    assert "Camera cam1 has 4 frames" in response["message"]
    assert response["hint"]


def test_an_estimate_can_be_stopped(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, stopped = threading.Event(), threading.Event()

    def estimate(session: Session, report: object, within: float) -> Synchrony:
        begun.set()
        assert stopped.wait(PATIENCE)
        assert callable(report)
        report("motion in cam1", 2, 4)
        raise FootageError("not stopped", "")

    monkeypatch.setattr(footage, "synchrony_of", estimate)
    studio.post(SYNCHRONY)
    assert begun.wait(PATIENCE)
    studio.delete(SYNCHRONY)
    stopped.set()
    response = studio.ended(SYNCHRONY)
    assert (response["state"], response["code"]) == ("cancelled", "cancelled")


def test_an_import_puts_cameras_in_step_and_says_whose_layout_it_was(studio: Studio, source: Path) -> None:
    request = {
        "name": "stepped",
        "source": str(source),
        "fps": 25,
        "offsets": {"cam2": 1},
        "rotations": {"cam1": 180},
        "unit": "mm",
    }
    identifier = studio.post("/api/imports", request)["identifier"]
    deadline = time.monotonic() + PATIENCE
    state = {"state": "running"}
    while state["state"] in ("queued", "running", "cancelling") and time.monotonic() < deadline:
        state = studio.get(f"/api/imports/{identifier}")
    assert state["state"] == "done", state
    assert state["layout"] == "folder in the studio's layout"
    response = studio.get("/api/sessions/stepped/footage")
    assert [(camera["offset"], camera["turned"]) for camera in response["cameras"]] == [(0, 180), (1, 0)]
    assert response["frame_count"] == 3
    for bad in ({"trial": 3}, {"rotations": {"cam1": 30}}, {"unit": "inch"}, {"up": "w"}):
        studio.post("/api/imports", {**request, "name": "other", **bad}, code=422)
