"""Models learnt over the API: from runs and uploads, with progress, one at a time, cancelled and refused in words."""

import io
import zipfile

import pytest
from swaying_person import swaying
from web_doubles import Studio

from studio.foundations.knobs import knobs_of
from studio.runs.behaviour_models import models_folder
from studio.runs.learning.oversampling import OversamplingSettings
from studio.search.behaviour.settings import LearningSettings
from studio.sessions.stored_run import StoredRun

FEW = {"most_clusters": 6, "reduced_dimensions": 3, "memory": 3, "smoothings": 2}


def begin(studio: Studio, **request: object):
    return studio.client.post("/api/learning", json={"name": "sway", "body": "human31", **request})


def test_the_form_is_reported_every_knob_once(studio: Studio) -> None:
    response = studio.get("/api/learning")
    wanted = [entry.name for kind in (LearningSettings, OversamplingSettings) for entry in knobs_of(kind)]
    assert [entry["name"] for entry in response["knobs"]] == wanted
    assert response["default_body"] in response["bodies"]
    assert ".bvh" in response["endings"]
    assert response["progress"] is None


@pytest.mark.slow
@pytest.mark.parametrize("archive", [pytest.param(False, marks=pytest.mark.slow), True])
def test_uploaded_motion_becomes_a_model(studio: Studio, tmp_path, archive: bool) -> None:
    content, name = swaying(tmp_path).read_bytes(), "motion/sway.trc"
    if archive:
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as made:
            made.writestr(name, content)
        content, name = packed.getvalue(), "motion.zip"
    upload = studio.upload({name: content})
    answer = begin(studio, upload=upload, settings=FEW)
    assert answer.status_code == 202, answer.text
    assert begin(studio, name="other", sources=["walk"]).status_code == 409, "one at a time"
    response = studio.ended("/api/learning", "progress")
    assert response["state"] == "done", response
    (line,) = studio.get("/api/behaviours")["models"]
    assert (line["name"], line["body"], line["memory"]) == ("sway", "human31", 3)
    assert line["sources"] == ["sway"]
    assert response["learnt"]["clusters"] == line["clusters"]
    assert response["learnt"]["states"] == line["states"]
    studio.get(f"/api/uploads/{upload}", code=404)
    assert begin(studio, sources=["walk"]).status_code == 422, "the name is taken"


@pytest.mark.slow
def test_what_goes_wrong_inside_is_reported_in_words(studio: Studio, tracked: StoredRun) -> None:
    answer = begin(studio, sources=["take1/first"])
    assert answer.status_code == 202, answer.text
    response = studio.ended("/api/learning", "progress")
    assert response["state"] == "failed"
    assert "take1/first" in response["message"]
    assert "frames" in response["message"] + response["hint"]
    assert studio.get("/api/behaviours")["models"] == []


def test_cancelled_nothing_is_kept(studio: Studio) -> None:
    studio.delete("/api/learning", code=404)
    assert begin(studio, sources=["walk"]).status_code == 202
    studio.delete("/api/learning", code=202)
    assert studio.ended("/api/learning", "progress")["state"] == "cancelled"
    folder = models_folder(studio.workspace.root)
    assert not folder.is_dir() or not list(folder.iterdir())
    assert begin(studio, sources=["walk"]).status_code == 202, "and another one can begin"
    studio.delete("/api/learning")
    studio.ended("/api/learning", "progress")


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        ({}, 422),
        ({"sources": ["/etc/passwd"]}, 422),
        ({"sources": ["../take1/first"]}, 422),
        ({"sources": ["take1/none"]}, 404),
        ({"sources": ["nothing"]}, 404),
        ({"sources": ["walk"], "settings": {"memory": 101}}, 422),
        ({"sources": ["walk"], "settings": {"memery": 1}}, 422),
        ({"sources": ["walk"], "name": "../x"}, 422),
        ({"sources": ["walk"], "body": "nobody"}, 422),
        ({"sources": ["walk"], "upload": "nothing"}, 404),
    ],
)
def test_refusals(studio: Studio, sent: dict, status: int) -> None:
    answer = begin(studio, **sent)
    assert answer.status_code == status, answer.text
    assert answer.json()["message"]
    assert studio.get("/api/learning")["progress"] is None


def test_an_upload_without_motion_is_refused(studio: Studio) -> None:
    upload = studio.upload({"notes.txt": b"nothing that moves"})
    answer = begin(studio, upload=upload)
    assert answer.status_code == 422
    assert "no motion" in answer.json()["message"]
