"""Start poses found over the API: progress, result, file, refusals. The search itself is tested in tests/runs."""

import threading
import time
from collections.abc import Callable

import numpy as np
import pytest
from waiting import PATIENCE
from web_doubles import Studio

from studio.body.model import BodyModel
from studio.foundations.errors import RunError
from studio.operations import person
from studio.runs.search_space import parameter_names
from studio.runs.setup.initialising import InitialPose
from studio.sessions.session import Session

Tell = Callable[[str, int, int], None]


def found_in(session: Session, frame: int, body: BodyModel) -> InitialPose:
    """A pose that somebody found; in frame 1 it is doubtful."""
    return InitialPose(
        frame=frame,
        body=body.name,
        names=parameter_names(body),
        pose=body.neutral + 0.25,
        confidence=0.5 if frame == 1 else 0.9,
        margin=float("inf"),
        rival=None,
        agreement=1.0,
        overlap=float("nan"),
        hull_litres=80.0,
        evaluations=10,
        note="a note",
    )


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """The search replaced by an answer; what it was asked."""
    asked: dict[str, object] = {}

    def initialise(session: Session, frame: int, **request: object) -> InitialPose:
        asked.update(request, frame=frame)
        tell = request["progress"]
        assert callable(tell)
        tell("searching for the pose", 3, 10)
        body = request["body"]
        assert isinstance(body, BodyModel)
        return found_in(session, frame, body)

    monkeypatch.setattr(person, "initialise_session", initialise)
    return asked


def test_what_is_found_is_reported_kept_and_shown(studio: Studio, session: Session, quick: dict) -> None:
    before = (session.path / "start_pose.csv").read_text()
    answer = studio.post("/api/sessions/take1/initialise", {"frame": 2, "seed": 5}, code=202)
    response = studio.ended(f"/api/initialisations/{answer['identifier']}")
    assert response["state"] == "done", response
    assert (quick["frame"], quick["seed"]) == (2, 5)
    neutral = session.body().neutral
    assert np.allclose(response["pose"], neutral + 0.25)
    assert (response["confidence"], response["margin"], response["overlap"]) == (0.9, None, None)
    assert response["unsure"] is False
    assert (response["done"], response["total"], response["note"]) == (3, 10, "a note")
    assert response["file"] == "start_pose-frame-2.csv"
    assert (session.path / response["file"]).is_file()
    assert (session.path / "start_pose.csv").read_text() == before
    shown = [call for call in studio.stage.calls if call[0] == "pose"]
    assert shown[0][1] == "take1"
    pose = shown[0][2]
    assert isinstance(pose, tuple)
    assert np.allclose(pose, neutral + 0.25)
    assert "90 %" in str(shown[0][3])
    assert shown[0][4] == 2


def test_a_doubtful_pose_is_called_so(studio: Studio, quick: dict) -> None:
    answer = studio.post("/api/sessions/take1/initialise", {"frame": 1}, code=202)
    response = studio.ended(f"/api/initialisations/{answer['identifier']}")
    assert (response["confidence"], response["unsure"]) == (0.5, True)


def test_replacing_keeps_the_old_pose_beside_the_new_one(
    studio: Studio, session: Session, quick: dict
) -> None:
    before = (session.path / "start_pose.csv").read_text()
    response = studio.post("/api/sessions/take1/initialise", {"replace": True})
    assert studio.ended(f"/api/initialisations/{response['identifier']}")["file"] == "start_pose.csv"
    stored = session.start_pose()
    assert stored is not None
    assert np.allclose(stored, session.body().neutral + 0.25)
    assert (session.path / "start_pose-before.csv").read_text() == before


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        ({"frame": 99}, 409),
        ({"weighting": "none-such"}, 422),
        ({"body": "nobody"}, 422),
        ({"frame": -1}, 422),
    ],
)
def test_refusals(studio: Studio, quick: dict, sent: dict, status: int) -> None:
    studio.post("/api/sessions/take1/initialise", sent, code=status)
    assert not quick


def test_failure_is_reported_in_words(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> InitialPose:
        raise RunError("Nothing is to be seen.", "Choose another frame.")

    monkeypatch.setattr(person, "initialise_session", fails)
    response = studio.post("/api/sessions/take1/initialise", {})
    response = studio.ended(f"/api/initialisations/{response['identifier']}")
    assert (response["state"], response["message"], response["hint"]) == (
        "failed", "Nothing is to be seen.", "Choose another frame.",
    )  # fmt: skip


def test_a_search_can_be_cancelled(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    begun = threading.Event()

    def waits(*_: object, progress: Tell, **__: object) -> InitialPose:
        begun.set()
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            progress("searching", 0, 1)
        raise AssertionError("it was not stopped")

    monkeypatch.setattr(person, "initialise_session", waits)
    identifier = studio.post("/api/sessions/take1/initialise", {})["identifier"]
    assert begun.wait(PATIENCE)
    studio.delete(f"/api/initialisations/{identifier}", code=202)
    assert studio.ended(f"/api/initialisations/{identifier}")["code"] == "cancelled"
    studio.get("/api/initialisations/none", code=404)
