"""Comparisons and reports through the API: refused before, worked at behind, kept, downloaded, thrown away."""

import csv
import io
import json
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import waiting
from sample_walk import copy_of_walk
from web_doubles import Studio

from studio.app.server import report_routes
from studio.garden.reproduction.papers import PapersExperiments
from studio.operations.comparison_folders import new_comparison, place_of
from studio.operations.experiments import TrialCounts
from studio.results.comparison.candidates import Lineup
from studio.results.comparison.plan import plan_comparison

WISH = {
    "session": "walk", "trackers": [{"name": "annealed"}, {"name": "annealed:eq13", "settings": {"survival": 0.5}}],
    "evaluations": 60, "seeds": 2, "layers": 3, "last": 3,
}  # fmt: skip


@pytest.fixture
def compared(studio: Studio) -> Studio:
    """The studio with the bundled walk, which has a truth."""
    copy_of_walk(studio.workspace.root / "walk")
    return studio


def until(studio: Studio, name: str, *statuses: str) -> dict:
    """The comparison when it has come to one of these states."""
    path = f"/api/comparisons/walk/{name}"
    return studio.when(path, lambda answer: answer["comparison"]["status"] in statuses)


@pytest.mark.slow
def test_a_comparison_is_made_kept_and_downloaded(compared: Studio) -> None:
    client = compared.client
    begun = client.post("/api/comparisons", json=WISH)
    assert begun.status_code == 202, begun.text
    assert (begun.json()["name"], begun.json()["total"]) == ("comparison-1", 4)
    response = until(compared, "comparison-1", "done", "failed")
    line, result = response["comparison"], response["result"]
    assert (line["status"], line["done"], line["trackers"]) == ("done", 4, ["annealed", "annealed:eq13"])
    assert response["settings"]["annealed:eq13"]["survival"] == 0.5
    assert [entry["evaluations"] for entry in result["trackers"]] == [60, 60]
    best = min(result["trackers"], key=lambda entry: entry["mean_mm"])
    assert (line["best"], line["best_mm"]) == (best["tracker"], best["mean_mm"])
    assert result["findings"]["charts"][0]["kind"] == "lines"
    (listed,) = client.get("/api/comparisons", params={"session": "walk"}).json()["comparisons"]
    assert listed == line
    sessions = client.get("/api/sessions").json()["sessions"]
    assert {entry["name"]: entry["comparisons"] for entry in sessions} == {"take1": 0, "walk": 1}

    document = client.get("/api/comparisons/walk/comparison-1/result.json")
    assert document.json()["trackers"] == result["trackers"]
    assert "walk-comparison-1.json" in document.headers["content-disposition"]
    rows = list(csv.reader(io.StringIO(client.get("/api/comparisons/walk/comparison-1/frames.csv").text)))
    assert len(rows) == 1 + 2 * 2 * 3

    entry = client.delete("/api/comparisons/walk/comparison-1").json()
    assert (entry["kind"], entry["restorable"]) == ("comparison", True)
    assert client.get("/api/comparisons/walk/comparison-1").status_code == 404
    assert [one["name"] for one in client.get("/api/trash").json()["entries"]] == ["walk / comparison-1"]
    back = client.post("/api/trash/restore", json={"entry": entry["id"]}).json()
    assert (back["name"], back["comparison"]) == ("walk", "comparison-1")
    assert client.get("/api/comparisons/walk/comparison-1").json()["result"]["trackers"] == result["trackers"]


def test_one_runs_at_a_time_is_cancelled_and_goes_on(compared: Studio) -> None:
    client = compared.client
    client.post("/api/comparisons", json={**WISH, "seeds": 40})
    second = client.post("/api/comparisons", json={**WISH, "name": "second"})
    assert second.status_code == 409
    assert "'comparison-1' of 'walk' is running" in second.json()["message"]
    assert "second" not in [line["name"] for line in client.get("/api/comparisons").json()["comparisons"]]
    for refused in (
        client.delete("/api/comparisons/walk/comparison-1"),
        client.delete("/api/sessions/walk"),
        client.patch("/api/sessions/walk", json={"name": "other"}),
    ):
        assert refused.status_code == 409, refused.text
    assert client.post("/api/comparisons/walk/comparison-1/cancel").json()["status"] in (
        "cancelling",
        "cancelled",
    )
    until(compared, "comparison-1", "cancelled")
    assert client.get("/api/comparisons/walk/comparison-1/result.json").status_code == 404
    assert client.post("/api/comparisons/walk/comparison-1/resume").json()["status"] in ("queued", "running")
    client.post("/api/comparisons/walk/comparison-1/cancel")
    until(compared, "comparison-1", "cancelled")
    assert client.patch("/api/sessions/walk", json={"name": "other"}).status_code == 200
    assert client.get("/api/comparisons/other/comparison-1").json()["comparison"]["total"] == 80


