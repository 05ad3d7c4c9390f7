"""Results through the API equal those in the store."""

import contextlib
import csv
import io
import sqlite3

import cv2
import numpy as np
import pytest
from flipped_bytes import flip_stored
from web_doubles import Studio

from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.sessions.results_codec import VERIFIED
from studio.sessions.results_reader import FILE_NAME
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

RUN = "/api/sessions/take1/runs/first"


def give_truth(session: Session, run: StoredRun, shift_mm: float) -> None:
    """A truth that is the run's own markers, moved sideways by so much."""
    with run.results() as results:
        _, poses = results.poses()
    body = run.body()
    points = marker_points(body, poses) + np.array([shift_mm, 0.0, 0.0])
    (session.path / "truth").mkdir()
    names = tuple(marker.name for marker in body.markers)
    motion = MarkerMotion(names, np.arange(len(points)) / 25.0, points, "m", 25.0)
    write_trc(session.path / "truth" / "markers.trc", motion)


def test_the_timeline(studio: Studio, tracked: StoredRun) -> None:
    response = studio.get(f"{RUN}/frames")
    assert (response["first"], response["last"], response["fps"]) == (0, 4, 25.0)
    assert [entry["frame"] for entry in response["frames"]] == [0, 1]
    assert response["frames"][0]["log_weight"] == -1.5
    assert response["frames"][0]["error_mm"] is None
    assert response["mean_milliseconds"] == 9.0
    assert [change["changed"] for change in response["settings_changes"]] == [["survival"]]
    assert response["mean_mm"] is None
    assert response["describe"] == "annealed 10×100"


def test_with_truth_every_frame_has_its_error(studio: Studio, session: Session, tracked: StoredRun) -> None:
    give_truth(session, tracked, 30.0)
    response = studio.get(f"{RUN}/frames")
    assert np.allclose([entry["error_mm"] for entry in response["frames"]], 30.0, atol=0.01)
    assert np.isclose(response["mean_mm"], 30.0, atol=0.01)
    assert np.isclose(response["worst_mm"], 30.0, atol=0.01)
    assert not any(entry["lost"] for entry in response["frames"])
    measured = studio.get(f"{RUN}/evaluation")
    assert np.isclose(measured["mean_mm"], 30.0, atol=0.01)
    assert measured["lost_frames"] == 0
    assert measured["frames"] == [0, 1]
    [line] = studio.get("/api/sessions/take1/runs")["runs"]
    assert np.isclose(line["mean_mm"], 30.0, atol=0.01)
    assert line["measured_frames"] == 2


def test_lost_limbs_are_marked(studio: Studio, session: Session, tracked: StoredRun) -> None:
    give_truth(session, tracked, 200.0)
    assert all(entry["lost"] for entry in studio.get(f"{RUN}/frames")["frames"])


def test_a_truth_that_cannot_be_used_is_named_and_spoils_nothing(
    studio: Studio, session: Session, tracked: StoredRun
) -> None:
    (session.path / "truth").mkdir()
    (session.path / "truth" / "bad.trc").write_text("nothing")
    response = studio.get(f"{RUN}/frames")
    assert "bad.trc" in response["truth_problem"]
    assert len(response["frames"]) == 2
    assert studio.get("/api/sessions")["sessions"][0]["runs"][0]["mean_mm"] is None
    studio.get(f"{RUN}/evaluation", code=422)


def test_without_truth_there_is_no_evaluation(studio: Studio, tracked: StoredRun) -> None:
    answer = studio.get(f"{RUN}/evaluation", code=404)
    assert "truth" in answer["hint"]


def test_any_stored_frame_with_all_its_layers(studio: Studio, tracked: StoredRun) -> None:
    response = studio.get(f"{RUN}/frames/1")
    with tracked.results() as results:
        layers, result = results.layers(1), results.result(1)
    assert response["finished"] is True
    assert np.allclose(response["pose"], result.estimate.pose)
    assert len(response["parameters"]) == 35
    assert len(response["layers"]) == 3
    for shown, stored in zip(response["layers"], layers, strict=True):
        for name in ("variance_weighed", "variance_resampled", "variance_diffused", "best", "mean"):
            assert np.allclose(shown[name], getattr(stored, name))
        assert shown["particles"] == len(stored.poses)
        assert shown["beta"] == stored.beta
    assert response["settings"]["survival"] == 0.77
    assert studio.get(f"{RUN}/frames/0")["settings"] == tracked.record.settings
    assert studio.get(f"{RUN}/frames/1/layers/2") == response["layers"][2]


