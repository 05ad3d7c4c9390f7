"""Whether the cameras agree, over the API: measured in the background, turned, turned back, refused."""

import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from nudged_camera import NUDGED, make_nudged_session
from web_doubles import Studio

from studio.operations import cameras
from studio.runs.new_run import prepare_run
from studio.sessions.session import CAMERAS_PATH, Session

PLACE = "/api/sessions/nudged/alignment"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with a nudged camera; nobody changes it."""
    return make_nudged_session(tmp_path_factory.mktemp("made") / "nudged").path


@pytest.fixture
def session(made: Path, studio: Studio) -> Session:
    """A copy of it in the studio's workspace."""
    return Session(shutil.copytree(made, studio.workspace.root / "nudged"))


def calibration_why(studio: Studio) -> str:
    """What the guided set-up says of the calibration."""
    steps = studio.get("/api/sessions/nudged/way")["steps"]
    return next(step["why"] for step in steps if step["step"] == "calibration")


@pytest.mark.slow
def test_cameras_are_measured_turned_and_turned_back(studio: Studio, session: Session) -> None:
    before = (session.path / CAMERAS_PATH).read_bytes()
    run = prepare_run(session, start_pose=session.body().neutral, last=2, name="old")
    response = studio.get(PLACE)
    assert (response["possible"], response["job"], response["turned"]) == (True, None, False)
    studio.post(PLACE, {}, code=202)
    job = studio.ended(PLACE, "job")
    assert job["state"] == "done", job
    lines = {line["camera"]: line for line in job["cameras"]}
    assert lines[NUDGED]["after_px"] < 0.4 * lines[NUDGED]["before_px"]
    assert (job["needed"], job["better"], len(job["frames"])) == (True, True, 8)
    assert "they would miss by" in job["words"]
    assert f"({NUDGED})" in calibration_why(studio)
    kept = studio.post(f"{PLACE}/keep")
    assert (kept["turned"], kept["job"]["kept"]) == (True, True)
    assert any(run.name in note for note in kept["notes"])
    assert calibration_why(studio) == ""
    undone = studio.post(f"{PLACE}/undo")
    assert (session.path / CAMERAS_PATH).read_bytes() == before
    assert (undone["turned"], undone["job"]["kept"]) == (False, False)
    assert studio.post(f"{PLACE}/undo", code=404)["code"] == "not-found"


def test_what_was_measured_of_another_calibration_is_not_used(studio: Studio, session: Session) -> None:
    studio.post(f"{PLACE}/keep", code=404)
    studio.post(PLACE, {"frames": [0, 1, 2, 3, 4, 5]})
    assert studio.ended(PLACE, "job")["state"] == "done"
    other = make_nudged_session(studio.workspace.root / "other", degrees=3.0)
    shutil.copyfile(other.path / CAMERAS_PATH, session.path / CAMERAS_PATH)
    assert studio.get(PLACE)["job"] is None
    refused = studio.post(f"{PLACE}/keep", code=422)
    assert "has changed" in refused["message"]


def test_measuring_is_cancelled_and_fails_in_words(
    studio: Studio, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def waits(_: Session, __: object, *, progress: Callable[[str, int, int], None]) -> None:
        while True:
            progress("reading silhouettes", 1, 16)
            time.sleep(0.01)

    monkeypatch.setattr(cameras, "align_cameras", waits)
    studio.post(PLACE, {}, code=202)
    assert studio.post(PLACE, {}, code=409)["code"] == "run"
    studio.delete(PLACE)
    assert studio.ended(PLACE, "job")["state"] == "cancelled"
    monkeypatch.undo()
    studio.post(PLACE, {"frames": [0]})
    failed = studio.ended(PLACE, "job")
    assert failed["state"] == "failed"
    assert "Too few silhouettes" in failed["message"]
    assert studio.get("/api/sessions/take1/alignment")["possible"]