@pytest.mark.slow
def test_an_interrupted_one_is_offered_to_go_on(compared: Studio) -> None:
    session = compared.workspace.session("walk")
    plan = plan_comparison(session, Lineup(("annealed",), "", 60, 3), (0,), last=2)
    new_comparison(place_of(session), plan)
    (line,) = compared.get("/api/comparisons")["comparisons"]
    assert (line["status"], line["done"], line["total"]) == ("interrupted", 0, 1)
    compared.post("/api/comparisons/walk/comparison-1/resume", code=202)
    assert until(compared, "comparison-1", "done")["comparison"]["best"] == "annealed"


@pytest.mark.slow
def test_a_server_that_ends_leaves_it_to_go_on(compared: Studio) -> None:
    compared.post("/api/comparisons", {**WISH, "seeds": 40})
    deadline = time.monotonic() + waiting.PATIENCE
    while compared.get("/api/comparisons")["comparisons"][0]["done"] == 0:
        assert time.monotonic() < deadline
    compared.app.state.studio.jobs.close()
    (line,) = compared.get("/api/comparisons")["comparisons"]
    assert line["status"] == "interrupted"
    assert 1 <= line["done"] < 80


@pytest.mark.slow
def test_what_fails_is_said(compared: Studio) -> None:
    session = compared.workspace.session("walk")
    plan = plan_comparison(session, Lineup(("annealed",), "", 60, 3), (0,), last=2)
    wrong = replace(plan.candidates[0], changes={"survivor": 1})
    new_comparison(place_of(session), replace(plan, candidates=(wrong,)))
    compared.post("/api/comparisons/walk/comparison-1/resume", code=202)
    assert "survivor" in until(compared, "comparison-1", "failed")["comparison"]["problem"]


@pytest.mark.parametrize(
    ("change", "status", "words"),
    [
        ({"session": "take1"}, 422, "no truth"),
        ({"session": "nobody"}, 404, "no session"),
        ({"trackers": []}, 422, "trackers"),
        ({"trackers": [{"name": "nobody"}]}, 422, "no tracker 'nobody'"),
        ({"trackers": [{"name": "../x"}]}, 422, "name"),
        ({"trackers": [{"name": "annealed", "settings": {"layers": 99}}]}, 422, "layers"),
        ({"trackers": [{"name": "annealed"}, {"name": "annealed"}]}, 422, "twice"),
        ({"weighting": "none"}, 422, "no weighting"),
        ({"body": "none"}, 422, "body"),
        ({"last": 1000}, 409, "0:150"),
        ({"evaluations": 1}, 422, "too few"),
        ({"seeds": 0}, 422, "seeds"),
        ({"name": "a/b"}, 422, "name"),
        ({"unknown": 1}, 422, "unknown"),
    ],
)
def test_what_cannot_be_compared_is_refused_and_nothing_is_made(
    compared: Studio, change: dict, status: int, words: str
) -> None:
    answer = compared.post("/api/comparisons", {**WISH, **change}, code=status)
    assert answer.keys() == {"code", "message", "hint", "status"}
    assert words in answer["message"] + answer["hint"]
    assert not (compared.workspace.root / "walk" / "comparisons").exists()


def test_addresses_lead_nowhere_else(compared: Studio) -> None:
    for path in ("walk/nothing", "walk/..%2f..", "nobody/x", "take1/comparison-1"):
        assert compared.client.get(f"/api/comparisons/{path}").status_code in (404, 422), path


def test_who_can_take_part_is_reported(studio: Studio) -> None:
    response = studio.get("/api/comparisons/choices")
    names = {entry["name"]: entry for entry in response["candidates"]}
    assert {"annealed", "condensation", "swarm", "annealed:eq13"} <= names.keys()
    assert names["annealed:eq13"]["changes"]["adaptive_diffusion"] is False
    for lineup in response["lineups"]:
        assert set(lineup["trackers"]) <= names.keys()
    assert "edge-region" in response["weightings"]


def test_the_pages_are_served(studio: Studio) -> None:
    for path in ("/comparisons", "/reports"):
        answer = studio.client.get(path)
        assert answer.status_code == 200
        assert "text/html" in answer.headers["content-type"]
        assert "script-src 'self'" in answer.headers["content-security-policy"]


def test_reports_are_those_of_the_workspace(studio: Studio) -> None:
    assert studio.get("/api/reports") == {"software": "", "date": "", "experiments": []}
    studio.get("/api/reports/results.json", code=404)
    folder = studio.workspace.root / "reproduction"
    folder.mkdir()
    results = {"software": "0.1.0", "date": "2026-11-21", "experiments": [{"name": "table-2", "numbers": []}]}
    (folder / "results.json").write_text(json.dumps(results))
    assert studio.get("/api/reports") == results
    download = studio.client.get("/api/reports/results.json")
    assert download.json() == results
    assert "attachment" in download.headers["content-disposition"]
    for name in ("reproduction.lock", "..%2fsession.json", "trials"):
        studio.get(f"/api/reports/{name}", code=404)
    (folder / "results.json").write_text("{")
    studio.get("/api/reports", code=409)