def test_particles_as_numbers_and_as_bytes(studio: Studio, tracked: StoredRun) -> None:
    with tracked.results() as results:
        stored = results.layer(0, 1)
    response = studio.get(f"{RUN}/frames/0/layers/1/particles")
    assert np.allclose(response["poses"], stored.poses)
    assert np.allclose(response["log_weights"], stored.log_weights)
    assert response["parameters"] == list(tracked.record.parameters)
    answer = studio.client.get(f"{RUN}/frames/0/layers/1/particles", params={"format": "float32"})
    shape = int(answer.headers["x-studio-rows"]), int(answer.headers["x-studio-columns"])
    table = np.frombuffer(answer.content, "<f4").reshape(shape)
    assert np.allclose(table[:, :-1], stored.poses, atol=1e-6)
    assert np.allclose(table[:, -1], stored.log_weights, atol=1e-6)
    studio.get(f"{RUN}/frames/0/layers/1/particles", params={"format": "pickle"}, code=422)


def test_poses_as_csv_read_back_exactly(studio: Studio, tracked: StoredRun) -> None:
    answer = studio.client.get(f"{RUN}/poses.csv")
    assert "take1-first-poses.csv" in answer.headers["content-disposition"]
    rows = list(csv.reader(io.StringIO(answer.text)))
    assert rows[0] == ["frame", *tracked.record.parameters]
    with tracked.results() as results:
        frames, poses = results.poses()
    assert [int(row[0]) for row in rows[1:]] == frames.tolist()
    assert np.array_equal(np.array([row[1:] for row in rows[1:]], dtype=float), poses)


def test_variances_as_csv(studio: Studio, tracked: StoredRun) -> None:
    rows = list(csv.reader(io.StringIO(studio.client.get(f"{RUN}/frames/0/variance.csv").text)))
    assert rows[0][:3] == ["frame", "layer", "moment"]
    assert len(rows) == 1 + 3 * 3
    with tracked.results() as results:
        stored = results.layer(0, 2)
    last = np.array(rows[-1][3:], dtype=float)
    assert rows[-1][:3] == ["0", "3", "after_diffusion"]
    assert np.allclose(last, stored.variance_diffused)


@pytest.mark.parametrize(
    "path", ["frames/3", "frames/0/layers/9", "frames/9/variance.csv", "frames/0/layers/9/particles"]
)
def test_what_is_not_there_is_404_in_words(studio: Studio, tracked: StoredRun, path: str) -> None:
    answer = studio.get(f"{RUN}/{path}", code=404)
    assert answer["hint"]


def test_the_frame_in_progress_shows_the_layers_that_are_done(studio: Studio, tracked: StoredRun) -> None:
    from_store = studio.get(f"{RUN}/frames/0")["layers"]
    assert [layer["layer"] for layer in from_store] == [0, 1, 2]
    assert studio.get(f"{RUN}/frames")["partial"] is None


# ---------------------------------------------------------------- pictures


def decoded(content: bytes) -> np.ndarray:
    """A JPEG as an array."""
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return picture


def test_the_bare_picture_is_the_footage_s(studio: Studio, session: Session) -> None:
    answer = studio.client.get("/api/sessions/take1/frames/2/views/cam2.jpg")
    assert answer.headers["content-type"] == "image/jpeg"
    footage = session.footage()
    true = footage.picture("cam2", 2)
    footage.close()
    shown = decoded(answer.content)
    assert shown.shape == true.shape
    # JPEG keeps coarse blocks to a few grey levels; another frame's picture is another one altogether.
    difference = np.abs(shown.astype(float) - true.astype(float)).mean()
    other = decoded(studio.client.get("/api/sessions/take1/frames/1/views/cam2.jpg").content)
    assert difference < 6.0 < 20.0 < np.abs(other.astype(float) - true.astype(float)).mean()


