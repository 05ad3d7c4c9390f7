"""Tracks over the API: listed, made in the background, downloaded; runs corrected. On the toy arm, with no doubles."""

import numpy as np
import pytest
from toy_session import make_session, true_poses
from tracked_runs import finish
from web_doubles import Studio

from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.runs.new_run import prepare_run
from studio.runs.tracks import Track, read_track, write_track
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

RUN = "/api/sessions/toy/runs/one"


@pytest.fixture
def run(studio: Studio, workspace: Workspace) -> StoredRun:
    """A finished run of the toy arm in the studio's workspace."""
    session = make_session(workspace.root / "toy")
    stored = prepare_run(
        session, name="one", start_pose=true_poses()[0] + 0.05, knobs={"particles": 20, "layers": 3}
    )
    finish(session, stored)
    return stored


def begun(studio: Studio, verb: str, request: dict) -> dict:
    """The job's state when it has ended."""
    answer = studio.post(f"{RUN}/{verb}", request, code=202)
    return studio.ended(f"/api/track-jobs/{answer['identifier']}")


def test_refined_smoothed_listed_and_downloaded(studio: Studio, run: StoredRun) -> None:
    response = begun(studio, "refine", {"settings": {"refinement_steps": 4}})
    assert (response["state"], response["track"], response["done"], response["total"]) == (
        "done",
        "refined",
        8,
        8,
    ), response
    response = begun(studio, "smooth", {})
    assert response["state"] == "done", response
    assert response["jitter_after_mm"] <= response["jitter_before_mm"]
    listed = studio.get(f"{RUN}/tracks")
    assert [line["name"] for line in listed["tracks"]] == ["raw", "refined", "smoothed"]
    assert listed["tracks"][2]["made_by"]["from"] == "refined"
    assert listed["tracks"][1]["made_by"]["refinement_steps"] == 4
    assert listed["running"] == []
    assert "smoothing_frequency" in [knob["name"] for knob in listed["smooth_settings"]]
    csv = studio.client.get(f"{RUN}/tracks/smoothed/poses.csv")
    rows = csv.text.splitlines()
    assert rows[0].split(",")[0] == "frame"
    assert np.allclose(
        [float(value) for value in rows[3].split(",")[1:]], read_track(run, "smoothed").poses[2]
    )


def test_a_track_is_drawn_over_the_pictures(studio: Studio, run: StoredRun) -> None:
    raw = read_track(run)
    moved = Track(
        "moved", raw.frames[:4], raw.poses[:4] + 0.6, raw.confidence[:4], raw.states[:4], {"verb": "test"}
    )
    write_track(run, moved)
    view = f"{RUN}/frames/2/views/front.jpg"
    plain, other = studio.client.get(view), studio.client.get(view, params={"track": "moved"})
    assert (plain.status_code, other.status_code) == (200, 200)
    assert plain.content != other.content
    assert studio.client.get(view, params={"track": "raw"}).content == plain.content
    studio.get(view, params={"track": "none"}, code=404)
    studio.get(view.replace("/2/", "/5/"), params={"track": "moved"}, code=404)


@pytest.mark.parametrize(
    ("verb", "sent", "status"),
    [
        ("smooth", {"settings": {"smoothing_frequency": 0.0}}, 422),
        ("smooth", {"settings": {"no_such": 1}}, 422),
        ("smooth", {"into": "raw"}, 409),
        ("smooth", {"source": "nothing"}, 404),
        ("refine", {"into": "../out"}, 422),
        ("correct", {"frame": 2}, 422),
        ("correct", {"frame": 99, "track": "raw"}, 404),
        ("correct", {"frame": 2, "pose": [0.0]}, 409),
        ("correct", {"frame": 2, "track": "raw", "back_to": 5}, 409),
    ],
)
def test_refusals(studio: Studio, run: StoredRun, verb: str, sent: dict, status: int) -> None:
    studio.post(f"{RUN}/{verb}", sent, code=status)
    assert len(studio.get(f"{RUN}/tracks")["tracks"]) == 1


def test_a_name_that_is_taken_is_refused_at_once(studio: Studio, run: StoredRun) -> None:
    begun(studio, "smooth", {})
    studio.post(f"{RUN}/smooth", {}, code=409)
    assert begun(studio, "smooth", {"replace": True})["state"] == "done"


