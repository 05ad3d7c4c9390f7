"""Calibrating a session over the API: from files, from boards, the floor by clicks; what is in use is kept."""

import dataclasses
import io
import time
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_takes import BOARD, CAMERAS, FLOOR_FRAME, FLOOR_PLACE, render_takes
from nudged_camera import make_nudged_session, true_cameras
from waiting import PATIENCE
from web_doubles import Studio

from studio.footage.calibration.extrinsics import moved_cameras
from studio.footage.capture.calibration_files import export_calibration, read_calibration, write_calibration
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import rigid
from studio.operations import calibration_proposals
from studio.sessions.session import CAMERAS_PATH, Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import begin_session

TAKE = "/api/sessions/take1/calibration"
FRESH = "/api/sessions/fresh/calibration"


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Board footage; nobody changes it."""
    return render_takes(tmp_path_factory.mktemp("boards"))


@pytest.fixture
def fresh(studio: Studio, takes: Path) -> Studio:
    """The studio with an empty session, and the board footage under its roots."""
    begin_session(studio.workspace.place_for("fresh"))
    state = studio.app.state.studio
    state.footage_roots = (*state.footage_roots, takes.resolve())
    return studio


def solved(studio: Studio, request: dict, session: str = "fresh") -> dict:
    """The state of a calibration from boards when it has ended."""
    begun = studio.post(f"/api/sessions/{session}/calibration/solve", request, code=202)
    return studio.ended(f"/api/calibrations/{begun['identifier']}")


@pytest.mark.slow
def test_a_tilted_world_is_levelled_as_a_proposal(studio: Studio) -> None:
    session = make_nudged_session(studio.workspace.place_for("askew"), 0.0)
    tilt = rigid(cv2.Rodrigues(np.array([np.radians(12.0), 0.0, 0.0]))[0], np.array([0.0, 0.0, 300.0]))
    write_calibration(moved_cameras(true_cameras(), tilt), session.path / CAMERAS_PATH)
    here = "/api/sessions/askew/calibration"
    assert "tilted-world" in {one["code"] for one in studio.get(here)["present"]["findings"]}
    begun = studio.post(f"{here}/level", {}, code=202)
    ended = studio.ended(f"/api/calibrations/{begun['identifier']}")
    assert ended["state"] == "done", ended
    proposal = studio.get(f"{here}/proposals/{ended['proposal']}")
    assert proposal["findings"] == []
    assert "turned by 12.0 degrees" in " ".join(proposal["notes"])
    used = studio.post(f"{here}/proposals/{ended['proposal']}/apply", {})
    assert used["present"]["findings"] == []
    assert "floor from the cameras' vertical" in used["present"]["source"]
    studio.post(f"{here}/level", {"run": "none"}, code=404)


def decoded(content: bytes) -> np.ndarray:
    """The picture of a file's content."""
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return picture


def turned_up(session: Session, axis: str = "y") -> bytes:
    """The session's calibration in metres with another axis up, as another tool would write it."""
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    assert axis == "y"
    cameras = tuple(
        dataclasses.replace(
            camera, name=camera.name.replace("cam", "Camera_"), rotation=camera.rotation @ turn.T
        )
        for camera in session.cameras()
    )
    place = session.path.parent / "Calib_other.toml"
    export_calibration(cameras, place, "pose2sim")
    return place.read_bytes()