def test_overlays_change_the_picture_and_its_height(studio: Studio, tracked: StoredRun) -> None:
    bare = decoded(studio.client.get(f"{RUN}/frames/0/views/cam1.jpg", params={"show": ""}).content)
    drawn = decoded(
        studio.client.get(
            f"{RUN}/frames/0/views/cam1.jpg", params={"show": "outline,mask,edges,samples"}
        ).content
    )
    assert bare.shape == drawn.shape
    assert not np.array_equal(bare, drawn)
    tall = decoded(studio.client.get(f"{RUN}/frames/0/views/cam1.jpg", params={"height": 128}).content)
    assert tall.shape[:2] == (128, 192)


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("frames/0/views/none.jpg", 404),
        ("frames/99/views/cam1.jpg", 404),
        ("frames/-1/views/cam1.jpg", 404),
        ("frames/0/views/cam1.jpg?show=none", 400),
        ("frames/0/views/cam1.jpg?height=99999", 422),
        ("frames/x/views/cam1.jpg", 422),
    ],
)
def test_pictures_that_are_not_there(studio: Studio, tracked: StoredRun, path: str, status: int) -> None:
    answer = studio.get(f"{RUN}/{path}", code=status)
    assert answer["message"]


def test_the_timeline_is_there_before_all_is_checked_and_then_says_what_is_damaged(
    studio: Studio, tracked: StoredRun
) -> None:
    with contextlib.closing(sqlite3.connect(tracked.folder / FILE_NAME)) as connection:
        connection.execute("UPDATE layers SET blob = X'00' WHERE frame = 1 AND layer = 0")
        connection.commit()
    VERIFIED.forget(tracked.folder)
    known = []
    for check in ("false", "true", "false"):
        answer = studio.get(f"{RUN}/frames", params={"check": check})
        frames = [entry["frame"] for entry in answer["frames"]]
        done = studio.get(RUN, params={"check": "false"})["run"]["done"]
        known.append((answer["checked"], frames, answer["damaged"], done))
    assert known == [(False, [0, 1], {}, 2), *[(True, [0], {"1": "layer 1"}, 1)] * 2]


@pytest.mark.slow
def test_every_flip_in_a_store_is_a_named_gap_and_no_fault_of_the_server(
    studio: Studio, tracked: StoredRun
) -> None:
    store, rng = tracked.folder / FILE_NAME, np.random.default_rng(5)
    with contextlib.closing(sqlite3.connect(store)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    before = store.read_bytes()
    for _ in range(40):
        frame = flip_stored(store, rng)
        VERIFIED.forget(tracked.folder)
        answer = studio.get(f"{RUN}/frames")
        assert list(answer["damaged"]) == [str(frame)]
        assert [entry["frame"] for entry in answer["frames"]] == [1 - frame]
        [line] = studio.get("/api/sessions/take1/runs")["runs"]
        assert (line["damaged"], line["done"]) == ([frame], 1)
        statuses = {
            studio.client.get(f"{RUN}/frames/{frame}{end}").status_code
            for end in ("", "/layers/0", "/layers/0/particles", "/variance.csv")
        }
        assert statuses <= {200, 404}
        for ending in ("", "-wal", "-shm"):
            store.with_name(store.name + ending).unlink(missing_ok=True)
        store.write_bytes(before)


def test_notes_on_frames(studio: Studio, session: Session, tracked: StoredRun) -> None:
    place = f"/api/sessions/{session.name}/runs/{tracked.name}"
    assert studio.get(f"{place}/notes") == {"notes": []}
    put = studio.put(f"{place}/frames/1/note", {"text": "the arm, hidden"})
    assert [(one["frame"], one["text"]) for one in put["notes"]] == [(1, "the arm, hidden")]
    assert studio.put(f"{place}/frames/0/note", {})["notes"][0]["text"] == ""
    table = studio.client.get(f"{place}/notes.csv").text.splitlines()
    assert table[0] == "frame,text,made"
    assert table[2].startswith('1,"the arm, hidden",')
    assert len(studio.delete(f"{place}/frames/1/note")["notes"]) == 1
    studio.put(f"{place}/frames/99/note", {}, code=404)
    studio.put(f"{place}/frames/1/note", {"text": 5 * 1000 * "x"}, code=422)
