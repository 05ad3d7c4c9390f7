"""What was tried of a frame is kept from the events, listed beside what is stored, and stands in any view's tables."""

from dataclasses import replace

import pytest
from waiting import until
from web_doubles import Studio

from studio.operations.jobs.events import FrameFinished, LayerFinished, SettingsApplied
from studio.sessions.stored_run import StoredRun

RUN = "/api/sessions/take1/runs/first"
LAYERS = 5


def try_frame(studio: Studio, run: StoredRun, survival: float) -> list:
    """Let the tracking process say that it annealed the frame 1 again with more layers; these."""
    used = {**run.record.settings, "survival": survival, "layers": LAYERS}
    studio.control.say(SettingsApplied("take1", "first", 3, 1, 0, used))
    with run.results() as results:
        stored, known = results.result(1), results.layers(1)
    layers = [
        replace(
            known[at % len(known)],
            layer=at,
            settings_version=3,
            beta=survival + at,
            variance_weighed=survival * known[0].variance_weighed,
        )
        for at in range(LAYERS)
    ]
    for layer in layers:
        studio.control.say(LayerFinished("take1", "first", layer, True))
    tried = replace(stored, layers=LAYERS, evaluations=35, settings_version=3, milliseconds=15.0)
    studio.control.say(FrameFinished("take1", "first", tried, True))
    return layers


def listed(studio: Studio) -> dict:
    return studio.get(f"{RUN}/frames/1/trials")


def test_what_was_tried_is_listed_beside_what_is_stored(studio: Studio, tracked: StoredRun) -> None:
    assert listed(studio)["trials"] == []
    try_frame(studio, tracked, 0.4)
    until(lambda: len(listed(studio)["trials"]) == 1)
    try_frame(studio, tracked, 0.6)
    until(lambda: len(listed(studio)["trials"]) == 2)
    answer = listed(studio)
    assert [
        {knob["name"]: (knob["stored"], knob["tried"]) for knob in one["moved"]} for one in answer["trials"]
    ] == [{"survival": (0.3, value), "layers": (10, LAYERS)} for value in (0.4, 0.6)]
    stored, first = answer["stored"], answer["trials"][0]
    assert (stored["layers"], stored["evaluations"]) == (3, 21)
    assert (first["layers"], first["evaluations"], first["milliseconds"]) == (LAYERS, 35, 15.0)
    assert answer["limbs_by"] == "share", "there is no truth"
    assert len(first["sketch"]) == len(answer["sides"]) >= 10


def test_a_trial_stands_in_the_place_of_its_frame(studio: Studio, tracked: StoredRun) -> None:
    layers = try_frame(studio, tracked, 0.4)
    until(lambda: listed(studio)["trials"])
    name = listed(studio)["trials"][0]["name"]
    detail = studio.get(f"{RUN}/trials/{name}")
    assert (detail["frame"], len(detail["layers"])) == (1, LAYERS)
    assert detail["layers"][2]["variance_weighed"] == layers[2].variance_weighed.tolist()
    for view in ("variance", "schedule"):
        told = studio.get(f"{RUN}/frames/1/views/{view}?trial={name}")
        at = [column["key"] for column in told["tables"][0]["columns"]].index("layer")
        assert {row[at] for row in told["tables"][0]["rows"]} == set(range(LAYERS)), view
        assert "tried again, not stored" in told["caption"]
        assert "survival 0.4" in told["caption"]
    stored = studio.get(f"{RUN}/frames/1/views/schedule")
    assert len(stored["tables"][0]["rows"]) == 3
    frames = studio.get(f"{RUN}/views/schedule?trial={name}")["tables"][0]["rows"]
    assert [row[0] for row in frames] == [0, 1]
    assert frames[1][2] == pytest.approx(layers[-1].beta)
    missing = studio.get(f"{RUN}/trials/1-nothing", code=404)
    assert "same knobs" in missing["hint"]


def test_the_second_scene_shows_the_trial(studio: Studio, tracked: StoredRun) -> None:
    try_frame(studio, tracked, 0.4)
    until(lambda: listed(studio)["trials"])
    trial = f"take1/first/{listed(studio)['trials'][0]['name']}"
    headers = {"x-studio-window": "w"}

    def show(**request: object) -> None:
        studio.post("/api/scene/show", request, headers=headers, code=204)

    show(trial=trial)
    own = studio.scenes.scene("w").calls
    assert own[-1] == ("trial", 1, LAYERS)
    show(twin=True, trial=trial, against="")
    assert own[-2:] == [("split", True), ("trial", None, 0)]
    twin = studio.scenes.twin("w")
    assert twin.calls == [("trial", 1, LAYERS)]
    show(against=trial)
    assert own[-1] == ("trial", 1, LAYERS)
    show(twin=False)
    assert studio.scenes.twin("w") is None
