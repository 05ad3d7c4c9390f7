"""Live cameras over the API: looked at, recorded; what no camera is, is refused."""

import io
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from mjpeg_streams import Streams, jpeg, served
from web_doubles import Studio

SECRET = "geheim"


@pytest.fixture
def streams() -> Iterator[Streams]:
    rng = np.random.default_rng(5)
    pictures = {
        name: [jpeg(rng.integers(0, 255, (64, 96, 3), dtype=np.uint8)) for _ in range(20)]
        for name in ("cam1", "cam2")
    }
    with served(pictures, 25.0) as made:
        made.going.set()
        yield made


def shown(studio: Studio, streams: Streams) -> dict:
    secret = streams.address("cam1").replace("http://", f"http://root:{SECRET}@")
    request = {
        "cameras": [{"name": "cam1", "address": secret}, {"name": "cam2", "address": streams.address("cam2")}]
    }
    studio.post("/api/cameras/preview", request)
    return studio.when(
        "/api/cameras",
        lambda response: (
            all(one["pictures"] > 5 for one in response["cameras"]) and response["spread"]["sets"]
        ),
    )


def test_cameras_are_looked_at(studio: Studio, streams: Streams) -> None:
    streams.locked.add("cam1")
    response = shown(studio, streams)
    assert [(one["name"], one["state"], one["width"], one["height"]) for one in response["cameras"]] == [
        ("cam1", "running", 96, 64),
        ("cam2", "running", 96, 64),
    ]
    assert response["spread"]["median"] >= 0.0
    assert SECRET not in str(response)
    assert "Basic cm9vdDpnZWhlaW0=" in streams.passwords, "but the camera was told"
    answer = studio.client.get("/api/cameras/cam1.jpg?height=32")
    assert answer.headers["content-type"] == "image/jpeg"
    picture = cv2.imdecode(np.frombuffer(io.BytesIO(answer.content).getvalue(), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (32, 48, 3)
    assert studio.client.get("/api/cameras/cam1.jpg").content in [
        bytes(one) for one in streams.pictures["cam1"]
    ]
    studio.get("/api/cameras/cam7.jpg", code=404)
    closed = studio.post("/api/cameras/preview", {"cameras": []})
    assert closed["cameras"] == []


def test_a_stream_that_stops_is_reported(studio: Studio, streams: Streams) -> None:
    shown(studio, streams)
    streams.silent.add("cam2")
    response = studio.when("/api/cameras", lambda response: response["cameras"][1]["state"] == "stopped")
    assert response["cameras"][0]["state"] == "running"
    assert response["cameras"][1]["age"] >= 1.0
    streams.silent.clear()
    studio.when("/api/cameras", lambda response: response["cameras"][1]["state"] == "running")


@pytest.mark.slow
def test_cameras_are_recorded_into_a_session(studio: Studio, streams: Streams) -> None:
    shown(studio, streams)
    studio.post("/api/recordings/stop", code=404)
    studio.post("/api/recordings", {"name": "take2", "calibration": "take1"}, code=202)
    studio.post("/api/recordings", {"name": "take3", "calibration": "take1"}, code=409)
    studio.post("/api/cameras/preview", {"cameras": []}, code=409)
    studio.when(
        "/api/recordings",
        lambda response: response["step"] == "recording" and response["seconds"] > 0.7,
    )
    studio.post("/api/recordings/stop", code=202)
    response = studio.when("/api/recordings", lambda response: response["state"] in ("done", "failed"))
    assert response["state"] == "done", response
    assert "ms apart" in response["words"]
    made = studio.workspace.session("take2")
    assert [camera.name for camera in made.manifest.footage.cameras] == ["cam1", "cam2"]
    assert made.manifest.frame_count >= 10
    assert not (made.path.parent / "take2.recording").exists()
    studio.post("/api/recordings", {"name": "take2", "calibration": "take1"}, code=409)


@pytest.mark.parametrize(
    ("address", "status"),
    [
        ("file:///etc/passwd", 422),
        ("concat:/etc/passwd|/etc/hosts", 422),
        ("/etc/passwd", 422),
        ("../etc/passwd", 422),
        ("://etc/passwd", 422),
        ("/dev/shm/somebody's.mp4", 422),
        ("/dev/sda", 422),
        ("http://169.254.169.254/latest", 422),
    ],
)
def test_what_is_no_camera_is_refused(studio: Studio, address: str, status: int) -> None:
    answer = studio.post(
        "/api/cameras/preview", {"cameras": [{"name": "cam1", "address": address}]}, code=status
    )
    assert answer["hint"]


def test_the_studio_does_not_look_at_itself(studio: Studio) -> None:
    request = {"cameras": [{"name": "cam1", "address": f"{studio.base}/api/sessions"}]}
    answer = studio.client.post("/api/cameras/preview", json=request)
    assert (answer.status_code, answer.json()["code"]) == (422, "footage")
    assert "no camera" in answer.json()["message"]


def test_nothing_is_recorded_without_cameras_or_of_other_names(studio: Studio, streams: Streams) -> None:
    request = {"name": "take2", "calibration": "take1"}
    studio.post("/api/recordings", request, code=409)
    studio.post("/api/recordings", request | {"name": "../x"}, code=422)
    wrong = {"cameras": [{"name": "left", "address": streams.address("cam1")}]}
    studio.post("/api/cameras/preview", wrong)
    answer = studio.post("/api/recordings", request, code=422)
    assert "Camera left is not in 'cameras.toml'" in answer["message"]