def test_a_file_is_shown_confirmed_and_kept_apart_from_the_one_before(
    studio: Studio, session: Session, tracked: StoredRun
) -> None:
    before = studio.get(TAKE)
    assert [camera["name"] for camera in before["present"]["cameras"]] == ["cam1", "cam2"]
    assert before["earlier"] == []
    upload = studio.upload({"Calib_other.toml": turned_up(session)})
    seen = studio.post(f"{TAKE}/proposals", {"upload": upload})
    assert "in m" in seen["unit_note"]
    assert [finding["code"] for finding in seen["findings"] if finding["severity"] == "blocks"] == ["up-axis"]
    assert not seen["usable"]
    refused = studio.post(f"{TAKE}/proposals/{seen['identifier']}/apply", {}, code=422)
    assert "Y axis points up" in refused["message"]
    assert studio.get(TAKE) == before
    right = studio.post(f"{TAKE}/proposals", {"upload": upload, "up": "y", "unit": "m"})
    assert right["usable"]
    assert right["matching"][0] == {"footage": "cam1", "camera": "Camera_1", "how": "same normalised name"}
    original = (session.path / "calibration" / "cameras.toml").read_bytes()
    response = studio.post(f"{TAKE}/proposals/{right['identifier']}/apply", {})
    assert response["present"]["source"] == "Calib_other.toml"
    assert response["changed"]
    assert response["stale_runs"] == ["first"]
    assert any("Run first was tracked with another calibration" in note for note in response["notes"])
    now = Session(session.path)
    assert (now.path / "calibration" / "original.toml").read_bytes() == turned_up(session)
    for old, new in zip(session.cameras(), now.cameras(), strict=True):
        np.testing.assert_allclose(new.centre, old.centre, atol=1e-6)
    kept = now.path / "calibration" / "earlier" / response["earlier"][0]
    assert (kept / "cameras.toml").read_bytes() == original
    assert tracked.cameras()[0].name == "cam1"


def test_an_earlier_one_comes_back(studio: Studio, session: Session) -> None:
    original = (session.path / "calibration" / "cameras.toml").read_bytes()
    upload = studio.upload({"Calib_other.toml": turned_up(session)})
    request = {"upload": upload, "up": "y"}
    made = studio.post(f"{TAKE}/proposals", request)
    response = studio.post(f"{TAKE}/proposals/{made['identifier']}/apply", {})
    back = studio.post(f"{TAKE}/proposals", {"earlier": response["earlier"][0]})
    again = studio.post(f"{TAKE}/proposals/{back['identifier']}/apply", {})
    assert len(again["earlier"]) == 2
    assert (session.path / "calibration" / "cameras.toml").read_bytes() == original


def test_what_blocks_can_be_used_if_requested(studio: Studio, session: Session) -> None:
    upload = studio.upload({"Calib_other.toml": turned_up(session)})
    seen = studio.post(f"{TAKE}/proposals", {"upload": upload})
    address = f"{TAKE}/proposals/{seen['identifier']}/apply"
    studio.post(address, {"anyway": True})
    present = studio.get(TAKE)["present"]
    assert present["findings"][0]["code"] == "up-axis"


@pytest.mark.parametrize(
    ("files", "sent", "status", "said"),
    [
        ({"a.pickle": b"x"}, {}, 422, "pickle"),
        ({"a.toml": b"x = ["}, {}, 422, "not TOML"),
        ({"a.toml": b"[cam1]\n", "b.txt": b""}, {"file": "../a.toml"}, 422, "file name"),
        ({"a.txt": b"", "b.txt": b""}, {}, 422, "no calibration that can be read"),
        ({}, {"earlier": "never"}, 404, "kept no calibration"),
        ({}, {}, 422, "holds no calibration"),
        (None, {"path": "/etc/hostname"}, 422, "may be taken from"),
        (None, {}, 422, "No calibration was named"),
    ],
)
def test_what_is_no_calibration(
    studio: Studio, files: dict[str, bytes] | None, sent: dict, status: int, said: str
) -> None:
    upload = {} if files is None else {"upload": studio.upload(files)}
    answer = studio.post(f"{TAKE}/proposals", {**upload, **sent}, code=status)
    assert said in answer["message"]
    assert answer["hint"]


