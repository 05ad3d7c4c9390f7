"""The guided set-up over the API: a session that begins empty, footage added to it, how far it is."""

import shutil
from pathlib import Path

import pytest
from web_doubles import Studio


def steps(studio: Studio, name: str) -> dict[str, dict]:
    """Step to how it stands."""
    return {one["step"]: one for one in studio.get(f"/api/sessions/{name}/way")["steps"]}


@pytest.fixture
def empty(studio: Studio) -> str:
    """The name of a session that begins empty."""
    answer = studio.post("/api/sessions", {"name": "mine", "title": "My take"}, code=201)
    return answer["name"]


def bare(source: Path, folder: Path) -> Path:
    """The source's pictures alone."""
    shutil.copytree(source / "pictures", folder / "pictures")
    return folder


def test_an_empty_session_is_listed_with_its_next_step(studio: Studio, empty: str) -> None:
    line = next(one for one in studio.get("/api/sessions")["sessions"] if one["name"] == empty)
    assert (line["title"], line["cameras"], line["next_step"]) == ("My take", 0, "footage")
    detail = studio.get(f"/api/sessions/{empty}")
    assert (detail["cameras"], detail["frame_count"], detail["next_step"]) == ([], 0, "footage")
    response = studio.get(f"/api/sessions/{empty}/way")
    assert response["next"] == "footage"
    assert [one["state"] for one in response["steps"]] == ["ready"] + ["blocked"] * 7


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "thumbnail.jpg"),
        ("GET", "frames/0/views/cam1.jpg"),
        ("GET", "masks/quality"),
        ("POST", "runs"),
        ("POST", "initialise"),
        ("PATCH", "footage"),
        ("GET", "footage/cam1/0.jpg"),
    ],
)
def test_nothing_asked_of_an_empty_session_breaks_the_server(
    studio: Studio, empty: str, method: str, path: str
) -> None:
    answer = studio.client.request(
        method, f"/api/sessions/{empty}/{path}", json=None if method == "GET" else {}
    )
    assert answer.status_code < 500, answer.text
    if not answer.is_success:
        assert answer.json()["message"]
        assert answer.json()["hint"]


def test_names_are_refused_that_are_taken_or_no_names(studio: Studio, empty: str) -> None:
    studio.post("/api/sessions", {"name": empty}, code=409)
    studio.post("/api/sessions", {"name": "../x"}, code=422)
    studio.post("/api/sessions", {"name": "other", "body": "no-such"}, code=422)


def test_footage_is_added_and_the_way_goes_on(studio: Studio, empty: str, source: Path) -> None:
    folder = bare(source, source.parent / "bare")
    request = {"source": str(folder), "fps": 30}
    answer = studio.post(f"/api/sessions/{empty}/footage", request, code=202)
    response = studio.ended(f"/api/imports/{answer['identifier']}")
    assert response["state"] == "done", response
    found = steps(studio, empty)
    assert found["footage"]["state"] == "done"
    assert found["footage"]["words"] == "2 cameras, 4 frames, 30 fps"
    assert found["calibration"]["state"] == "ready"
    assert found["track"]["why"] == "It needs a calibration."
    picture = studio.client.get(f"/api/sessions/{empty}/footage/cam1/2.jpg", params={"height": 32})
    assert picture.headers["content-type"] == "image/jpeg"
    studio.get(f"/api/sessions/{empty}/footage/cam1/99.jpg", code=404)
    turned = studio.patch(f"/api/sessions/{empty}/footage", {"rotations": {"cam1": 90}})
    assert (turned["cameras"][0]["width"], turned["cameras"][0]["height"]) == (64, 96)
    refused = studio.post(f"/api/sessions/{empty}/runs", {}, code=409)
    assert "no calibration yet" in refused["message"]


def test_recorded_times_give_offsets_that_nobody_applies(studio: Studio) -> None:
    lines = ["cam_id,frame_index,frame_time"]
    for frame in range(4):
        lines += [f"cam1,{frame},{frame / 30:.6f}", f"cam2,{frame},{(frame - 1) / 30:.6f}"]
    answer = studio.post("/api/sessions/take1/footage/times", content="\n".join(lines))
    assert answer["offsets"] == {"cam1": 0, "cam2": 1}
    assert [one["offset"] for one in studio.get("/api/sessions/take1/footage")["cameras"]] == [
        0,
        0,
    ]


def test_evaluations_are_turned_into_knobs(studio: Studio) -> None:
    response = studio.get("/api/evaluations", params={"tracker": "annealed", "evaluations": 2000})
    assert response == {"layers": 10, "particles": 200}
    studio.get("/api/evaluations", params={"tracker": "x", "evaluations": 5}, code=422)
