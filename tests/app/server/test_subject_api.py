"""The person and the masks over the API. The searches themselves are tested in tests/runs and tests/trackers."""

import threading
import time
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from waiting import PATIENCE
from web_doubles import Studio

from studio.foundations.errors import RunError
from studio.operations import person
from studio.runs.setup.subject_fitting import FitRequest, FittedSize, FittedSubject, Shown
from studio.sessions.session import Session

SESSION = "take1"


def answer(session: Session, request: FitRequest, **_: object) -> FittedSubject:
    """A subject that somebody fitted."""
    body = session.body()
    size = FittedSize("thigh_length", "length", ("left_thigh_length",), 400.0, 425.0, 4.0)
    known = session.subject()
    assert known is not None
    return FittedSubject(
        known, body, (size,), (3, 7), np.zeros((2, 4)), np.full(2, 0.8), np.full(2, 0.9), "run run-1", 10
    )


def test_a_fit_runs_in_the_background_and_is_kept(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    name = SESSION
    assert studio.client.put(f"/api/sessions/{name}/subject", json={"height_mm": 1800}).status_code == 200
    monkeypatch.setattr(person, "fit_session_subject", answer)
    begun = studio.client.post(f"/api/sessions/{name}/fit-subject", json={"count": 2})
    assert begun.status_code == 202
    response = studio.ended(f"/api/subject-fits/{begun.json()['identifier']}")
    assert response["state"] == "done"
    assert response["sizes"][0]["after"] == 425.0
    assert response["file"] == "subject.toml"
    folder = studio.workspace.session(name).path
    assert (folder / "subject-before.toml").exists()


def test_a_failure_and_a_cancellation_are_in_words(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> FittedSubject:
        raise RunError("Nothing is to be seen.", "Look at the masks.")

    monkeypatch.setattr(person, "fit_session_subject", fails)
    begun = studio.client.post(f"/api/sessions/{SESSION}/fit-subject", json={})
    assert (
        studio.ended(f"/api/subject-fits/{begun.json()['identifier']}")["message"] == "Nothing is to be seen."
    )

    def waits(*_: object, progress: Callable[[str, int, int], None], **__: object) -> FittedSubject:
        while True:
            progress("fitting", 0, 1)
            time.sleep(0.01)

    monkeypatch.setattr(person, "fit_session_subject", waits)
    begun = studio.client.post(f"/api/sessions/{SESSION}/fit-subject", json={})
    identifier = begun.json()["identifier"]
    assert studio.client.delete(f"/api/subject-fits/{identifier}").status_code == 202
    assert studio.ended(f"/api/subject-fits/{identifier}")["code"] == "cancelled"


def test_a_height_gives_every_length(studio: Studio) -> None:
    place = f"/api/sessions/{SESSION}/subject"
    small = studio.client.put(place, json={"height_mm": 1600, "body": "human31"}).json()["dimensions"]
    tall = studio.client.put(place, json={"height_mm": 2000, "body": "human31"}).json()
    assert tall["height_mm"] == 2000
    assert tall["dimensions"]["left_thigh_length"] == pytest.approx(0.245 * 2000)
    assert small["left_thigh_length"] == pytest.approx(0.245 * 1600)
    assert studio.client.put(place, json={"height_mm": 18}).status_code == 422


def test_what_is_painted_does_not_count(studio: Studio) -> None:
    source = studio.workspace.session(SESSION).manifest.footage.cameras[0]
    painted = np.zeros((source.height, source.width), np.uint8)
    painted[:, : source.width // 2] = 255
    place = f"/api/sessions/{SESSION}/exclusions/{source.name}"
    assert studio.client.get(place).status_code == 404
    content = cv2.imencode(".png", painted)[1].tobytes()
    response = studio.client.put(place, content=content)
    assert response.json()["pixels"] == source.height * (source.width // 2)
    kept = cv2.imdecode(np.frombuffer(studio.client.get(place).content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert (kept == painted).all()
    wrong = cv2.imencode(".png", painted[1:])[1].tobytes()
    assert studio.client.put(place, content=wrong).status_code == 422
    assert studio.client.put(place, content=b"no picture").status_code == 422
    assert studio.client.put(place, content=b"").json()["pixels"] == 0
    assert studio.client.get(place).status_code == 404


def test_the_sessions_knobs_are_those_of_its_masks(studio: Studio) -> None:
    place = f"/api/sessions/{SESSION}/evidence"
    assert studio.client.get(place).json() == {"knobs": {}}
    assert studio.client.put(place, json={"mask_threshold": 7.0}).status_code == 200
    assert studio.client.get(place).json()["knobs"] == {"mask_threshold": 7.0}
    assert studio.client.put(place, json={"mask_threshold": 7000.0}).status_code == 422
    assert studio.client.put(place, json={"no_such_knob": 1}).status_code == 422


def test_a_preview_takes_knobs_and_changes_nothing(studio: Studio) -> None:
    source = studio.workspace.session(SESSION).manifest.footage.cameras[0]
    view = f"/api/sessions/{SESSION}/frames/0/views/{source.name}.jpg?show=mask"
    usual = studio.client.get(view)
    assert usual.status_code == 200
    other = studio.client.get(view, params={"show": "mask", "settings": '{"mask_min_component": 100000}'})
    assert other.status_code == 200
    assert studio.client.get(view).content == usual.content
    refused = studio.client.get(view, params={"show": "mask", "settings": "no json"})
    assert refused.status_code == 422


def test_a_fit_shows_the_poses_that_it_has(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    go, looked = threading.Event(), threading.Event()

    def fits(session: Session, request: FitRequest, shown: Shown, **_: object) -> FittedSubject:
        shown(session.body(), (2,), session.body().neutral[None])
        looked.set()
        go.wait(PATIENCE)
        return answer(session, request)

    assert studio.client.put(f"/api/sessions/{SESSION}/subject", json={"height_mm": 1800}).is_success
    monkeypatch.setattr(person, "fit_session_subject", fits)
    begun = studio.client.post(f"/api/sessions/{SESSION}/fit-subject", json={"keep": False}).json()
    try:
        assert looked.wait(PATIENCE)
        place = f"/api/subject-fits/{begun['identifier']}"
        state = studio.client.get(place).json()
        assert (state["frames"], state["looks"]) == ([2], 1)
        assert studio.client.get(f"{place}/frames/2/views/cam1.jpg").headers["content-type"] == "image/jpeg"
        assert studio.client.get(f"{place}/frames/3/views/cam1.jpg").status_code == 404
    finally:
        go.set()
    assert studio.ended(f"/api/subject-fits/{begun['identifier']}")["frames"] == [3, 7]


def test_all_work_is_listed_and_stopped_by_its_name(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    def waits(*_: object, progress: Callable[[str, int, int], None], **__: object) -> FittedSubject:
        while True:
            progress("fitting", 1, 4)
            time.sleep(0.01)

    monkeypatch.setattr(person, "fit_session_subject", waits)
    begun = studio.client.post(f"/api/sessions/{SESSION}/fit-subject", json={}).json()
    listed = studio.client.get("/api/jobs", params={"session": SESSION, "kind": "subject"}).json()["jobs"]
    [line] = listed
    assert line["at"] == f"/api/subject-fits/{begun['identifier']}"
    assert line["page"] == f"/way?session={SESSION}&step=subject"
    assert studio.client.get("/api/jobs", params={"session": "other"}).json()["jobs"] == []
    assert studio.client.delete(f"/api/jobs/subject/{line['key']}").status_code == 202
    assert studio.ended(f"/api/subject-fits/{begun['identifier']}")["state"] == "cancelled"
    assert studio.client.delete("/api/jobs/subject/none").status_code == 404
    # Another height makes a fit's answer void.
    assert studio.client.put(f"/api/sessions/{SESSION}/subject", json={"height_mm": 1700}).is_success
    assert studio.client.get("/api/jobs").json()["jobs"] == []
