"""Runs and settings through the API: what reaches the tracking process, and what is refused before."""

import dataclasses

import pytest
from web_doubles import Studio, state_of

from studio.foundations.knobs import knobs_of
from studio.operations.jobs import commands
from studio.operations.jobs.events import StateChanged
from studio.search.trackers.settings import AnnealedSettings
from studio.sessions.provenance import note
from studio.sessions.run_log import append_to_log
from studio.sessions.stored_run import StoredRun

RUN = "/api/sessions/take1/runs/first"


def posted(studio: Studio) -> list[type]:
    """The kinds of the commands that were sent."""
    return [type(command) for command in studio.control.commands]


def test_a_run_is_made_with_what_was_requested(studio: Studio) -> None:
    request = {
        "tracker": "condensation", "first": 1, "last": 3, "seed": 9, "settings": {"particles": 500}, "name": "c",
        "body": "human31",
    }  # fmt: skip
    line = studio.post("/api/sessions/take1/runs", request)
    assert (line["name"], line["tracker"], line["first"], line["last"], line["seed"]) == (
        "c",
        "condensation",
        1,
        3,
        9,
    )
    assert line["status"] == "new"
    detail = studio.get("/api/sessions/take1/runs/c")
    assert detail["settings"]["particles"] == 500
    assert len(detail["parameters"]) == len(detail["sigma"]) == len(detail["start_pose"]) == 31
    assert studio.post("/api/sessions/take1/runs", {})["name"] == "run-2"


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        ({"tracker": "none"}, 422),
        ({"tracker": "../x"}, 422),
        ({"body": "none"}, 422),
        ({"body": "/etc/passwd"}, 422),
        ({"first": 3, "last": 3}, 409),
        ({"last": 5}, 409),
        ({"first": -1}, 422),
        ({"seed": -1}, 422),
        ({"settings": {"particles": 0}}, 422),
        ({"settings": {"nothing": 1}}, 422),
        ({"settings": {"survival": 99.0}}, 422),
        ({"start_pose": [1.0]}, 422),
        ({"name": "con"}, 422),
        ({"unknown": 1}, 422),
    ],
)
def test_what_cannot_be_is_refused_in_words_and_nothing_is_made(
    studio: Studio, sent: dict[str, object], status: int
) -> None:
    answer = studio.post("/api/sessions/take1/runs", sent, code=status)
    assert set(answer) == {"code", "message", "hint", "status"}
    assert answer["message"]
    assert studio.get("/api/sessions/take1/runs")["runs"] == []


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("start", commands.Start),
        ("pause", commands.Pause),
        ("step-layer", commands.StepLayer),
        ("step-frame", commands.StepFrame),
        ("cancel", commands.Cancel),
    ],
)
@pytest.mark.parametrize(
    "known", [state_of(), state_of("take1", "first", "paused"), state_of("take1", "x", "paused")]
)
def test_a_command_names_its_run_whatever_is_known_to_be_open(
    studio: Studio, tracked: StoredRun, path: str, kind: type, known: StateChanged
) -> None:
    studio.control.state = known
    answer = studio.post(f"{RUN}/{path}", code=202)
    assert posted(studio) == [kind]
    (sent,) = studio.control.commands
    assert (sent.session, sent.run) == (str(tracked.folder.parents[1]), str(tracked.folder))
    assert answer == {"identifier": sent.identifier, "command": kind.__name__}


def test_frames_to_seek_and_to_anneal_again(studio: Studio, tracked: StoredRun) -> None:
    studio.control.state = state_of("take1", "first", "paused")
    studio.post(f"{RUN}/seek", {"frame": 1})
    studio.post(f"{RUN}/reanneal", {"frame": 1, "keep": True})
    studio.post(f"{RUN}/reanneal", {})
    seek, kept, selected = studio.control.commands
    assert isinstance(seek, commands.Seek)
    assert isinstance(kept, commands.Reanneal)
    assert isinstance(selected, commands.Reanneal)
    assert (seek.frame, kept.frame, kept.keep, selected.frame, selected.keep) == (1, 1, True, -1, False)
    studio.post(f"{RUN}/seek", {"frame": -2}, code=422)
    studio.post(f"{RUN}/seek", {}, code=422)


def test_while_another_run_is_tracked_a_start_waits_and_the_rest_is_refused(
    studio: Studio, tracked: StoredRun
) -> None:
    studio.control.state = state_of("take1", "other", "tracking")
    assert studio.post(f"{RUN}/start")["command"] == "Start"
    refused = studio.post(f"{RUN}/step-layer", code=409)
    assert "'other'" in refused["message"]
    studio.patch(f"{RUN}/settings", {"survival": 0.4}, code=409)
    assert studio.post(f"{RUN}/dequeue")["command"] == "Dequeue"
    assert posted(studio) == [commands.Start, commands.Dequeue]


