"""Importing by path and by upload, through the API."""

import io
import zipfile
from pathlib import Path

import httpx
import pytest
from web_doubles import Studio, cookie_header

from studio.app.server import body_limit, upload_routes
from studio.foundations.progress import Progress
from studio.operations import footage


def imported(studio: Studio, **request: object) -> dict:
    """Begin an import and wait for its end."""
    answer = studio.post("/api/imports", request, code=202)
    return studio.ended(f"/api/imports/{answer['identifier']}")


def files_of(source: Path, prefix: str = "") -> dict[str, bytes]:
    """All files of a folder by their names inside it."""
    return {
        prefix + path.relative_to(source).as_posix(): path.read_bytes()
        for path in source.rglob("*")
        if path.is_file()
    }


def test_a_folder_of_this_machine_is_imported(studio: Studio, source: Path) -> None:
    response = imported(studio, name="second", source=str(source), fps=30)
    assert response["state"] == "done", response
    assert {match["camera"] for match in response["matching"]} == {"cam1", "cam2"}
    assert studio.workspace.session("second").manifest.fps == 30.0
    names = [entry["name"] for entry in studio.get("/api/sessions")["sessions"]]
    assert names == ["second", "take1"]


def test_what_went_wrong_is_reported_in_words_and_leaves_nothing(studio: Studio, source: Path) -> None:
    empty = source.parent / "empty"
    empty.mkdir(exist_ok=True)
    response = imported(studio, name="second", source=str(empty))
    assert response["state"] == "failed"
    assert response["message"]
    assert response["hint"]
    assert not (studio.workspace.root / "second").exists()


def test_names_taken_and_places_forbidden_are_refused_at_once(studio: Studio, source: Path) -> None:
    for request, status in (
        ({"name": "take1", "source": str(source)}, 409),
        ({"name": "a/b", "source": str(source)}, 422),
        ({"name": "x", "source": "/etc"}, 422),
        ({"name": "x"}, 422),
        ({"name": "x", "source": str(source), "upload": "y"}, 422),
        ({"name": "x", "upload": "none"}, 404),
        ({"name": "x", "upload": "../../.."}, 422),
        ({"name": "x", "source": str(source), "calibration": "/etc/passwd"}, 422),
        ({"name": "x", "source": str(source), "fps": -1}, 422),
        ({"name": "x", "source": str(source), "unknown": 1}, 422),
    ):
        answer = studio.client.post("/api/imports", json=request)
        assert answer.status_code == status, (request, answer.text)
        assert set(answer.json()) == {"code", "message", "hint", "status"}


@pytest.mark.parametrize("prefix", ["", "my take/"])
def test_an_uploaded_folder_is_imported_and_the_upload_removed(
    studio: Studio, source: Path, prefix: str
) -> None:
    identifier = studio.upload(files_of(source, prefix) | {f"{prefix}.DS_Store": b"x"})
    response = imported(studio, name="sent", upload=identifier, fps=25)
    assert response["state"] == "done", response
    sent = studio.workspace.session("sent")
    with_pictures = sent.footage()
    assert with_pictures.frame_count == 4
    with_pictures.close()
    studio.get(f"/api/uploads/{identifier}", code=404)


def test_an_uploaded_zip_is_unpacked(studio: Studio, source: Path) -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in files_of(source, "take/").items():
            archive.writestr(name, content)
    response = imported(studio, name="zipped", upload=studio.upload({"take.zip": stream.getvalue()}), fps=25)
    assert response["state"] == "done", response


def test_a_bad_zip_is_refused_in_words(studio: Studio) -> None:
    response = imported(studio, name="zipped", upload=studio.upload({"take.zip": b"PK no zip"}), fps=25)
    assert response["state"] == "failed"
    assert response["code"] == "archive"


