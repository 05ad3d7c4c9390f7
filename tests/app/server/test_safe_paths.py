"""Nothing that comes from outside leads out of where it belongs."""

import http.client
import os
from pathlib import Path

import pytest
from web_doubles import Studio, cookie_header

from studio.app.server.safe_paths import default_footage_roots, folder_to_import
from studio.foundations.errors import NotFoundError
from studio.sessions.names import PathRefused, place_in, relative_path

WRONG_NAMES = [
    "", ".", "..", "../a", "a/../b", "/etc/passwd", "a//b", "a/", "a\\b", "..\\a", "C:a", "C:/a", "a\0b", "a\nb",
    "con", "CON.txt", "a/nul", "lpt1.mp4", "x" * 201, "a/" * 9 + "b", "y" * 1001, "a.", "a ", "a?", "é" * 120,
]  # fmt: skip


@pytest.mark.parametrize("name", WRONG_NAMES)
def test_names_that_lead_out_or_cannot_be_everywhere_are_refused(name: str) -> None:
    with pytest.raises(PathRefused):
        relative_path(name)


@pytest.mark.parametrize(
    "name", ["a.mp4", "videos/cam 1.mp4", "Ünïcode/größe.png", "a..b", "..a", "contact.txt"]
)
def test_ordinary_names_are_taken_as_they_are(name: str) -> None:
    assert relative_path(name).as_posix() == name


def test_a_link_inside_an_upload_does_not_lead_out(tmp_path: Path) -> None:
    root = tmp_path / "upload"
    root.mkdir()
    (root / "out").symlink_to(tmp_path)
    with pytest.raises(PathRefused):
        place_in(root, relative_path("out/stolen"))
    assert place_in(root, relative_path("in/kept")) == (root / "in" / "kept").resolve()


def test_only_folders_under_the_roots_may_be_imported(tmp_path: Path) -> None:
    root, sibling = tmp_path / "rec", tmp_path / "rec-evil"
    (root / "take").mkdir(parents=True)
    sibling.mkdir()
    (root / "link").symlink_to(sibling)
    roots = (root.resolve(),)
    assert folder_to_import(str(root / "take"), roots) == (root / "take").resolve()
    wrong = [
        "",
        "take",
        str(sibling),
        str(root / "link"),
        f"{root}/../rec-evil",
        "/",
        "/etc",
        f"{root}\0",
        "~",
    ]
    for text in wrong:
        with pytest.raises(PathRefused):
            folder_to_import(text, roots)
    with pytest.raises(NotFoundError):
        folder_to_import(str(root / "none"), roots)
    with pytest.raises(PathRefused):
        folder_to_import(str(root), ())


def test_footage_roots_never_hold_the_whole_disk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir("/")
    monkeypatch.setenv("STUDIO_FOOTAGE_ROOTS", os.pathsep.join([str(tmp_path), "/", "/does/not/exist"]))
    roots = default_footage_roots(tmp_path)
    assert tmp_path.resolve() in roots
    assert Path("/") not in roots


@pytest.mark.parametrize(
    "name",
    [
        "%2e%2e", "%2e%2e%2ftake1", "..%5c", "take1%5c", "%2fetc", "take1%00", "x" * 65, "nul", "con", "a b",
        "take1%2f..%2ftake1", ".studio", ".trash", "%ff",
    ],
)  # fmt: skip
def test_session_and_run_names_in_addresses(studio: Studio, name: str) -> None:
    for path in (
        f"/api/sessions/{name}",
        f"/api/sessions/take1/runs/{name}",
        f"/api/sessions/{name}/thumbnail.jpg",
    ):
        answer = studio.client.get(path)
        assert answer.status_code in (404, 422), path
        assert answer.json()["message"]


def test_dots_that_a_client_does_not_clean_up(studio: Studio) -> None:
    host, port = studio.base.removeprefix("http://").split(":")
    for path in (
        "/api/sessions/..",
        "/api/sessions/../../etc",
        "/api/sessions/take1/runs/..",
        "/assets/../x.py",
    ):
        connection = http.client.HTTPConnection(host, int(port), timeout=20)
        try:
            connection.putrequest("GET", path)
            connection.putheader("cookie", cookie_header(studio.client))
            connection.endheaders()
            assert connection.getresponse().status in (404, 422), path
        finally:
            connection.close()


def test_a_session_that_is_a_link_out_of_the_workspace_is_not_served(studio: Studio, imported: Path) -> None:
    (studio.workspace.root / "outside").symlink_to(imported)
    answer = studio.get("/api/sessions/outside", code=404)
    assert "leads out" in answer["message"]


@pytest.mark.parametrize(
    "path",
    [
        "/assets/../index.html", "/assets/%2e%2e/pyproject.toml", "/assets/..%2f..%2fpyproject.toml",
        "/assets/%2fetc/passwd", "/assets/..\\pyproject.toml", "/assets/tokens.css%00.js",
    ],
)  # fmt: skip
def test_assets_lead_nowhere_else(studio: Studio, path: str) -> None:
    answer = studio.client.get(path)
    assert answer.status_code == 404
    assert "[project]" not in answer.text
