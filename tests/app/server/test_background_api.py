"""The set-up of backgrounds over the API: in the background, with progress, cancelled, refused; plates by upload."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import cv2
import msgspec
import numpy as np
import pytest
from patched_ball import FRAMES, patched_ball
from rendered_people import overlap
from two_people import two_people
from waiting import PATIENCE
from web_doubles import Studio

from studio.evidence.strokes import Stroke
from studio.foundations.errors import FootageError
from studio.operations import masks
from studio.operations.masks import background_of
from studio.runs.setup.background_setup import BackgroundSetup
from studio.sessions.background_files import SessionEvidence, read_evidence, write_evidence
from studio.sessions.footage_changes import change_footage
from studio.sessions.session import Session, redescribe
from studio.sessions.stroke_files import write_strokes

PLACE = "/api/sessions/take1"


def plate_upload(studio: Studio, name: str, picture: np.ndarray) -> str:
    """An upload of one picture."""
    return studio.upload({name: cv2.imencode(".png", picture)[1].tobytes()})


def test_the_median_is_set_up_and_said(studio: Studio) -> None:
    before = studio.get(f"{PLACE}/background")
    assert "median" in before["possible"]
    assert "plate" not in before["possible"]
    offered = {one["name"]: one for one in before["sources"]}
    assert {name for name, one in offered.items() if not one["lacking"]} == set(before["possible"])
    assert offered["plate"]["lacking"] == "Give a picture for every camera below."
    assert {"mask_threshold", "background_model"} <= set(before["settings"])
    studio.post(f"{PLACE}/background", {"source": "median", "tune": False}, code=202)
    assert studio.ended(f"{PLACE}/background", "job")["state"] == "done"
    after = studio.get(f"{PLACE}/background")
    assert after["source"] == "median"
    assert after["own"] == {"background_model": "median"}


def test_a_person_is_looked_for_and_nobody_found(studio: Studio) -> None:
    before = studio.get(f"{PLACE}/background")
    assert "person" in before["possible"]
    assert "masks" not in before["possible"]
    studio.post(f"{PLACE}/background", {"source": "person"}, code=202)
    job = studio.ended(f"{PLACE}/background", "job")
    assert job["state"] == "failed"
    assert "No camera sees a person" in job["message"]
    after = studio.get(f"{PLACE}/background")
    assert (after["source"], after["own"]) == (before["source"], before["own"])


def test_given_masks_stay_remembered_when_knobs_are_kept(studio: Studio) -> None:
    session = studio.workspace.session("take1")
    given = {source.name: "masks/x" for source in session.manifest.footage.cameras}
    write_evidence(session, SessionEvidence(given_masks=given))
    studio.put(f"{PLACE}/evidence", {"mask_threshold": 5})
    assert read_evidence(session) == SessionEvidence(knobs={"mask_threshold": 5}, given_masks=given)


def test_progress_cancel_and_a_second_one_at_once(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    at_work = threading.Event()

    def waits(
        _: Session, *__: object, progress: Callable[[str, int, int], None], **___: object
    ) -> BackgroundSetup:
        progress("finding empty regions", 1, 4)
        at_work.set()
        while True:
            progress("finding empty regions", 2, 4)
            time.sleep(0.01)

    monkeypatch.setattr(masks, "set_up_background", waits)
    studio.post(f"{PLACE}/background", {"source": "median"}, code=202)
    assert at_work.wait(PATIENCE)
    job = studio.get(f"{PLACE}/background")["job"]
    assert (job["step"], job["total"]) == ("finding empty regions", 4)
    studio.post(f"{PLACE}/background", {"source": "median"}, code=409)
    studio.delete(f"{PLACE}/background", code=202)
    assert studio.ended(f"{PLACE}/background", "job")["state"] == "cancelled"


def test_what_cannot_be_is_refused_in_words(studio: Studio) -> None:
    studio.post(f"{PLACE}/background", {"source": "magic"}, code=422)
    studio.post(f"{PLACE}/background", {"source": "median", "knobs": {"mask_x": 1}}, code=422)
    studio.post(f"{PLACE}/background", {"source": "plate"})
    job = studio.ended(f"{PLACE}/background", "job")
    assert job["state"] == "failed"
    assert "has no plate" in job["message"]


def test_a_failure_leaves_backgrounds_as_they_were(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise FootageError("The clip ends.", "Give another.")

    monkeypatch.setattr("studio.runs.setup.background_setup.use_given_backgrounds", fails)
    studio.post(f"{PLACE}/background", {"source": "median"})
    assert studio.ended(f"{PLACE}/background", "job")["message"] == "The clip ends."
    assert not (studio.workspace.session("take1").path / "evidence.json").exists()


@pytest.mark.parametrize("ending", ["png", "mp4"])
def test_an_animal_is_cut_out_before_pictures_or_clips_of_its_empty_place(
    studio: Studio, ending: str
) -> None:
    session = studio.workspace.session("take1")
    footage = session.manifest.footage
    cameras = tuple(replace(one, background=f"background/{one.name}.{ending}") for one in footage.cameras)
    before = background_of(session)
    changed = replace(footage, cameras=cameras)
    found = background_of(redescribe(session, msgspec.structs.replace(session.manifest, footage=changed)))
    assert ("animal" in before.possible, "animal" in found.possible) == (False, True)


def test_uploaded_plates_are_matched_by_name_or_as_said(studio: Studio) -> None:
    sources = studio.workspace.session("take1").manifest.footage.cameras
    source = sources[0]
    picture = np.full((source.height, source.width, 3), 90, np.uint8)
    for camera in sources:
        upload = plate_upload(studio, f"empty_{camera.name}.png", picture)
        response = studio.post(f"{PLACE}/backgrounds", {"upload": upload})
        studio.get(f"/api/uploads/{upload}", code=404)
    assert [camera["given"] for camera in response["cameras"]] == ["plate"] * len(sources)
    assert "plate" in response["possible"]
    named = plate_upload(studio, "whatever.png", picture)
    request = {"upload": named, "files": {source.name: "whatever.png"}}
    studio.post(f"{PLACE}/backgrounds", request)
    small = plate_upload(studio, f"{source.name}.png", picture[:10, :10])
    studio.post(f"{PLACE}/backgrounds", {"upload": small}, code=422)
    outside = {"upload": plate_upload(studio, "a.png", picture), "files": {source.name: "../../a.png"}}
    assert studio.client.post(f"{PLACE}/backgrounds", json=outside).status_code in (403, 422)


def test_strokes_are_painted_tried_kept_and_carried(studio: Studio) -> None:
    ball = patched_ball(studio.workspace.root / "ball")
    here = "/api/sessions/ball"
    place = f"{here}/strokes"
    before = studio.get(place)["cameras"]
    assert [(one["camera"], one["strokes"], one["ready"]) for one in before] == [
        (f"cam{n}", [], False) for n in range(3)
    ]
    assert "strokes" not in studio.get(f"{here}/background")["possible"]
    painted = {
        name: [
            {
                "frame": 2,
                "kind": one.kind,
                "width": one.width,
                "points": [list(point) for point in one.points],
            }
            for one in ball.strokes(2, name)
        ]
        for name in ("cam0", "cam1", "cam2")
    }
    strokes, true = painted["cam1"], ball.masks["cam1", 2]
    studio.post(f"{place}/cam1/preview", {"frame": 0, "strokes": strokes}, code=204)
    paths = studio.get("/api/openapi.json")["paths"]
    assert "204" in paths["/api/sessions/{session}/strokes/{camera}/preview"]["post"]["responses"]
    shown = studio.client.post(f"{place}/cam1/preview", json={"frame": 2, "strokes": strokes})
    assert shown.headers["content-type"] == "image/png"
    picture = cv2.imdecode(np.frombuffer(shown.content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (*true.shape, 4)
    assert overlap(picture[..., 3], true) > 0.9
    wrong = [*strokes, {"frame": 99, "kind": "inside", "width": 1, "points": [[5, 5]]}]
    refused = studio.client.put(f"{place}/cam1", json={"strokes": wrong})
    assert refused.status_code >= 400
    assert "no frame 99" in refused.json()["message"]
    studio.put(f"{place}/side", {"strokes": strokes}, code=404)
    for name, those in painted.items():
        studio.put(f"{place}/{name}", {"strokes": those})
    kept = studio.get(place)["cameras"][1]
    assert (kept["strokes"], kept["ready"], kept["made"]) == (strokes, True, False)
    studio.post(f"{here}/background", {"source": "strokes", "tune": False}, code=202)
    assert studio.ended(f"{here}/background", "job")["state"] == "done"
    after = studio.get(f"{here}/background")
    assert after["source"] == "strokes"
    assert "best" in after["possible"]
    assert studio.get(place)["cameras"][1]["made"]


def test_strokes_can_be_painted_again_after_the_footage_has_become_shorter(studio: Studio) -> None:
    ball = patched_ball(studio.workspace.root / "ball")
    late = [
        Stroke(camera=name, frame=FRAMES - 1, kind="inside", width=4.0, points=((5.0, 5.0),))
        for name in ("cam0", "cam1", "cam2")
    ]
    write_strokes(ball.session, late)
    change_footage(ball.session, offsets={"cam0": 1})
    place = "/api/sessions/ball/strokes"
    assert [one["strokes"] for one in studio.get(place)["cameras"]] == [[], [], []]
    again = {"frame": 0, "kind": "inside", "width": 4, "points": [[5, 5]]}
    for name in ("cam0", "cam1", "cam2"):
        studio.put(f"{place}/{name}", {"strokes": [again]})
    assert "strokes" in studio.get("/api/sessions/ball/background")["possible"]


def test_one_of_several_is_chosen_by_where_he_stands(studio: Studio) -> None:
    made = two_people(studio.workspace.root / "two", 2)
    place = "/api/sessions/two"
    seen = studio.get(f"{place}/subjects")["subjects"]
    assert len(seen) == 2
    assert all(0.0 <= share < 1.0 for one in seen for point in one["points"].values() for share in point)
    before = studio.get(f"{place}/background")
    assert "subject" in before["possible"]
    studio.post(f"{place}/background", {"source": "subject"}, code=202)
    assert "Nobody was chosen" in studio.ended(f"{place}/background", "job")["message"]
    chosen = min(seen, key=lambda one: abs(one["at"][0] - made.places()[1][0]))
    request = {"source": "subject", "subject_at": chosen["at"]}
    studio.post(f"{place}/background", request, code=202)
    job = studio.ended(f"{place}/background", "job")
    assert job["state"] == "done", job
    assert job["quality"]["subjects"] == 1
    assert studio.get(f"{place}/background")["source"] == "subject"
    footage = Session(made.session.path).footage()
    mask = footage.mask("cam1", 1)
    footage.close()
    assert mask is not None
    assert overlap(mask, made.masks[1]["cam1", 1]) > overlap(mask, made.masks[0]["cam1", 1])


@pytest.mark.parametrize("place", [[1.0], ["x", 0.0], [0.0, 1.0, 2.0], 3.0])
def test_a_place_is_two_numbers(studio: Studio, place: object) -> None:
    studio.post(f"{PLACE}/background", {"source": "subject", "subject_at": place}, code=422)