SWEEP = {
    "session": "walk", "vary": {"survival": [0.2, 0.5]}, "seeds": 2, "settings": {"layers": 2, "particles": 10},
    "last": 2, "fit_shape": False,
}  # fmt: skip


@pytest.mark.slow
def test_a_sweep_says_what_it_takes_runs_behind_and_leaves_runs(compared: Studio) -> None:
    client = compared.client
    wait = client.post("/api/comparisons/sweeps/expected", json=SWEEP).json()
    assert wait == {"runs": 4, "frames": 2, "evaluations": 160, "seconds": None, "judged_by": ""}
    for wrong, words in (
        ({"vary": {"survival": [7]}}, "'survival' cannot be 7"),
        ({"vary": {}}, "0 knobs"),
        ({"vary": {"survival": [0.2]}, "settings": {"surviving": 1}}, "'surviving'"),
    ):
        for address in ("/api/comparisons/sweeps", "/api/comparisons/sweeps/expected"):
            refused = client.post(address, json={**SWEEP, **wrong})
            assert refused.status_code == 422
            assert words in refused.json()["message"]
    begun = client.post("/api/comparisons/sweeps", json=SWEEP)
    assert begun.status_code == 202, begun.text
    line = begun.json()
    assert (line["name"], line["total"], line["vary"]) == ("sweep-1", 4, {"survival": [0.2, 0.5]})
    answer = until(compared, "sweep-1", "done", "failed")
    assert answer["comparison"]["status"] == "done", answer["comparison"]["problem"]
    runs = answer["result"]["tables"][0]["rows"]
    assert [row[2] for row in runs] == ["sweep-1-p1-s0", "sweep-1-p1-s1", "sweep-1-p2-s0", "sweep-1-p2-s1"]
    assert answer["comparison"]["best_mm"] == answer["result"]["best"]["mean"]
    listed = next(one for one in client.get("/api/sessions").json()["sessions"] if one["name"] == "walk")
    assert {run["name"] for run in listed["runs"]} == {row[2] for row in runs}
    assert client.get("/api/sessions/walk/runs/sweep-1-p2-s1").json()["settings"]["survival"] == 0.5
    assert client.get("/api/comparisons/walk/sweep-1/frames.csv").text.startswith("survival,seed,run,frame")
    after = client.post("/api/comparisons/sweeps/expected", json=SWEEP).json()
    assert after["judged_by"].startswith("sweep-1-")
    assert after["seconds"] > 0
    assert (
        client.get("/api/sessions/walk/pace?tracker=annealed&weighting=blobs").json()["milliseconds"] is None
    )
    assert client.get("/api/sessions/walk/pace").json()["frame_milliseconds"] > 0.0

    assert client.delete("/api/comparisons/walk/sweep-1?runs=true").status_code == 200
    listed = next(one for one in client.get("/api/sessions").json()["sessions"] if one["name"] == "walk")
    assert listed["runs"] == []
    assert len(client.get("/api/trash").json()["entries"]) == 5


def test_an_experiment_is_run_from_the_page(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    go, asked = threading.Event(), list[tuple[object, ...]]()

    class Waiting(PapersExperiments):
        def reproduce(
            self,
            name: str,
            out: Path,
            *,
            quick: bool,
            seeds: int | None,
            progress: Callable[[str, int, int], None],
        ) -> TrialCounts:
            asked.append((name, out, quick, seeds))
            while not go.wait(0.02):
                progress("trials", 2, 7)
            return TrialCounts(5, 2, 0)

    monkeypatch.setattr(report_routes, "known_experiments", Waiting)
    place = "/api/reports/experiments"
    listed = studio.get(place)
    assert listed["job"] is None
    names = [one["name"] for one in listed["experiments"]]
    assert "deutscher-fig-8" in names
    studio.post(place, {"name": "no-such"}, code=404)
    try:
        begun = studio.client.post(place, json={"name": "deutscher-fig-8"})
        assert begun.status_code == 202
        studio.post(place, {"name": "all"}, code=409)
        [line] = studio.get("/api/jobs", params={"kind": "reproduction"})["jobs"]
        assert (line["name"], line["page"]) == ("deutscher-fig-8", "/reports")
    finally:
        go.set()
    waiting.until(lambda: studio.get(place)["job"]["state"] == "done")
    job = studio.get(place)["job"]
    assert (job["measured"], job["kept"], job["failed"]) == (5, 2, 0)
    assert asked == [("deutscher-fig-8", studio.workspace.root / "reproduction", True, None)]