def test_corrected_on_and_back(studio: Studio, run: StoredRun) -> None:
    on = begun(studio, "correct", {"frame": 4, "pose": true_poses()[4].tolist(), "name": "on"})
    assert (on["state"], on["made_run"]) == ("done", "on"), on
    line = studio.get("/api/sessions/toy/runs/on")
    assert "on" in str(line)
    back = begun(studio, "correct", {"frame": 4, "track": "raw", "back_to": 1, "name": "back"})
    assert (back["state"], back["made_run"], back["moved"]) == ("done", "back", 4), back
    studio.get("/api/track-jobs/none", code=404)


def write_truth(run: StoredRun, stem: str, names: tuple[str, ...]) -> None:
    """A truth of the toy arm: the markers of its run, 30 mm aside, under other names."""
    track, place = read_track(run), run.folder.parents[1] / "truth"
    markers = marker_points(run.body(), track.poses)[:, : len(names)] + np.array([30.0, 0.0, 0.0])
    place.mkdir(exist_ok=True)
    motion = MarkerMotion(names, track.frames / run.record.fps, markers, "mm", run.record.fps)
    write_trc(place / f"{stem}.trc", motion)


def test_a_truth_of_other_names_leaves_the_list_of_tracks_and_is_named(
    studio: Studio, run: StoredRun
) -> None:
    write_truth(run, "points", ("EarL", "EarR"))
    assert begun(studio, "smooth", {})["state"] == "done"
    listed = studio.get(f"{RUN}/tracks")
    assert [line["name"] for line in listed["tracks"]] == ["raw", "smoothed"]
    assert [line["mean_mm"] for line in listed["tracks"]] == [None, None]
    assert all(line["jitter_mm"] is not None for line in listed["tracks"])
    assert "EarL" in listed["truth_problem"]
    studio.get(f"{RUN}/check")


def test_of_several_truths_the_one_that_fits_the_body_is_taken(studio: Studio, run: StoredRun) -> None:
    names = tuple(marker.name for marker in run.body().markers)
    write_truth(run, "points", ("EarL", "EarR"))
    write_truth(run, "points_by_the_arms_names", names)
    listed = studio.get(f"{RUN}/tracks")
    assert listed["truth_problem"] == ""
    assert listed["tracks"][0]["mean_mm"] == pytest.approx(30.0, abs=0.1)
    # Of a body of other names it is the first one, which the run cannot be measured against.
    studio.put("/api/sessions/toy/subject", {"body": "mouse"})
    listed = studio.get(f"{RUN}/tracks")
    assert "EarL" in listed["truth_problem"]
    assert studio.get(f"{RUN}/frames")["truth_problem"] == listed["truth_problem"]
    studio.get("/api/sessions/toy")


def test_a_track_is_measured_against_the_joints_of_a_network(
    studio: Studio, run: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    body, track = run.body(), read_track(run)
    markers = marker_points(body, track.poses) + np.array([30.0, 0.0, 0.0])
    names = tuple(marker.name for marker in body.markers)
    seen = MarkerMotion(names, track.frames / run.record.fps, markers, "mm", run.record.fps)
    monkeypatch.setattr("studio.operations.person.person_landmarks", lambda *_: seen)
    response = begun(studio, "landmarks", {"track": "raw"})
    assert response["state"] == "done", response
    line = response["landmarks"]
    assert line["mean_mm"] == pytest.approx(30.0, abs=0.1)
    assert line["without_offsets_mm"] == pytest.approx(0.0, abs=0.1)
    assert (line["file"], line["seen"]) == ("landmarks.trc", 1.0)
    studio.get(f"{RUN}/exports/landmarks.trc")
    assert studio.get(f"{RUN}/exports")["exports"][0]["file"] == "landmarks.trc"


def test_one_camera_has_no_joints_in_space(studio: Studio, run: StoredRun) -> None:
    response = begun(studio, "landmarks", {})
    assert (response["state"], response["message"]) == ("failed", "One camera shows no place in space.")
    assert studio.get(f"{RUN}/exports")["exports"] == []