def test_after_the_process_died_start_revives_it_and_goes_on(studio: Studio, tracked: StoredRun) -> None:
    studio.control.state = state_of("take1", "first", "lost")
    assert studio.get("/api/worker")["state"] == "lost"
    studio.post(f"{RUN}/start", code=202)
    assert "restart resume=False" in studio.control.calls
    assert posted(studio) == [commands.Start]
    studio.control.state = state_of("take1", "first", "lost")
    studio.post("/api/worker/restart", code=202)
    assert "restart resume=True" in studio.control.calls


def test_the_pace_is_set_and_reported_with_its_choices(studio: Studio) -> None:
    response = studio.get("/api/worker/pace")
    assert response["seconds_a_layer"] == 0.0
    assert [choice["label"] for choice in response["choices"]] == [
        "full speed", "10 layers/s", "3 layers/s", "1 layer/s",
    ]  # fmt: skip
    slow = response["choices"][2]["seconds_a_layer"]
    answer = studio.post("/api/worker/pace", {"seconds_a_layer": slow}, code=202)
    (sent,) = studio.control.commands
    assert isinstance(sent, commands.SetPace)
    assert sent.seconds_a_layer == slow
    assert answer == {"identifier": sent.identifier, "command": "SetPace"}
    studio.control.state = dataclasses.replace(state_of("take1", "first", "tracking"), seconds_a_layer=0.05)
    assert studio.get("/api/worker")["seconds_a_layer"] == 0.05
    response = studio.get("/api/worker/pace")
    assert response["choices"][1] == {"label": "20 layers/s", "seconds_a_layer": 0.05}


@pytest.mark.parametrize(
    "body", ["{}", *(f'{{"seconds_a_layer": {n}}}' for n in ("-0.1", "10.5", "NaN", '"slow"'))]
)
def test_what_is_no_pace_is_refused(studio: Studio, body: str) -> None:
    answer = studio.post(
        "/api/worker/pace", content=body, headers={"content-type": "application/json"}, code=422
    )
    assert answer["message"]
    assert studio.control.commands == []


def test_the_log_is_the_runs_own_file(studio: Studio, tracked: StoredRun) -> None:
    append_to_log(tracked.folder, "info", "Tracking from frame 0.")
    append_to_log(tracked.folder, "warning", "Slow.")
    lines = studio.get(f"{RUN}/log")["lines"]
    assert [(line["level"], line["text"]) for line in lines] == [
        ("info", "Tracking from frame 0."),
        ("warning", "Slow."),
    ]


# ---------------------------------------------------------------- settings


def test_knobs_are_the_declarations(studio: Studio) -> None:
    response = studio.get("/api/knobs", params={"tracker": "annealed", "weighting": "edge-region"})
    survival = next(entry for entry in response["knobs"] if entry["name"] == "survival")
    declared = next(entry for entry in knobs_of(AnnealedSettings) if entry.name == "survival")
    for name in ("label", "low", "high", "step", "default", "help", "unit", "group"):
        assert survival[name] == getattr(declared, name)
    assert survival["kind"] == "float"
    assert survival["takes_effect"] == "next layer"
    assert response["values"]["layers"] == AnnealedSettings().layers
    assert response["json_schema"]["properties"]["layers"]["maximum"] == 60
    studio.get("/api/knobs", params={"tracker": "none"}, code=422)


def test_choices_for_a_new_run(studio: Studio) -> None:
    response = studio.get("/api/choices")
    assert {"annealed", "condensation"} <= {entry["name"] for entry in response["trackers"]}
    assert {"edge-region", "bodytrack", "template"} <= {entry["name"] for entry in response["weightings"]}
    sizes = {entry["name"]: entry["parameters"] for entry in response["bodies"]}
    assert sizes["human31"] == 31
    own = studio.workspace.root / "bodies"
    own.mkdir()
    (own / "broken.toml").write_text("nonsense = [")
    assert "broken" not in {entry["name"] for entry in studio.get("/api/choices")["bodies"]}


def test_settings_in_use_and_every_change_before(studio: Studio, tracked: StoredRun) -> None:
    response = studio.get(f"{RUN}/settings")
    assert (response["version"], response["frame"], response["layer"]) == (2, 1, 1)
    assert response["values"]["survival"] == 0.77
    [change] = response["changes"]
    assert change == {"version": 2, "frame": 1, "layer": 1, "changed": ["survival"]}


