"""Behaviour models through the API: listed, chosen for a run, asked for by a knob that needs one."""

from arm_behaviour import arm_model, keep_arm_model
from toy_session import make_session, true_poses
from web_doubles import Studio

RUNS = "/api/sessions/toy/runs"
WISH = {"weighting": "edge-region", "start_pose": true_poses()[0].tolist()}


def with_arm(studio: Studio) -> Studio:
    """The studio's workspace with the arm's session and its model."""
    make_session(studio.workspace.root / "toy")
    keep_arm_model(studio.workspace.root)
    return studio


def test_models_are_among_the_choices(studio: Studio) -> None:
    assert studio.client.get("/api/choices").json()["behaviours"] == []
    path = keep_arm_model(studio.workspace.root)
    path.with_name("broken.behaviour").write_bytes(b"nonsense")
    told = studio.client.get("/api/choices").json()
    broken, swings = told["behaviours"]
    assert "damaged" in broken["problem"]
    model = arm_model()
    assert swings == {
        "name": "swings",
        "body": "planar_arm4",
        "clusters": model.clusters,
        "states": model.states,
        "frames": model.making.frames,
        "problem": "",
    }
    needs = {entry["name"]: entry["needs_behaviour"] for entry in told["trackers"]}
    assert needs == {"annealed": False, "behaviour": True, "condensation": False, "swarm": False}


def test_a_run_gets_the_model_asked_for_or_the_only_one(studio: Studio) -> None:
    client = with_arm(studio).client
    for number, wish in enumerate(
        ({"tracker": "behaviour"}, {"tracker": "behaviour", "behaviour": "swings"}, {"behaviour": "swings"})
    ):
        answer = client.post(RUNS, json={**WISH, **wish, "name": f"run{number}"})
        assert answer.status_code == 201, answer.text
        assert client.get(f"{RUNS}/run{number}").json()["behaviour"] == "swings"
    client.post(RUNS, json={**WISH, "name": "plain"})
    assert client.get(f"{RUNS}/plain").json()["behaviour"] == ""


def test_what_does_not_fit_is_refused_with_the_reason(studio: Studio) -> None:
    client = with_arm(studio).client
    for wish, status, words in (
        ({"tracker": "behaviour", "behaviour": "none"}, 404, "swings"),
        ({"behaviour": "../swings"}, 422, ""),
    ):
        answer = client.post(RUNS, json={**WISH, **wish})
        assert answer.status_code == status, answer.text
        assert words in answer.text
    answer = client.post("/api/sessions/take1/runs", json={"behaviour": "swings"})
    assert answer.status_code == 422
    assert "4 parameters" in answer.json()["message"]
    answer = client.post("/api/sessions/take1/runs", json={"tracker": "behaviour"})
    assert answer.status_code == 422
    assert "planar_arm4" in answer.json()["hint"]


def test_a_live_change_to_prediction_needs_a_model(studio: Studio) -> None:
    client = with_arm(studio).client
    client.post(RUNS, json={**WISH, "name": "plain"})
    client.post(RUNS, json={**WISH, "name": "guided", "behaviour": "swings"})
    refused = client.patch(f"{RUNS}/plain/settings", json={"prediction": "behaviour"})
    assert refused.status_code == 422
    assert "no behaviour model" in refused.json()["message"]
    assert studio.control.changes == []
    assert client.patch(f"{RUNS}/guided/settings", json={"prediction": "behaviour"}).status_code == 200
    assert studio.control.changes == [{"prediction": "behaviour"}]


def test_the_form_offers_models(studio: Studio) -> None:
    page = studio.client.get("/assets/js/new_run.js").text
    assert "Behaviour model" in page
    assert "needs_behaviour" in page
