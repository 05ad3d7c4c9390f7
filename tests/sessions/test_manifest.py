"""Manifests come back as written and are refused in words."""

import json
from pathlib import Path

import pytest

from studio.foundations.errors import NotFoundError, SessionError
from studio.sessions.manifest import FILE_NAME, read_manifest
from studio.sessions.session import Session


def test_comes_back_as_written(session_on_disk: Session) -> None:
    manifest = read_manifest(session_on_disk.path)
    assert manifest == session_on_disk.manifest
    assert (manifest.fps, manifest.frame_count) == (60.0, 8)
    assert manifest.footage.cameras[0].masks == "masks/front"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema": 99}, "schema version 99"),
        ({"colour": "red"}, "colour"),
        ({"footage": {"fps": "fast", "frame_count": 3, "cameras": []}}, "fps"),
        ({"body": None}, "body"),
    ],
)
def test_wrong_entries_are_named(session_on_disk: Session, change: dict, words: str) -> None:
    path = session_on_disk.path / FILE_NAME
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(SessionError, match=words) as caught:
        read_manifest(session_on_disk.path)
    assert caught.value.hint


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b'{"schema": "one"}'])
def test_what_is_no_manifest_is_refused(session_on_disk: Session, content: bytes) -> None:
    (session_on_disk.path / FILE_NAME).write_bytes(content)
    with pytest.raises(SessionError):
        read_manifest(session_on_disk.path)


def test_a_folder_without_one_is_no_session(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match="no session"):
        Session(tmp_path)