def test_a_broken_upload_goes_on_where_it_stopped(studio: Studio) -> None:
    identifier = studio.upload({"a.bin": b"0123"})
    place = f"/api/uploads/{identifier}/files"
    answer = studio.put(place, params={"path": "a.bin", "offset": 4}, content=b"4567")
    assert answer == {"path": "a.bin", "received": 8, "total": 8}
    gap = studio.put(place, params={"path": "a.bin", "offset": 99}, content=b"x", code=409)
    assert "8 bytes" in gap["message"]
    state = studio.get(f"/api/uploads/{identifier}")
    assert state["files"] == {"a.bin": 8}
    again = studio.put(place, params={"path": "a.bin"}, content=b"new")
    assert again["total"] == 3
    file = studio.workspace.root / ".studio" / "uploads" / identifier / "a.bin"
    assert file.read_bytes() == b"new"
    studio.delete(f"/api/uploads/{identifier}", code=204)
    assert not file.exists()


@pytest.mark.parametrize("path", ["../a", "/a", "a\\b", "a\0", "con", "", "x" * 1200])
def test_uploads_stay_in_their_folder(studio: Studio, path: str) -> None:
    identifier = studio.post("/api/uploads")["identifier"]
    answer = studio.put(f"/api/uploads/{identifier}/files", params={"path": path}, content=b"x", code=422)
    assert answer["code"] == "path"


def test_the_server_counts_what_arrives(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit holds for a body without a Content-Length, and over all files of an upload."""
    monkeypatch.setattr(upload_routes, "LIMIT", 1000)
    identifier = studio.upload({"first.bin": bytes(600)})

    def endless():
        while True:
            yield bytes(100)

    place = f"/api/uploads/{identifier}/files"
    try:
        answer = studio.client.put(place, params={"path": "b.bin"}, content=endless())
    except httpx.HTTPError:
        pass  # the server hung up on an endless body, which is as good
    else:
        assert answer.status_code == 413
    file = studio.workspace.root / ".studio" / "uploads" / identifier / "b.bin"
    assert file.stat().st_size <= 400


def test_json_bodies_have_a_limit_too(studio: Studio) -> None:
    big = b'{"name": "' + b"x" * body_limit.JSON_LIMIT + b'"}'
    answer = studio.post("/api/imports", content=big, code=413)
    assert answer["code"] == "too-large"
    headers = {"cookie": cookie_header(studio.client), "origin": studio.base}

    def pieces():
        for _ in range(200):
            yield b"x" * 10_000

    streamed = httpx.post(f"{studio.base}/api/imports", content=pieces(), headers=headers)
    assert streamed.status_code == 413


def test_folders_can_be_looked_through_only_under_the_roots(studio: Studio, source: Path) -> None:
    roots = studio.get("/api/folders")["folders"]
    assert roots == [str(source.parent.resolve())]
    inside = studio.get("/api/folders", params={"path": str(source)})
    assert inside["folders"] == ["calibration", "pictures"]
    assert inside["parent"] == roots[0]
    assert studio.get("/api/folders", params={"path": roots[0]})["parent"] == ""
    for path in ("/", "/etc", f"{source}/../../..", "relative"):
        studio.get("/api/folders", params={"path": path}, code=422)


def test_an_import_can_be_cancelled(studio: Studio, source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The importer sees the cancellation at its next report; nothing is left."""

    def slowly(*_: object, progress: Progress):
        while True:
            progress("reading", 1, 2)

    monkeypatch.setattr(footage, "import_source", slowly)
    identifier = studio.post("/api/imports", {"name": "x", "source": str(source)})["identifier"]
    studio.delete(f"/api/imports/{identifier}", code=202)
    response = studio.ended(f"/api/imports/{identifier}")
    assert response["state"] == "cancelled"
    assert "cancelled" in response["message"]
    assert not (studio.workspace.root / "x").exists()


def test_an_unforeseen_fault_of_an_import_is_reported(
    studio: Studio, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object):
        raise ZeroDivisionError("inside")

    monkeypatch.setattr(footage, "import_source", broken)
    response = imported(studio, name="x", source=str(source))
    assert response["state"] == "failed"
    assert "ZeroDivisionError" in response["message"]
    assert str(studio.log_path) in response["hint"]
