"""Bodies over HTTP: the list, all that can be changed of one, changes that are checked, own ones saved and used."""

from pathlib import Path

import pytest
from toy_session import make_session
from web_doubles import Studio

from studio.body.catalogue import load_body


@pytest.fixture
def session(studio: Studio) -> str:
    root = studio.get("/api/sessions")
    if not any(one["name"] == "toy" for one in root["sessions"]):
        make_session(studio.workspace.root / "toy")
    return "toy"


def edit(studio: Studio, name: str, status: int = 200, **change: object) -> dict:
    answer = studio.post(f"/api/bodies/{name}/edit", change, code=status)
    return answer


def test_all_bodies_are_listed_with_whose_they_are(studio: Studio, session: str) -> None:
    edit(studio, "mouse", save_as="rat")
    edit(studio, "dog", save_as="wolf", session=session)
    (studio.workspace.root / "bodies" / "broken.toml").write_text("title = 3")
    answer = studio.get("/api/bodies", params={"session": session})
    own = {one["name"]: one["own"] for one in answer["bodies"]}
    assert (own["mouse"], own["rat"], own["wolf"]) == ("", "workspace", "session")
    broken = next(one for one in answer["bodies"] if one["name"] == "broken")
    assert "broken.toml" in broken["problem"]
    assert answer["chosen"] == studio.get(f"/api/sessions/{session}")["body"]["name"]
    without = studio.get("/api/bodies")
    assert "wolf" not in {one["name"] for one in without["bodies"]}


def test_a_body_has_everything_that_can_be_changed(studio: Studio) -> None:
    detail = studio.get("/api/bodies/mouse")
    mouse = load_body("mouse")
    assert [one["name"] for one in detail["limbs"]] == [limb.name for limb in mouse.limbs]
    haunch = next(one for one in detail["limbs"] if one["name"] == "left haunch")
    assert haunch["radius_start"] == {"value": 12.0, "dimension": "haunch_radius_start"}
    assert haunch["length"]["value"] == 20.0
    assert {one["name"] for one in detail["dimensions"]} >= {"hip_offset", "ear_offset"}
    head = next(one for one in detail["limits"] if one["name"] == "head_nod")
    assert (head["lower"], head["upper"], head["neutral"]) == (-50.0, 80.0, 30.0)
    assert next(one for one in detail["limits"] if one["name"] == "heading")["lower"] is None
    assert detail["sided"] is True
    assert len(detail["markers"]) == len(mouse.markers)
    assert studio.get("/api/bodies/planar_arm4")["sided"] is False


def test_an_empty_name_saves_nothing(studio: Studio) -> None:
    assert edit(studio, "mouse", save_as="")["saved"] == ""
    assert edit(studio, "mouse", save_as="", session="")["saved"] == ""
    assert edit(studio, "mouse", 422, save_as="a" * 65)["code"] == "request"


def test_changes_go_from_text_to_text_and_back(studio: Studio) -> None:
    first = edit(studio, "mouse", sizes={"left haunch.radius_start": 14.5})
    second = edit(studio, "mouse", text=first["text"], limits={"head_nod.upper": "inf"}, mirror="left")
    assert next(one for one in second["limits"] if one["name"] == "head_nod")["upper"] is None
    assert (
        next(one for one in second["limbs"] if one["name"] == "right haunch")["radius_start"]["value"] == 14.5
    )
    assert edit(studio, "mouse", text=first["text"])["text"] == first["text"]
    assert second["saved"] == ""
    assert not (studio.workspace.root / "bodies").exists()


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"sizes": {"loin_length": -4}}, "loin_length"),
        ({"sizes": {"nothing": 4}}, "nothing"),
        ({"limits": {"head_nod.lower": 95}}, "head_nod"),
        ({"markers": ["A=nowhere,0,0,0"]}, "nowhere"),
        ({"text": "title = 'x'\nparameters = []\njoints = []\nlimbs = []\n"}, "no parameters"),
        ({"text": "this is no TOML"}, "TOML"),
        ({"save_as": "mouse"}, "mouse"),
    ],
)
def test_what_is_wrong_is_answered_in_words(studio: Studio, change: dict, part: str) -> None:
    answer = studio.client.post("/api/bodies/mouse/edit", json=change)
    assert answer.status_code in (400, 409, 422), answer.text
    assert part in answer.json()["message"]
    assert answer.json()["hint"]


def test_an_own_body_is_saved_chosen_and_thrown_away_when_nobody_needs_it(
    studio: Studio, session: str
) -> None:
    saved = edit(studio, "mouse", sizes={"loin_length": 31}, save_as="rat", session=session)
    assert saved["saved"] == "rat"
    assert (studio.workspace.root / session / "bodies" / "rat.toml").is_file()
    chosen = studio.put(f"/api/sessions/{session}/subject", {"body": "rat"})
    assert chosen["dimensions"]["loin_length"] == 31.0
    # In the session it begins in its subject's size, and a new run may have it.
    assert studio.get("/api/bodies/rat", params={"session": session})["name"] == "rat"
    refused = studio.delete("/api/bodies/rat", code=422, params={"session": session})
    assert session in refused["message"]
    studio.put(f"/api/sessions/{session}/subject", {"body": "mouse"})
    gone = studio.delete("/api/bodies/rat", params={"session": session})
    assert list(studio.workspace.root.rglob(gone["trash"]))
    assert not (studio.workspace.root / session / "bodies" / "rat.toml").exists()
    studio.put(f"/api/sessions/{session}/subject", {}, code=422)


def test_the_scene_shows_a_body_that_is_being_made(studio: Studio, session: str) -> None:
    text = edit(studio, "mouse", sizes={"loin_length": 31})["text"]
    studio.post("/api/scene/show", {"session": session, "body": text}, code=204)
    what, where, (_, dimensions) = studio.stage.calls[-1]
    assert (what, where, dimensions["loin_length"]) == ("try_body", session, 31.0)
    studio.post("/api/scene/show", {"body": "title = 3"}, code=422)
    assert studio.stage.calls[-1][0] == "try_body"


def test_a_broken_upload_names_the_entry(studio: Studio) -> None:
    text = Path(load_body.__code__.co_filename).with_name("models") / "mouse.toml"
    broken = text.read_text().replace('parent = "skull"', 'parent = "wing"', 1)
    answer = studio.post("/api/bodies/mine/edit", {"text": broken}, code=422)
    assert "wing" in answer["message"]
