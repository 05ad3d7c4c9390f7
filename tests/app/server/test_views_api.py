"""The views' addresses: the registry describes what is answered, and the numbers are the store's."""

import numpy as np
import pytest
from waiting import until
from web_doubles import Studio

from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.views import VIEWS
from studio.results.uncertainty import half_widths
from studio.results.uncertainty.twin import TwinErrors, points_of
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

RUN = "/api/sessions/take1/runs/first"


def test_the_registry_names_every_view_with_its_question(studio: Studio) -> None:
    told = studio.get("/api/views")["views"]
    assert [entry["name"] for entry in told] == list(VIEWS)
    assert len(told) == 14
    assert all(entry["title"] and entry["question"].endswith("?") and entry["tables"] for entry in told)


def test_variance_has_the_stored_numbers(studio: Studio, tracked: StoredRun) -> None:
    told = studio.get(f"{RUN}/frames/1/views/variance")
    with tracked.results() as results:
        layers = results.layers(1)
    [table] = [entry for entry in told["tables"] if entry["name"] == "layers"]
    keys = [column["key"] for column in table["columns"]]
    rows = [dict(zip(keys, row, strict=True)) for row in table["rows"]]
    names = tracked.record.parameters
    assert len(rows) == len(names) * len(layers)
    for row in rows:
        record, at = layers[row["layer"]], names.index(row["parameter"])
        assert row["weighed"] == record.variance_weighed[at]
        assert (row["before"], row["after"]) == (record.variance_resampled[at], record.variance_diffused[at])
    assert "Session take1, run first, frame 1" in told["caption"]
    assert "survival 0.77" in told["caption"]


def test_the_schedules_effective_number_is_that_of_the_stored_weights(
    studio: Studio, tracked: StoredRun
) -> None:
    told = studio.get(f"{RUN}/frames/0/views/schedule")
    keys = [column["key"] for column in told["tables"][0]["columns"]]
    with tracked.results() as results:
        layers = results.layers(0)
    for row, record in zip(told["tables"][0]["rows"], layers, strict=True):
        found = dict(zip(keys, row, strict=True))
        weights = np.exp(record.log_weights) ** record.beta
        weights /= weights.sum()
        assert found["effective"] == pytest.approx(1.0 / np.sum(weights**2))
        assert found["largest"] == pytest.approx(weights.max())


@pytest.mark.parametrize("address", ["frames/0/views/nothing", "views/nothing", "frames/3/views/variance"])
def test_what_is_not_there_is_named(studio: Studio, tracked: StoredRun, address: str) -> None:
    refused = studio.get(f"{RUN}/{address}", code=404)
    assert refused["hint"]


def test_whole_runs_have_addresses_of_their_own(studio: Studio, tracked: StoredRun) -> None:
    told = studio.get(f"{RUN}/views/variance?parameter=pelvis_x")
    assert told["frame"] is None
    tables = {table["name"]: table for table in told["tables"]}
    assert set(tables) == {"first", "last", "parameter"}
    at = tracked.record.parameters.index("pelvis_x")
    with tracked.results() as results:
        assert tables["last"]["rows"][1][1 + at] == pytest.approx(
            results.layer(1, 2).variance_resampled[at], rel=1e-6
        )
        assert len(tables["parameter"]["rows"]) == sum(len(results.layers(frame)) for frame in (0, 1))


def test_every_view_answers_from_a_run_without_good_evidence(studio: Studio, tracked: StoredRun) -> None:
    # Poses beside the body, pictures of noise: numbers are of no use, but nothing fails.
    for name in VIEWS:
        studio.get(f"{RUN}/frames/0/views/{name}")
        studio.get(f"{RUN}/views/{name}")


@pytest.mark.parametrize(
    ("query", "word"),
    [
        ("views/coupling?parameter=nose", "nose"),
        ("views/weights?layer=7", "layer 8"),
        ("views/landscape?towards=particle&particle=99", "particle 99"),
        ("views/clouds?track=refined", "refined"),
    ],
)
def test_a_selection_that_is_not_there_is_named(
    studio: Studio, tracked: StoredRun, query: str, word: str
) -> None:
    refused = studio.get(f"{RUN}/frames/0/{query}", code=404)
    assert word in refused["message"]