def test_boards_give_cameras_pictures_and_a_calibration(fresh: Studio, takes: Path, tmp_path: Path) -> None:
    request = {"board": BOARD.text, "footage": {"path": str(takes)}, "floor": f"frame:{FLOOR_FRAME}"}
    response = solved(fresh, request)
    assert response["state"] == "done", response
    assert response["share"] == 1.0
    here = f"{FRESH}/proposals/{response['proposal']}"
    made = fresh.get(here)
    assert made["usable"], made["findings"]
    assert made["floor"] == f"board on the floor in frame {FLOOR_FRAME}"
    for camera, found in zip(CAMERAS, made["cameras"], strict=True):
        np.testing.assert_allclose(found["focal_px"][0], camera.matrix[0, 0], rtol=6e-3)
        np.testing.assert_allclose(found["position"], camera.centre - [*FLOOR_PLACE, 0.0], atol=25.0)
        assert 0.0 < found["rms_px"] < 0.5
    pictures = made["report"]["cameras"][0]["pictures"]
    assert len(pictures) >= 10
    assert all(entry["rms_px"] < 1.0 or entry["dropped"] for entry in pictures if entry["rms_px"] is not None)
    coverage = fresh.client.get(f"{here}/coverage/cam1.png")
    assert decoded(coverage.content).shape[1] == 480
    # The axes lie where the truth has the board on the floor.
    seen = fresh.client.get(f"{here}/views/cam1.jpg", params={"height": 480}).content
    drawn = decoded(seen).astype(int)
    end = (
        project(CAMERAS[0], np.array([[FLOOR_PLACE[0] + 600.0, FLOOR_PLACE[1], 0.0]]))[0][0]
        .round()
        .astype(int)
    )
    around = drawn[end[1] - 4 : end[1] + 5, end[0] - 4 : end[0] + 5]
    assert (around[..., 2] - around[..., 0]).max() > 100, "the X axis is red there"
    applied = fresh.post(f"{here}/apply", {})
    assert applied["present"]["source"].startswith("ChArUco board 6x5, 0.")
    folder = fresh.workspace.session("fresh").path / "calibration"
    assert (folder / "cameras.report.json").exists()
    fresh.get(f"{FRESH}/proposals/current/coverage/cam2.png")
    for form, reader in (("pose2sim", "Calib_fresh.toml"), ("aniposelib", "calibration.toml")):
        answer = fresh.client.get(f"{FRESH}/export", params={"format": form})
        assert reader in answer.headers["content-disposition"]
        (tmp_path / reader).write_bytes(answer.content)
        for camera, found in zip(read_calibration(tmp_path / reader).cameras, made["cameras"], strict=True):
            np.testing.assert_allclose(camera.centre, found["position"], atol=0.01)
    packed = fresh.client.get(f"{FRESH}/export", params={"format": "opencv"}).content
    assert len(zipfile.ZipFile(io.BytesIO(packed)).namelist()) == 2


def test_points_clicked_in_two_views_are_the_floor(studio: Studio, session: Session) -> None:
    """The world is tilted and lifted; four points of the true floor put it right."""
    true = session.cameras()
    lean = np.radians(20.0)
    turn = np.array([[1, 0, 0], [0, np.cos(lean), -np.sin(lean)], [0, np.sin(lean), np.cos(lean)]])
    shift = np.array([300.0, -200.0, 700.0])
    spoilt = tuple(
        dataclasses.replace(
            camera,
            rotation=camera.rotation @ turn.T,
            translation=camera.translation - camera.rotation @ turn.T @ shift,
        )
        for camera in true
    )
    write_calibration(spoilt, session.path / "calibration" / "cameras.toml")
    floor = np.array([[0.0, 0.0, 0.0], [700.0, 0.0, 0.0], [700.0, 500.0, 0.0], [0.0, 600.0, 0.0]])
    seen = {camera.name: project(camera, floor)[0] for camera in true}
    points = [{"pixels": {name: seen[name][k].tolist() for name in seen}} for k in range(4)]
    made = studio.post(f"{TAKE}/floor", {"points": points})
    for camera, found in zip(true, made["cameras"], strict=True):
        np.testing.assert_allclose(found["position"], camera.centre, atol=0.1)
    np.testing.assert_allclose([point["place"] for point in made["points"]], floor, atol=0.1)
    assert max(off for point in made["points"] for off in point["missed_px"].values()) < 0.01
    view = studio.client.get(f"{TAKE}/proposals/{made['identifier']}/views/cam2.jpg")
    assert view.headers["content-type"] == "image/jpeg"
    assert studio.get(TAKE)["earlier"] == []
    response = studio.post(f"{TAKE}/proposals/{made['identifier']}/apply", {})
    assert "floor from 4 clicked points" in response["present"]["source"]
    np.testing.assert_allclose(Session(session.path).cameras()[0].centre, true[0].centre, atol=0.1)


