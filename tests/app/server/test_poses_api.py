"""Poses set by hand, over the API: start poses, drags, mirrors, the search around a pose, the editor in the scene."""

import csv

import numpy as np
import pytest
from toy_session import make_session, true_poses
from web_doubles import Studio

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

ARM = load_body("planar_arm4")
POSE = [0.1, -0.2, 0.3, 0.1]
TOY = "/api/sessions/toy"


@pytest.fixture
def toy(workspace: Workspace) -> Session:
    """The toy arm in the studio's workspace, with a run."""
    session = make_session(workspace.root / "toy")
    prepare_run(session, name="one", start_pose=true_poses()[0])
    return session


def test_a_start_pose_is_kept_and_the_old_one_stays_beside_it(studio: Studio, toy: Session) -> None:
    path = f"{TOY}/start-pose"
    before = studio.get(path)
    assert before["body"] == ARM.name
    assert [grip["name"] for grip in before["grips"]] == [limb.name for limb in ARM.drawn]
    assert not before["has_sides"]
    studio.put(path, {"pose": POSE})
    assert studio.get(path)["stored"]
    assert studio.get(path)["pose"] == pytest.approx(POSE)
    studio.put(path, {"pose": [0.0] * 4})
    with (toy.path / "start_pose-before.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0][0] == "frame"
    assert [float(value) for value in rows[-1][1:]] == pytest.approx(POSE)
    assert studio.put(path, {"pose": POSE, "frame": 2})["frame"] == 2
    assert studio.get(TOY)["start_pose_frame"] == 2
    made = studio.client.post(f"{TOY}/runs", json={"name": "later"})
    assert (made.status_code, made.json()["first"]) == (201, 2)
    studio.put(path, {"pose": POSE, "frame": 99}, code=409)
    refused = studio.put(path, {"pose": [0.0]}, code=422)
    assert "4 finite numbers" in refused["message"]


def test_a_drag_brings_the_tip_to_its_target(studio: Studio, toy: Session) -> None:
    path = f"{TOY}/pose/drag"
    wanted = limb_ends(ARM, np.array([0.4, 0.2, -0.1, 0.3]))[0, -1, 1]
    request = {"pose": POSE, "limb": ARM.drawn[-1].name, "target": wanted.tolist()}
    found = studio.post(path, request)
    assert found["left_mm"] < 1.0
    np.testing.assert_allclose(limb_ends(ARM, np.array(found["pose"]))[0, -1, 1], wanted, atol=1.0)
    refused = studio.post(path, request | {"limb": "wing"}, code=422)
    assert "no limb 'wing'" in refused["message"]
    mirrored = studio.post(path.replace("drag", "mirror"), {"pose": POSE}, code=422)
    assert "no left and right" in mirrored["message"]


def test_the_search_around_a_pose_ends_nearer_to_the_truth(studio: Studio, toy: Session) -> None:
    truth = true_poses()[3]
    off = (truth + np.array([0.12, -0.1, 0.1, -0.08])).tolist()
    path = f"{TOY}/pose/refine"
    begun = studio.post(path, {"pose": off, "frame": 3}, code=202)
    state = studio.ended(f"/api/track-jobs/{begun['identifier']}")
    assert state["state"] == "done", state
    assert state["verb"] == "pose"
    assert state["gain"] > 0.0
    assert state["overlap"] > state["overlap_before"]
    right, begun_at, found = limb_ends(ARM, np.array([truth, off, state["pose"]]))
    assert (
        np.linalg.norm(found - right, axis=-1).mean() < 0.6 * np.linalg.norm(begun_at - right, axis=-1).mean()
    )


def test_the_editor_in_the_scene_is_opened_read_and_left(studio: Studio, toy: Session) -> None:
    client, name = studio.client, toy.name
    assert client.get("/api/scene/edit").json()["editing"] is False
    refused = client.post("/api/scene/edit", json={"session": name, "run": "one"})
    assert refused.status_code == 422
    assert "needs a frame" in refused.json()["message"]
    request = {"session": name, "run": "one", "frame": 1, "pose": POSE}
    assert client.post("/api/scene/edit", json=request).status_code == 202
    response = client.get("/api/scene/edit").json()
    assert (response["run"], response["frame"], response["pose"], response["moved"]) == ("one", 1, POSE, True)
    assert client.delete("/api/scene/edit").status_code == 202
    assert client.get("/api/scene/edit").json()["editing"] is False


def test_pictures_carry_the_pose_that_is_requested(studio: Studio, toy: Session) -> None:
    base = f"{TOY}/frames/0/views/front.jpg?show=outline"
    bare, posed = studio.client.get(base), studio.client.get(f"{base}&pose={','.join(map(str, POSE))}")
    assert bare.status_code == posed.status_code == 200
    assert bare.content != posed.content
    studio.get(f"{base}&pose=1,2", code=422)
    studio.put(f"{TOY}/start-pose", {"pose": POSE})
    assert studio.client.get(f"{base}&pose=start").content == posed.content