def test_seeds_are_a_job(studio: Studio, tracked: StoredRun) -> None:
    begun = studio.post(f"{RUN}/frames/1/seeds", {"count": 2}, code=202)
    address = f"/api/seeds/{begun['identifier']}"
    until(lambda: studio.get(address)["state"] in ("done", "failed"))
    assert studio.get(address)["state"] == "done"
    told = studio.get(f"{RUN}/frames/1/views/seeds")
    [table] = [entry for entry in told["tables"] if entry["name"] == "seeds"]
    assert [row[0] for row in table["rows"]] == [4, 5]
    studio.post(f"{RUN}/frames/1/seeds", {"count": 1}, code=422)
    studio.post(f"{RUN}/frames/3/seeds", {}, code=404)


def test_whose_fault_the_errors_are_is_a_job(studio: Studio, tracked: StoredRun) -> None:
    begun = studio.post(f"{RUN}/split-error", {"count": 1, "evaluations": 1000}, code=202)
    address = f"/api/split-error/{begun['identifier']}"
    until(lambda: studio.get(address)["state"] in ("done", "failed"))
    done = studio.get(address)
    assert (done["state"], done["frame"]) == ("done", None), done
    told = studio.get(f"{RUN}/views/why")
    assert told["notes"] == [done["words"]]
    [table] = [entry for entry in told["tables"] if entry["name"] == "parts"]
    assert [row[0] for row in table["rows"]] == [1]
    first = studio.get(f"{RUN}/frames/1/views/why")["findings"][0]
    assert first["kind"].startswith("part of ")
    studio.post(f"{RUN}/split-error", {"evaluations": 10}, code=422)
    studio.post(f"{RUN}/split-error", {"frame": 3}, code=404)


def test_how_far_off_joints_may_be_is_a_job(
    studio: Studio, tracked: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = studio.post(f"{RUN}/uncertainty", {}, code=409)
    assert "it has 2 finished frames, and 8 are needed" in refused["message"]
    [told] = studio.get(f"{RUN}/views/uncertainty")["notes"]
    assert told.startswith("How far off joints may be has not been measured")

    def errors(run: InspectedRun, frames: range, progress: object) -> TwinErrors:
        points = len(points_of(run.body))
        off = np.random.default_rng(0).standard_normal((len(frames), points, 3))
        return TwinErrors(off, np.tile(np.eye(3), (len(frames), points, 1, 1)), ())

    monkeypatch.setattr(half_widths, "FEWEST_FRAMES", 2)
    monkeypatch.setattr(half_widths, "track_twin", errors)
    begun = studio.post(f"{RUN}/uncertainty", {}, code=202)
    address = f"/api/uncertainty/{begun['identifier']}"
    until(lambda: studio.get(address)["state"] in ("done", "failed"))
    assert studio.get(address)["state"] == "done", studio.get(address)
    told = studio.get(f"{RUN}/views/uncertainty")
    assert told["notes"][0].startswith("Measured on 2 frames of the run drawn again")
    [joints] = [entry for entry in told["tables"] if entry["name"] == "joints"]
    assert len(joints["rows"]) == 15


def test_runs_are_compared(studio: Studio, session: Session, tracked: StoredRun) -> None:
    other = prepare_run(session, name="second", seed=4, knobs={"survival": 0.5}, fit_shape=False)
    told = studio.get("/api/compared-runs?run=take1/first&run=take1/second")
    assert told["runs"] == ["take1/first", "take1/second"]
    tables = {table["name"]: table for table in told["tables"]}
    rows = {row[0]: row[1:] for row in tables["settings"]["rows"]}
    assert rows["seed"] == [3, 4]
    assert rows["survival"] == [0.77, other.record.settings["survival"]]
    assert [row[:2] for row in tables["curves"]["rows"]] == [["take1/first", 0], ["take1/first", 1]]
    studio.get("/api/compared-runs?run=take1/first", code=409)
    studio.get("/api/compared-runs?run=first&run=take1/first", code=409)