def test_a_change_is_checked_here_and_handed_on(studio: Studio, tracked: StoredRun) -> None:
    studio.patch(f"{RUN}/settings", {"survival": 0.6, "layers": 5})
    assert studio.control.changes == [{"survival": 0.6, "layers": 5}]
    for wrong in ({"survival": 99.0}, {"survival": "x"}, {"none": 1}, {"layers": 2.5}, {"survival": None}):
        studio.patch(f"{RUN}/settings", wrong, code=422)
    assert len(studio.control.changes) == 1


def test_the_shown_frame_is_the_one_that_is_annealed_again(studio: Studio, tracked: StoredRun) -> None:
    studio.patch(f"{RUN}/settings", params={"frame": 1}, body={"survival": 0.6})
    studio.patch(f"{RUN}/settings", {"survival": 0.7})
    one, other = studio.control.commands
    assert isinstance(one, commands.ChangeSettings)
    assert isinstance(other, commands.ChangeSettings)
    assert (one.frame, other.frame, one.run) == (1, -1, str(tracked.folder))


def test_reset_and_presets(studio: Studio, tracked: StoredRun) -> None:
    client = studio.client
    client.post(f"{RUN}/settings/reset", json={"names": ["survival"]})
    assert studio.control.changes == [{"survival": AnnealedSettings().survival}]
    client.post(f"{RUN}/settings/reset", json={})
    assert "start_repeats" not in studio.control.changes[1]
    assert studio.control.changes[1]["layers"] == AnnealedSettings().layers
    assert client.post(f"{RUN}/settings/reset", json={"names": ["x"]}).status_code == 422

    kept = client.put("/api/presets/mine", json={"values": {"survival": 0.33}, "help": "for walks"}).json()
    assert {
        "name": "mine",
        "label": "mine",
        "help": "for walks",
        "values": {"survival": 0.33},
        **{"tracker": "", "weighting": "", "body": ""},
        "own": True,
    } in kept["presets"]
    assert client.post(f"{RUN}/settings/preset", json={"name": "mine"}).status_code == 200
    assert studio.control.changes[2] == {"survival": 0.33}
    assert client.post(f"{RUN}/settings/preset", json={"name": "none"}).status_code == 404
    # A paper's tracker is whole: no run of another likelihood takes a part of it.
    refused = client.post(f"{RUN}/settings/preset", json={"name": "paper, swarm"})
    assert refused.status_code == 422
    assert "made for swarm with edge-silhouette" in refused.json()["message"]
    assert len(studio.control.changes) == 3
    swarm = {
        "values": {"c_first": 2.1},
        "tracker": "swarm",
        "weighting": "edge-silhouette",
        "body": "human31",
    }
    kept = client.put("/api/presets/whole", json=swarm).json()["presets"]
    (whole,) = [entry for entry in kept if entry["name"] == "whole"]
    assert {name: whole[name] for name in swarm} == swarm
    wrong = client.put("/api/presets/whole", json={**swarm, "values": {"survival": 0.5}})
    assert wrong.status_code == 422
    assert client.put("/api/presets/whole", json={**swarm, "tracker": "nobody"}).status_code == 422
    assert client.delete("/api/presets/whole").status_code == 200
    assert client.put("/api/presets/odd", json={"values": {"none": 1}}).status_code == 422
    assert client.put("/api/presets/odd", json={"values": {}}).status_code == 422
    assert client.delete("/api/presets/mine").status_code == 200
    assert client.delete("/api/presets/mine").status_code == 404


def test_a_doubted_calibration_is_reported_and_tracked_only_if_requested(studio: Studio) -> None:
    """What measuring the masks finds is remembered by `provenance`; here it is written down as it would be."""
    doubt = "Cameras cam1 and cam2 seem to be exchanged. Exchange their names."
    note(studio.workspace.session("take1"), "background", "in doubt", good=False, stops=(doubt,))
    assert studio.get("/api/sessions/take1")["doubts"] == [doubt]
    refused = studio.post("/api/sessions/take1/runs", {"name": "refused"}, code=422)
    assert doubt in refused["message"]
    studio.get("/api/sessions/take1/runs/refused", code=404)
    request = {"name": "wished", "allow_inconsistent": True}
    studio.post("/api/sessions/take1/runs", request, code=201)
    notes = studio.get("/api/sessions/take1/runs/wished")["notes"]
    assert f"Tracked despite: {doubt}" in notes
