"""Which addresses a camera can have, and that passwords are never shown."""

from pathlib import Path

import pytest

from studio.footage.capture.camera_addresses import (
    address_from_text,
    camera_address,
    check_names,
    without_own,
)
from studio.foundations.errors import FootageError


@pytest.mark.parametrize(
    ("place", "kind"),
    [
        ("http://10.0.0.7:8080/video", "http"),
        ("https://camera.local/stream", "http"),
        ("rtsp://192.168.1.5/h264", "rtsp"),
        ("/dev/video2", "usb"),
    ],
)
def test_what_cameras_have(place: str, kind: str) -> None:
    found = address_from_text(f"cam1={place}")
    assert (found.name, found.kind, found.url) == ("cam1", kind, place)


@pytest.mark.parametrize(
    "place",
    [
        "file:///etc/passwd",
        "FILE:/etc/passwd",
        "concat:a|b",
        "ftp://camera/x",
        "gopher://127.0.0.1/",
        "subfile:,,start,0,end,9,,:/etc/passwd",
        "data:text/plain,x",
        "pipe:0",
        "http://",
        "http://[::1",
        "http://a:99999/",
        "/dev/sda",
        "/dev/video0/../../etc/passwd",
        "http://a/\r\nHost: b",
        "",
        "http://a/" + "x" * 3000,
    ],
)
def test_what_none_has_is_refused(place: str) -> None:
    with pytest.raises(FootageError) as caught:
        camera_address("cam1", place)
    assert caught.value.hint


def test_files_are_read_only_for_who_may(tmp_path: Path) -> None:
    path = tmp_path / "walk.mp4"
    path.write_bytes(b"x")
    with pytest.raises(FootageError):
        camera_address("cam1", str(path))
    assert camera_address("cam1", str(path), replays=True).kind == "replay"
    with pytest.raises(FootageError, match="no video"):
        camera_address("cam1", str(tmp_path / "other.mp4"), replays=True)
    with pytest.raises(FootageError):
        camera_address("cam1", f"file://{path}", replays=True)


def test_passwords_are_not_shown() -> None:
    found = camera_address("cam1", "rtsp://root:geheim@10.0.0.2:554/live?key=4711")
    assert found.shown == "rtsp://10.0.0.2:554/live?…"
    assert "geheim" not in repr(found)
    assert "4711" not in repr(found)
    assert found.url.startswith("rtsp://root:geheim@")


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "[::1]", "0.0.0.0", "127.1.2.3"])
def test_the_studio_does_not_connect_to_itself(host: str) -> None:
    with pytest.raises(FootageError, match="no camera"):
        without_own(camera_address("cam1", f"http://{host}:8642/"), (8642,))
    without_own(camera_address("cam1", f"http://{host}:8081/"), (8642,))


def test_keys_of_hosting_companies_are_not_requested() -> None:
    with pytest.raises(FootageError, match="no camera"):
        without_own(camera_address("cam1", "http://169.254.169.254/latest/meta-data"), ())


def test_a_machine_that_is_not_there_is_named() -> None:
    with pytest.raises(FootageError, match=r"no machine 'camera\.invalid'"):
        without_own(camera_address("cam1", "http://camera.invalid/"), ())


def test_names_and_cameras_are_given_once() -> None:
    one, other = camera_address("cam1", "/dev/video0"), camera_address("cam2", "/dev/video0")
    with pytest.raises(FootageError, match="twice"):
        check_names((one, other))
    with pytest.raises(FootageError, match="twice"):
        check_names((one, camera_address("cam1", "/dev/video1")))
    for wrong in ("http://a/", "cam 1=http://a/", "../x=/dev/video0"):
        with pytest.raises(FootageError):
            address_from_text(wrong)
