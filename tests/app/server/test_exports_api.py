"""Exports over the API: what there is to choose, in the background, failing in words, listed, downloaded, deleted."""

import json
import time

import pytest
from web_doubles import Studio

from studio.results.export.formats import FORMATS
from studio.sessions.stored_run import StoredRun

RUN = "/api/sessions/take1/runs/first"


def exported(studio: Studio, form: str, **options: object) -> dict:
    answer = studio.post(f"{RUN}/exports", {"format": form, "options": options}, code=202)
    return studio.ended(f"/api/exports/{answer['identifier']}")


def test_choices_say_what_opens_each_format(studio: Studio) -> None:
    response = studio.get("/api/exports/choices")
    assert [form["name"] for form in response["formats"]] == list(FORMATS)
    assert all(form["opens"].endswith(".") for form in response["formats"])
    names = {option["name"] for option in response["options"]}
    assert all(set(form["takes"]) <= names for form in response["formats"])
    assert response["calibrations"][".toml"][0] == "pose2sim"


def test_a_file_is_made_listed_downloaded_and_deleted(studio: Studio, tracked: StoredRun) -> None:
    response = exported(studio, "bvh", unit="cm")
    assert response["state"] == "done", response
    assert response["result"]["checked"].startswith("read back within")
    file = response["result"]["file"]
    assert file == "take1-first-cm.bvh"
    listed = studio.get(f"{RUN}/exports")
    assert [entry["file"] for entry in listed["exports"]] == [file]
    assert listed["running"] == []
    assert listed["tracks"] == ["raw"]
    assert (listed["best"], listed["exports"][0]["track"]) == ("raw", "raw")
    assert listed["cameras"] == ["cam1", "cam2"]
    answer = studio.client.get(f"{RUN}/exports/{file}")
    assert answer.text.startswith("HIERARCHY")
    assert answer.headers["content-disposition"] == f'attachment; filename="{file}"'
    assert len(answer.content) == response["result"]["bytes"]
    assert (tracked.folder / "exports" / file).is_file()
    studio.delete(f"{RUN}/exports/{file}", code=204)
    assert studio.get(f"{RUN}/exports")["exports"] == []
    studio.get(f"{RUN}/exports/{file}", code=404)


def test_videos_of_all_cameras_come_as_one_zip(studio: Studio, tracked: StoredRun) -> None:
    response = exported(studio, "mp4")
    assert response["state"] == "done", response
    assert response["result"]["file"] == "take1-first-mp4.zip"
    answer = studio.client.get(f"{RUN}/exports/{response['result']['file']}")
    assert answer.content[:2] == b"PK"
    assert exported(studio, "mp4", camera="cam2")["result"]["file"] == "take1-first-cam2.mp4"


def test_the_scene_is_exported_as_a_page(studio: Studio, tracked: StoredRun) -> None:
    response = exported(studio, "html")
    assert response["state"] == "done", response
    answer = studio.client.get(f"{RUN}/exports/{response['result']['file']}")
    assert answer.headers["content-type"] == "application/octet-stream"
    assert answer.headers["content-disposition"].startswith("attachment")


@pytest.mark.parametrize(
    ("sent", "status", "words"),
    [
        ({"format": "fbx"}, 422, "no export format 'fbx'"),
        ({"format": "glb", "options": {"unit": "cm"}}, 422, "means nothing"),
        ({"format": "bvh", "options": {"colour": "red"}}, 422, "no setting 'colour'"),
        ({"format": "bvh", "options": {"fps": "many"}}, 422, "'fps'"),
    ],
)
def test_wrong_requests_are_refused_at_once(
    studio: Studio, tracked: StoredRun, sent: dict, status: int, words: str
) -> None:
    answer = studio.post(f"{RUN}/exports", sent, code=status)
    response = answer
    assert words in response["message"]
    assert response["hint"]


def test_what_fails_later_says_why(studio: Studio, tracked: StoredRun) -> None:
    response = exported(studio, "trc", first=50)
    assert response["state"] == "failed"
    assert response["code"] == "export"
    assert "no frame from 50" in response["message"]
    assert response["hint"]
    assert exported(studio, "trc", track="smooth")["code"] == "not-found"
    assert studio.get(f"{RUN}/exports")["exports"] == []


def test_names_from_outside_lead_nowhere(studio: Studio, tracked: StoredRun) -> None:
    exported(studio, "csv")
    for name in (
        "..%2f..%2frun.json",
        "%2e%2e",
        ".said.json",
        "take1-first.csv.said.json",
        "a%00b",
        "x" * 4000,
    ):
        assert studio.client.get(f"{RUN}/exports/{name}").status_code in (404, 414), name
        assert studio.client.delete(f"{RUN}/exports/{name}").status_code in (404, 405, 414), name
    studio.get("/api/exports/none", code=404)


def test_a_run_without_frames_has_nothing_to_export(studio: Studio, tracked: StoredRun) -> None:
    studio.post("/api/sessions/take1/runs", {"name": "fresh"}, code=201)
    answer = studio.post("/api/sessions/take1/runs/fresh/exports", {"format": "csv"})
    response = studio.ended(f"/api/exports/{answer['identifier']}")
    assert response["state"] == "failed"
    assert "it has none" in response["message"]


def test_an_export_can_be_cancelled(
    studio: Studio, tracked: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scene's recorder goes on until it is told to stop; nothing of it is kept."""

    def endless(task):
        while True:
            task.step("recording", 1, 4)
            time.sleep(0.01)

    monkeypatch.setattr("studio.results.export.exporting.plugged_in", lambda name: endless)
    begun = studio.post(f"{RUN}/exports", {"format": "viser"})
    listed = studio.get(f"{RUN}/exports")
    assert [entry["identifier"] for entry in listed["running"]] == [begun["identifier"]]
    studio.delete(f"/api/exports/{begun['identifier']}", code=202)
    assert studio.ended(f"/api/exports/{begun['identifier']}")["state"] == "cancelled"
    assert list((tracked.folder / "exports").iterdir()) == []


def test_the_export_travels_with_its_report(studio: Studio, tracked: StoredRun) -> None:
    response = exported(studio, "parquet", names="halpe26")
    said = json.loads((tracked.folder / "exports" / f"{response['result']['file']}.said.json").read_text())
    assert said["options"] == {"names": "halpe26"}
    assert any("left out" in note for note in said["notes"])
