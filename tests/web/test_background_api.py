"""The set-up of backgrounds over the API: in the background, with progress, cancelled, refused; plates by upload."""

import threading
import time
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from web_doubles import Studio

from studio.errors import FootageError
from studio.operations import masks
from studio.runs.background_setup import BackgroundSetup
from studio.sessions.session import Session

PLACE = "/api/sessions/take1"


def ended(studio: Studio) -> dict:
    """The set-up's state when it has ended."""
    deadline = time.monotonic() + 30.0
    while time.monotonic() < deadline:
        job = studio.client.get(f"{PLACE}/background").json()["job"]
        if job["state"] not in ("queued", "running", "cancelling"):
            return job
    raise AssertionError("the set-up did not end")


def plate_upload(studio: Studio, name: str, picture: np.ndarray) -> str:
    """An upload of one picture."""
    identifier = studio.client.post("/api/uploads").json()["identifier"]
    content = cv2.imencode(".png", picture)[1].tobytes()
    place = f"/api/uploads/{identifier}/files?path={name}"
    assert studio.client.put(place, content=content).status_code == 200
    return identifier


def test_the_median_is_set_up_and_said(studio: Studio) -> None:
    before = studio.client.get(f"{PLACE}/background").json()
    assert "median" in before["possible"]
    assert "plate" not in before["possible"]
    assert {"mask_threshold", "background_model"} <= set(before["settings"])
    begun = studio.client.post(f"{PLACE}/background", json={"source": "median", "tune": False})
    assert begun.status_code == 202
    assert ended(studio)["state"] == "done"
    after = studio.client.get(f"{PLACE}/background").json()
    assert after["source"] == "median"
    assert after["own"] == {"background_model": "median"}


def test_progress_cancel_and_a_second_one_at_once(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    at_work = threading.Event()

    def waits(
        _: Session, *__: object, progress: Callable[[str, int, int], None], **___: object
    ) -> BackgroundSetup:
        progress("finding empty regions", 1, 4)
        at_work.set()
        while True:
            progress("finding empty regions", 2, 4)
            time.sleep(0.01)

    monkeypatch.setattr(masks, "set_up_background", waits)
    assert studio.client.post(f"{PLACE}/background", json={"source": "median"}).status_code == 202
    assert at_work.wait(20.0)
    job = studio.client.get(f"{PLACE}/background").json()["job"]
    assert (job["step"], job["total"]) == ("finding empty regions", 4)
    again = studio.client.post(f"{PLACE}/background", json={"source": "median"})
    assert again.status_code == 409
    assert studio.client.delete(f"{PLACE}/background").status_code == 202
    assert ended(studio)["state"] == "cancelled"


def test_what_cannot_be_is_refused_in_words(studio: Studio) -> None:
    assert studio.client.post(f"{PLACE}/background", json={"source": "magic"}).status_code == 422
    wrong = studio.client.post(f"{PLACE}/background", json={"source": "median", "knobs": {"mask_x": 1}})
    assert wrong.status_code == 422
    studio.client.post(f"{PLACE}/background", json={"source": "plate"})
    job = ended(studio)
    assert job["state"] == "failed"
    assert "has no plate" in job["message"]


def test_a_failure_leaves_backgrounds_as_they_were(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise FootageError("The clip ends.", "Give another.")

    monkeypatch.setattr("studio.runs.background_setup.given_backgrounds", fails)
    studio.client.post(f"{PLACE}/background", json={"source": "median"})
    assert ended(studio)["message"] == "The clip ends."
    assert not (studio.workspace.session("take1").path / "evidence.json").exists()


def test_uploaded_plates_are_matched_by_name_or_as_said(studio: Studio) -> None:
    sources = studio.workspace.session("take1").manifest.footage.cameras
    source = sources[0]
    picture = np.full((source.height, source.width, 3), 90, np.uint8)
    for camera in sources:
        upload = plate_upload(studio, f"empty_{camera.name}.png", picture)
        told = studio.client.post(f"{PLACE}/backgrounds", json={"upload": upload})
        assert told.status_code == 200, told.text
        assert studio.client.get(f"/api/uploads/{upload}").status_code == 404
    assert [camera["given"] for camera in told.json()["cameras"]] == ["plate"] * len(sources)
    assert "plate" in told.json()["possible"]
    named = plate_upload(studio, "whatever.png", picture)
    wish = {"upload": named, "files": {source.name: "whatever.png"}}
    assert studio.client.post(f"{PLACE}/backgrounds", json=wish).status_code == 200
    small = plate_upload(studio, f"{source.name}.png", picture[:10, :10])
    assert studio.client.post(f"{PLACE}/backgrounds", json={"upload": small}).status_code == 422
    outside = {"upload": plate_upload(studio, "a.png", picture), "files": {source.name: "../../a.png"}}
    assert studio.client.post(f"{PLACE}/backgrounds", json=outside).status_code in (403, 422)
