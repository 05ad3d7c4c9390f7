"""Behaviour models through the API and as a page: clusters as poses, who follows whom, entropies, walks."""

import dataclasses
import itertools
from importlib import resources

import numpy as np
import pytest
from toy_behaviour import FPS, recordings, toy_model
from web_doubles import Studio

from studio.app.server.page_routes import RAILED, UNRAILED
from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.foundations.errors import BodyError
from studio.operations import behaviour_details
from studio.runs.behaviour_models import SUFFIX, models_folder
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import write_model


@pytest.fixture(scope="module")
def model() -> BehaviourModel:
    return toy_model()


@pytest.fixture
def learnt(studio: Studio, model: BehaviourModel) -> Studio:
    """A workspace with one model."""
    folder = models_folder(studio.workspace.root)
    folder.mkdir(parents=True)
    write_model(model, folder / f"wave{SUFFIX}")
    return studio


def test_models_are_listed_and_a_damaged_one_says_why(learnt: Studio, model: BehaviourModel) -> None:
    (models_folder(learnt.workspace.root) / f"broken{SUFFIX}").write_bytes(b"nothing")
    broken, wave = learnt.get("/api/behaviours")["models"]
    assert (broken["name"], wave["name"]) == ("broken", "wave")
    assert broken["problem"]
    assert wave["entropy_test"] is None
    assert (wave["clusters"], wave["states"], wave["fps"]) == (model.clusters, model.states, FPS)


def test_clusters_are_poses_with_their_share_and_their_movement(
    learnt: Studio, model: BehaviourModel
) -> None:
    response = learnt.get("/api/behaviours/wave")
    assert [limb["side"] for limb in response["limbs"]] == ["middle"] * 4
    assert {cluster["cluster"] for cluster in response["clusters"]} == set(range(model.clusters))
    shares = [cluster["share"] for cluster in response["clusters"]]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) == pytest.approx(1.0)
    body = load_body("planar_arm4")
    for cluster in response["clusters"]:
        number = cluster["cluster"]
        pose = model.prototypes.poses[number]
        ends = limb_ends(body, pose[None])[0]
        np.testing.assert_allclose(cluster["limbs"], ends, atol=0.06)
        # The arm's tip moves along the arrow: seen again a frame later, on a straight line.
        later = limb_ends(body, (pose + 1e-4 * model.prototypes.derivatives[number])[None])[0]
        speed = (later[-1, 1] - ends[-1, 1]) * 1e4 * FPS
        ((begin, end),) = cluster["arrows"]
        np.testing.assert_allclose(
            np.subtract(end, begin), speed * response["arrow_seconds"], atol=0.2 + 0.01 * np.abs(speed).max()
        )


def test_stays_and_transitions_are_counted_in_the_recordings(learnt: Studio, model: BehaviourModel) -> None:
    response = learnt.get("/api/behaviours/wave")
    runs: dict[int, list[int]] = {}
    follows: dict[tuple[int, int], int] = {}
    for poses in recordings():
        labels = model.labels(poses).tolist()
        for before, after in itertools.pairwise(labels):
            if before != after:
                follows[before, after] = follows.get((before, after), 0) + 1
        for label, row in itertools.groupby(labels):
            runs.setdefault(label, []).append(len(list(row)))
    for cluster in response["clusters"]:
        assert cluster["stays"] == pytest.approx(np.mean(runs[cluster["cluster"]]))
    for transition in response["transitions"]:
        source = transition["source"]
        left = sum(count for (before, _), count in follows.items() if before == source)
        assert transition["probability"] == pytest.approx(follows[source, transition["target"]] / left)
    assert sum(response["context_lengths"]) == model.states
    assert sum(response["kept_lengths"]) == int(model.automaton.kept.sum())


def test_a_longer_memory_says_what_it_was_learnt_from_better(learnt: Studio) -> None:
    lines = learnt.get("/api/behaviours/wave/entropies")["lines"]
    assert len(lines) == 2
    for line in lines:
        assert line["memory"][0] == 1
        assert line["states"][0] <= line["states"][-1]
        assert line["train"][-1] <= line["train"][0]
    assert lines[0]["train"][-1] < lines[0]["train"][0]
    for line in lines:
        assert len(line["test"]) == len(line["memory"])
    assert sum(lines[1]["states"]) <= sum(lines[0]["states"])