def test_clicks_that_are_no_floor(studio: Studio, session: Session) -> None:
    line = np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0], [600.0, 0.0, 0.0]])
    seen = {camera.name: project(camera, line)[0] for camera in session.cameras()}
    points = [{"pixels": {name: seen[name][k].tolist() for name in seen}} for k in range(3)]
    answer = studio.post(f"{TAKE}/floor", {"points": points}, code=422)
    assert "on a line" in answer["message"]
    studio.post(f"{TAKE}/floor", {"points": points[:2]}, code=422)
    single = [{"pixels": {"cam1": [1.0, 2.0]}}] * 3
    studio.post(f"{TAKE}/floor", {"points": single}, code=422)


def test_solving_can_be_stopped_and_failures_are_in_words(
    fresh: Studio, takes: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = {"path": str(takes)}
    fresh.post(f"{FRESH}/solve", {"board": "circles:3", "footage": here}, code=422)
    lacking = fresh.post(f"{FRESH}/solve", {"board": BOARD.text}, code=422)
    assert "no board footage" in lacking["message"]
    other = solved(
        fresh, {"board": "charuco:5x4,30,20,DICT_5X5_100", "extrinsics": {"path": str(takes / "extrinsics")}}
    )
    assert other["state"] == "failed"
    assert "found in no picture" in other["message"]

    def waits(*given: object) -> None:
        progress = given[-1]
        assert callable(progress)
        while True:
            progress("Looking for the board, camera cam1", 1, 10)

    monkeypatch.setattr(calibration_proposals, "solve_boards", waits)
    begun = fresh.post(f"{FRESH}/solve", {"board": BOARD.text, "footage": here})
    fresh.delete(f"/api/calibrations/{begun['identifier']}", code=202)
    deadline = time.monotonic() + PATIENCE
    response = begun
    while response["state"] in ("queued", "running", "cancelling") and time.monotonic() < deadline:
        response = fresh.get(f"/api/calibrations/{begun['identifier']}")
    assert (response["state"], response["code"]) == ("cancelled", "cancelled")
    assert fresh.get(FRESH)["present"] is None


def test_a_board_to_print(studio: Studio) -> None:
    answer = studio.client.get("/api/calibration-boards.pdf", params={"kind": "chessboard", "page": "a3"})
    assert answer.content.startswith(b"%PDF")
    assert answer.headers["x-studio-board"].startswith("chessboard:9x6,")
    large = studio.get("/api/calibration-boards.pdf", params={"board": "chessboard:9x6,200"}, code=422)
    assert "does not fit" in large["message"]


@pytest.mark.slow
@pytest.mark.real_data
def test_lenses_of_the_balancing_mans_cameras(studio: Studio, real_data: Path) -> None:
    """Few and hard pictures: the focal length is within 3 % of the given one, or what is shown says why not."""
    folder = real_data / "pose2sim-balance" / "calibration"
    given = {camera.name[-2:]: camera for camera in read_calibration(folder / "Calib_qualisys.toml").cameras}
    begin_session(studio.workspace.place_for("fresh"))
    state = studio.app.state.studio
    state.footage_roots = (*state.footage_roots, folder.resolve())
    response = solved(
        studio, {"board": "chessboard:4x7,60", "intrinsics": {"path": str(folder / "intrinsics")}}
    )
    assert response["state"] == "done", response
    here = f"{FRESH}/proposals/{response['proposal']}"
    made = studio.get(here)
    assert made["findings"][0]["code"] == "no-places"
    studio.post(f"{here}/apply", {}, code=422)
    assert [lens["name"] for lens in made["report"]["cameras"]] == ["cam01", "cam02", "cam03", "cam04"]
    for lens in made["report"]["cameras"]:
        true = given[lens["name"][-2:]].matrix[0, 0]
        said = {finding["code"] for finding in made["findings"] if lens["name"] in finding["cameras"]}
        assert abs(lens["focal_px"][0] / true - 1.0) < 0.03 or said & {"coverage", "few-pictures"}
        assert "few-pictures" in said
        assert len(lens["pictures"]) >= 6
        studio.get(f"{here}/coverage/{lens['name']}.png")
