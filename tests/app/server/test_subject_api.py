"""The person and the masks over the API. The searches themselves are tested in tests/runs and tests/trackers."""

import threading
import time
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from waiting import PATIENCE
from web_doubles import Studio

from studio.foundations.errors import RunError, SettingsError
from studio.operations import person
from studio.operations.person import subject as write_subject
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
    studio.put(f"/api/sessions/{name}/subject", {"height_mm": 1800})
    monkeypatch.setattr(person, "fit_session_subject", answer)
    begun = studio.post(f"/api/sessions/{name}/fit-subject", {"count": 2}, code=202)
    response = studio.ended(f"/api/subject-fits/{begun['identifier']}")
    assert response["state"] == "done"
    assert response["sizes"][0]["after"] == 425.0
    assert response["file"] == "subject.toml"
    folder = studio.workspace.session(name).path
    assert (folder / "subject-before.toml").exists()


def test_a_failure_and_a_cancellation_are_in_words(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> FittedSubject:
        raise RunError("Nothing is to be seen.", "Look at the masks.")

    monkeypatch.setattr(person, "fit_session_subject", fails)
    begun = studio.post(f"/api/sessions/{SESSION}/fit-subject", {})
    assert studio.ended(f"/api/subject-fits/{begun['identifier']}")["message"] == "Nothing is to be seen."

    def waits(*_: object, progress: Callable[[str, int, int], None], **__: object) -> FittedSubject:
        while True:
            progress("fitting", 0, 1)
            time.sleep(0.01)

    monkeypatch.setattr(person, "fit_session_subject", waits)
    begun = studio.post(f"/api/sessions/{SESSION}/fit-subject", {})
    identifier = begun["identifier"]
    studio.delete(f"/api/subject-fits/{identifier}", code=202)
    assert studio.ended(f"/api/subject-fits/{identifier}")["code"] == "cancelled"


def test_a_height_gives_every_length(studio: Studio) -> None:
    place = f"/api/sessions/{SESSION}/subject"
    small = studio.put(place, {"height_mm": 1600, "body": "human31"})["dimensions"]
    tall = studio.put(place, {"height_mm": 2000, "body": "human31"})
    assert tall["height_mm"] == 2000
    assert tall["dimensions"]["left_thigh_length"] == pytest.approx(0.245 * 2000)
    assert small["left_thigh_length"] == pytest.approx(0.245 * 1600)
    refused = studio.put(place, {"height_mm": 164.5}, code=422)
    assert "'height_mm': 164.5 mm is not from 300 to 3000 mm. It looks like centimetres: write 1645" in str(
        refused
    )
    with pytest.raises(SettingsError, match="It looks like centimetres"):
        write_subject(studio.workspace.session(SESSION), 164.5)


@pytest.mark.parametrize("kind", ["exclusions", "in_front"])
def test_regions_of_a_camera_are_painted(studio: Studio, kind: str) -> None:
    source = studio.workspace.session(SESSION).manifest.footage.cameras[0]
    painted = np.zeros((source.height, source.width), np.uint8)
    painted[:, : source.width // 2] = 255
    place = f"/api/sessions/{SESSION}/{kind}/{source.name}"
    studio.get(place, code=404)
    content = cv2.imencode(".png", painted)[1].tobytes()
    response = studio.put(place, content=content)
    assert response["pixels"] == source.height * (source.width // 2)
    kept = cv2.imdecode(np.frombuffer(studio.client.get(place).content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert (kept == painted).all()
    wrong = cv2.imencode(".png", painted[1:])[1].tobytes()
    studio.put(place, content=wrong, code=422)
    studio.put(place, content=b"no picture", code=422)
    assert studio.put(place, content=b"")["pixels"] == 0
    studio.get(place, code=404)


def test_the_sessions_knobs_are_those_of_its_masks(studio: Studio) -> None:
    place = f"/api/sessions/{SESSION}/evidence"
    assert studio.get(place) == {"knobs": {}}
    studio.put(place, {"mask_threshold": 7.0})
    assert studio.get(place)["knobs"] == {"mask_threshold": 7.0}
    studio.put(place, {"mask_threshold": 7000.0}, code=422)
    studio.put(place, {"no_such_knob": 1}, code=422)


def test_a_preview_takes_knobs_and_changes_nothing(studio: Studio) -> None:
    source = studio.workspace.session(SESSION).manifest.footage.cameras[0]
    view = f"/api/sessions/{SESSION}/frames/0/views/{source.name}.jpg?show=mask"
    usual = studio.client.get(view)
    assert usual.status_code == 200
    studio.get(view, params={"show": "mask", "settings": '{"mask_min_component": 100000}'})
    assert studio.client.get(view).content == usual.content
    studio.get(view, params={"show": "mask", "settings": "no json"}, code=422)


def test_a_fit_shows_the_poses_that_it_has(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    go, looked = threading.Event(), threading.Event()

    def fits(session: Session, request: FitRequest, shown: Shown, **_: object) -> FittedSubject:
        shown(session.body(), (2,), session.body().neutral[None])
        looked.set()
        go.wait(PATIENCE)
        return answer(session, request)

    studio.put(f"/api/sessions/{SESSION}/subject", {"height_mm": 1800})
    monkeypatch.setattr(person, "fit_session_subject", fits)
    begun = studio.post(f"/api/sessions/{SESSION}/fit-subject", {"keep": False})
    try:
        assert looked.wait(PATIENCE)
        place = f"/api/subject-fits/{begun['identifier']}"
        state = studio.get(place)
        assert (state["frames"], state["looks"]) == ([2], 1)
        assert studio.client.get(f"{place}/frames/2/views/cam1.jpg").headers["content-type"] == "image/jpeg"
        studio.get(f"{place}/frames/3/views/cam1.jpg", code=404)
    finally:
        go.set()
    assert studio.ended(f"/api/subject-fits/{begun['identifier']}")["frames"] == [3, 7]


def test_all_work_is_listed_and_stopped_by_its_name(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    def waits(*_: object, progress: Callable[[str, int, int], None], **__: object) -> FittedSubject:
        while True:
            progress("fitting", 1, 4)
            time.sleep(0.01)

    monkeypatch.setattr(person, "fit_session_subject", waits)
    begun = studio.post(f"/api/sessions/{SESSION}/fit-subject", {})
    listed = studio.get("/api/jobs", params={"session": SESSION, "kind": "subject"})["jobs"]
    [line] = listed
    assert line["at"] == f"/api/subject-fits/{begun['identifier']}"
    assert line["page"] == f"/way?session={SESSION}&step=subject"
    assert studio.get("/api/jobs", params={"session": "other"})["jobs"] == []
    studio.delete(f"/api/jobs/subject/{line['key']}", code=202)
    assert studio.ended(f"/api/subject-fits/{begun['identifier']}")["state"] == "cancelled"
    studio.delete("/api/jobs/subject/none", code=404)
    # Another height makes a fit's answer void.
    studio.put(f"/api/sessions/{SESSION}/subject", {"height_mm": 1700})
    assert studio.get("/api/jobs")["jobs"] == []