def test_a_walk_goes_along_the_automaton_and_is_the_same_again(learnt: Studio, model: BehaviourModel) -> None:
    path = "/api/behaviours/wave/walk?frames=60&seed=4"
    walk = learnt.get(path)
    assert walk == learnt.get(path)
    assert walk != learnt.get("/api/behaviours/wave/walk?frames=60&seed=5") | {"seed": 4}
    assert np.shape(walk["frames"]) == (60, 4, 2, 3)
    assert [history[-1] for history in walk["histories"]] == walk["clusters"]
    contexts = list(model.automaton.contexts)
    for before, after in itertools.pairwise(walk["histories"]):
        state = contexts.index(tuple(before))
        assert model.automaton.probabilities[state, after[-1]] > 0.0


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("none", 404),
        ("none/walk", 404),
        ("..%2Fx", 404),
        ("wave/walk?frames=1", 422),
        ("wave/walk?seed=-1", 422),
    ],
)
def test_what_is_not_there_is_reported(learnt: Studio, path: str, status: int) -> None:
    answer = learnt.get(f"/api/behaviours/{path}", code=status)
    assert answer["message"]


def test_a_model_is_renamed_and_keeps_what_it_holds(learnt: Studio) -> None:
    before = learnt.get("/api/behaviours/wave")["clusters"]
    assert learnt.patch("/api/behaviours/wave", {"name": "greeting"}) == {"name": "greeting"}
    learnt.get("/api/behaviours/wave", code=404)
    response = learnt.get("/api/behaviours/greeting")
    assert response["model"]["name"] == "greeting"
    assert response["clusters"] == before


@pytest.mark.parametrize("name", ["../out", "", "a b", None])
def test_a_model_is_not_renamed_to_what_is_no_name(learnt: Studio, name: str | None) -> None:
    assert learnt.client.patch("/api/behaviours/wave", json={"name": name}).status_code in (400, 422)
    learnt.get("/api/behaviours/wave")


def test_a_model_never_takes_the_place_of_another(learnt: Studio, model: BehaviourModel) -> None:
    folder = models_folder(learnt.workspace.root)
    write_model(model, folder / f"other{SUFFIX}")
    content = (folder / f"other{SUFFIX}").read_bytes()
    answer = learnt.patch("/api/behaviours/wave", {"name": "OTHER"}, code=422)
    assert "already" in answer["message"]
    assert (folder / f"other{SUFFIX}").read_bytes() == content


def test_what_is_thrown_away_comes_back_from_the_trash(learnt: Studio, model: BehaviourModel) -> None:
    folder = models_folder(learnt.workspace.root)
    content = (folder / f"wave{SUFFIX}").read_bytes()
    thrown = learnt.delete("/api/behaviours/wave")
    assert (thrown["name"], thrown["kind"], thrown["restorable"]) == ("wave", "model", True)
    assert learnt.get("/api/behaviours")["models"] == []
    assert learnt.get("/api/trash")["entries"] == [thrown]
    write_model(model, folder / f"wave{SUFFIX}")
    back = learnt.post("/api/trash/restore", {"entry": thrown["id"]})
    assert back["model"] == "wave-2"
    assert (folder / f"wave-2{SUFFIX}").read_bytes() == content
    assert learnt.get("/api/trash")["entries"] == []
    assert [path.name for path in folder.iterdir() if path.name.startswith(".")] == []


def test_a_model_without_its_body_tells_its_numbers_and_says_why(
    learnt: Studio, model: BehaviourModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(name: str, _folders: tuple) -> None:
        raise BodyError(f"There is no body '{name}'.", "Known: human25.")

    monkeypatch.setattr(behaviour_details, "load_body", gone)
    response = learnt.get("/api/behaviours/wave")
    assert "body 'planar_arm4' no longer exists" in response["problem"]
    assert response["clusters"] == response["limbs"] == []
    assert response["model"]["states"] == model.states == sum(response["context_lengths"])
    assert learnt.get("/api/behaviours/wave/entropies")["lines"]
    walk = learnt.get("/api/behaviours/wave/walk?frames=5", code=422)
    assert "no longer exists" in walk["message"]


def test_a_body_of_the_workspaces_own_is_found(learnt: Studio, model: BehaviourModel) -> None:
    own = dataclasses.replace(model, space=dataclasses.replace(model.space, body="my_arm"))
    write_model(own, models_folder(learnt.workspace.root) / f"own{SUFFIX}")
    assert "my_arm" in learnt.get("/api/behaviours/own")["problem"]
    bodies = learnt.workspace.root / "bodies"
    bodies.mkdir()
    text = (resources.files("studio.body") / "models" / "planar_arm4.toml").read_text(encoding="utf-8")
    (bodies / "my_arm.toml").write_text(text.replace("planar_arm4", "my_arm"))
    response = learnt.get("/api/behaviours/own")
    assert response["problem"] == ""
    assert len(response["clusters"]) == model.clusters
    assert "my_arm" in learnt.get("/api/learning")["bodies"]


@pytest.mark.parametrize("page", [*RAILED, *UNRAILED])
def test_every_page_has_its_module_and_its_list(studio: Studio, page: str) -> None:
    text = studio.client.get(f"/{page}").text
    assert "{{" not in text
    assert f"/assets/js/{page}.js" in text
    assert ('id="entries"' in text) == (page in RAILED)
