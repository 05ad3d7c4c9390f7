"""Sweeps: grids of knob values as plans, their trials, what is concluded from them, how long they take."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from sample_walk import copy_of_walk
from store_records import result_of

from studio.cli.reading import read_grid
from studio.foundations.errors import CalibrationError, RunError, SettingsError
from studio.operations.comparison_folders import (
    bring_back,
    differences,
    new_comparison,
    place_of,
    runs_of,
    throw_away,
)
from studio.results.comparison.kept_comparison import RECORD_NAME, KeptComparison, trial_key
from studio.results.comparison.plan import Plan
from studio.results.comparison.sweep import (
    Sweep,
    conclude_sweep,
    expected,
    plan_sweep,
    run_name,
    sweep_csv,
    sweep_document,
    sweep_text,
    sweep_trials,
)
from studio.results.comparison.trials import ALLOW_INCONSISTENT, Outcome
from studio.runs.new_run import prepare_run
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.provenance import note
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

ROOT = Path(__file__).resolve().parents[3]
WALK = Session(ROOT / "sample_sessions" / "walk")
GRID = {"survival": ["0.2", "0.5"], "particles": ["20", "40", "60"]}


def plan(seeds: int = 2) -> Plan:
    return plan_sweep(WALK, GRID, range(seeds), knobs={"layers": 4}, last=3, fit_shape=False)


def made_up(drawn: Plan, error: bool = True) -> list[Outcome]:
    """Outcomes: point p, seed s has the error 10 (p + 1) + s, the overlap 0.9 - p / 100."""
    found = []
    for place, trial in enumerate(sweep_trials(drawn)):
        seed, point = divmod(place, len(drawn.candidates))
        mm = 10.0 * (point + 1) + seed
        measured = {
            "run": run_name("sweep-1", drawn, place), "worst_frame": 2, "error": mm if error else None,
            "worst": 2 * mm if error else None, "limb_lost": 0 if error else None, "overlap": 0.9 - point / 100,
            "search_lost": point, "evaluations": drawn.candidates[point].evaluations, "milliseconds": 5.0,
            "frames": [0, 1, 2], "per_frame": [mm, None, 2 * mm],
        }  # fmt: skip
        found.append(Outcome(trial, json.loads(json.dumps(measured))))
    return found


@pytest.fixture
def swept() -> Sweep:
    drawn = plan()
    return conclude_sweep(drawn, made_up(drawn))


def test_every_combination_is_an_entrant_with_values_of_the_knobs_types() -> None:
    drawn = plan()
    assert drawn.vary == {"survival": (0.2, 0.5), "particles": (20, 40, 60)}
    assert [one.name for one in drawn.candidates][:2] == [
        "survival 0.2, particles 20",
        "survival 0.2, particles 40",
    ]
    assert len(drawn.candidates) == 6
    for one in drawn.candidates:
        assert one.changes["layers"] == 4
        assert one.evaluations == TRACKERS["annealed"].evaluations(one.settings().tracker)
    assert len({one.evaluations for one in drawn.candidates}) == 3
    assert drawn.evaluations == max(one.evaluations for one in drawn.candidates)
    assert len(sweep_trials(drawn)) == 12
    assert len({trial_key(trial) for trial in sweep_trials(drawn)}) == 12
    assert run_name("s", drawn, 0) == "s-p1-s0"
    assert run_name("s", drawn, 11) == "s-p6-s1"


@pytest.mark.parametrize(
    ("vary", "knobs", "words"),
    [
        ({"survival": [7]}, {}, "'survival' cannot be 7"),
        ({"survival": ["x"]}, {}, "'survival' cannot be 'x'"),
        ({"surviving": [0.2]}, {}, "no setting 'surviving'"),
        ({"survival": []}, {}, "has no values"),
        ({"survival": [0.2, "0.20"]}, {}, "has the value 0.2 twice"),
        ({}, {}, "0 knobs cannot be varied"),
        ({"survival": [0.2]}, {"survival": 0.3}, "both varied and set"),
        ({"particles": range(20, 520)}, {}, "1000 runs|1500 runs"),
    ],
)
def test_what_cannot_be_swept_is_refused_by_name(vary: dict, knobs: dict, words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        plan_sweep(WALK, vary, range(3), knobs=knobs)


def test_frames_outside_the_footage_are_refused() -> None:
    with pytest.raises(RunError, match="do not lie in the footage"):
        plan_sweep(WALK, {"survival": [0.2]}, range(1), last=900)


def test_a_grid_is_read_from_the_command_line() -> None:
    assert read_grid(["survival=0.2, 0.5", "particles=50"]) == {
        "survival": ["0.2", "0.5"],
        "particles": ["50"],
    }
    for words in ("survival", "survival=", "=0.2"):
        with pytest.raises(SettingsError, match="names no values"):
            read_grid([words])
    with pytest.raises(SettingsError, match="named twice"):
        read_grid(["survival=0.2", "survival=0.3"])


def test_the_document_has_every_run_and_the_mean_of_every_point(swept: Sweep) -> None:
    found = sweep_document(swept)
    runs, points = found["tables"]
    keys = [column["key"] for column in runs["columns"]]
    assert keys[:4] == ["survival", "particles", "seed", "run"]
    assert len(runs["rows"]) == 12
    by_run = {row[3]: row for row in runs["rows"]}
    assert by_run["sweep-1-p2-s1"][:3] == [0.2, 40, 1]
    assert by_run["sweep-1-p2-s1"][keys.index("error")] == 21.0
    of_error = [row for row in points["rows"] if row[2] == "error"]
    assert [row[3] for row in of_error] == [10.5, 20.5, 30.5, 40.5, 50.5, 60.5]
    assert all(row[4] <= row[3] <= row[5] for row in of_error)
    assert found["best"] == {"point": "survival 0.2, particles 20", "measure": "error", "mean": 10.5}
    assert json.loads(json.dumps(found)) == found
    first = sweep_text(swept).splitlines()[1].split()
    assert first[:4] == ["0.2", "20", "10.5", "[10,"]
    rows = list(csv.reader(io.StringIO(sweep_csv(swept))))
    assert rows[0] == ["survival", "particles", "seed", "run", "frame", "error_mm"]
    assert rows[2] == ["0.2", "20", "0", "sweep-1-p1-s0", "1", ""]
    assert len(rows) == 1 + 12 * 3


def test_without_a_truth_the_silhouettes_judge() -> None:
    drawn = plan()
    found = sweep_document(conclude_sweep(drawn, made_up(drawn, error=False)))
    assert found["measures"][0]["key"] == "overlap"
    assert found["best"]["point"] == "survival 0.2, particles 20"
    assert "error" not in [column["key"] for column in found["tables"][0]["columns"]]


def test_a_sweep_is_kept_as_a_comparison_is(tmp_path: Path) -> None:
    session = copy_of_walk(tmp_path / "walk", "videos")
    drawn = plan()
    kept = new_comparison(place_of(session, sweep=True), drawn)
    assert kept.name == "sweep-1"
    assert kept.record().plan == drawn
    assert place_of(session, sweep=True).name == "sweep-2"
    kept.finish(conclude_sweep(drawn, made_up(drawn)))
    result = KeptComparison(kept.folder).result()
    assert kept.status() == "done"
    assert result["vary"] == {"survival": [0.2, 0.5], "particles": [20, 40, 60]}


def test_the_expected_time_is_judged_by_a_stored_run(tmp_path: Path) -> None:
    session = copy_of_walk(tmp_path / "walk")
    drawn = plan()
    before = expected(session, drawn, processes=1, cores=2)
    assert (before.runs, before.frames) == (12, 3)
    assert before.evaluations == 2 * 3 * sum(one.evaluations for one in drawn.candidates)
    assert before.seconds is None
    assert "is known once" in before.in_words

    for name, each, evaluations in (("slow", 50.0, 100), ("quick", 16.0, 160), ("other", 9.0, 9000)):
        run = prepare_run(session, fit_shape=False, name=name, last=2)
        tracked(run.folder, each, evaluations)
    # Judged by the run whose evaluations a frame come nearest to the mean of 160: 0.1 ms each.
    after = expected(session, drawn, processes=1, cores=2)
    assert after.judged_by == "quick"
    assert after.seconds == pytest.approx(before.evaluations * 0.1e-3 * 2)
    both = expected(session, drawn, processes=2, cores=2)
    assert both.seconds == pytest.approx(before.evaluations * 0.1e-3)
    assert "judged by run 'quick'" in both.in_words
    elsewhere = replace(drawn, candidates=tuple(replace(one, weighting="blobs") for one in drawn.candidates))
    assert expected(session, elsewhere, processes=1, cores=2).seconds is None


def test_what_frames_take_beside_the_search_is_expected_too(tmp_path: Path) -> None:
    session = copy_of_walk(tmp_path / "walk")
    drawn = plan()
    run = prepare_run(session, fit_shape=False, name="one", last=2)
    tracked(run.folder, 16.0, 160)
    with ResultsWriter(run.folder) as writer:
        writer.add_time(0.3, 1, threads=4)
        writer.add_time(0.1, 1, threads=2)
    # Two frames of 200 ms, 16 of them a search of 160 evaluations: 184 ms a frame beside it.
    search, beside = 0.1e-3 * expected(session, drawn, 1, 2).evaluations, 12 * 3 * 0.184
    alone = expected(session, drawn, processes=1, cores=2)
    assert alone.seconds == pytest.approx(2 * (search + beside))
    # A run that had one thread, as those of a sweep have, tells what another one takes.
    with ResultsWriter(run.folder) as writer:
        writer.add_time(0.0, 2, threads=1)
    several = expected(session, drawn, processes=3, cores=4)
    assert several.seconds == pytest.approx((search + 12 * 3 * 0.084) / 3)
    with ResultsWriter(run.folder) as writer, writer.together():
        writer._transaction([("UPDATE meta SET value = '{' WHERE key = 'time'", ())])
    assert expected(session, drawn, 1, 2).seconds == pytest.approx(2 * search)


def tracked(folder: Path, milliseconds: float, evaluations: int) -> None:
    """Two frames in a run's store that took so long."""
    with ResultsWriter(folder) as writer:
        for frame in range(2):
            made = result_of(frame, size=31)
            writer.write_frame(replace(made, milliseconds=milliseconds, evaluations=evaluations), [])


def test_runs_of_a_sweep_are_reported_apart_by_their_notes(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    session = copy_of_walk(tmp_path / "walk", "videos")
    kept = new_comparison(place_of(session, "mine"), plan())
    notes = {
        "mine-p1-s0": kept.note_of("a"), "mine-p2-s0-2": kept.note_of("b"), "mine-p2-s0": "",
        "run-1": "Made by hand.",
    }  # fmt: skip
    for name, words in notes.items():
        prepare_run(session, fit_shape=False, name=name, last=2, note=words)
    theirs = ["mine-p1-s0", "mine-p2-s0-2"]
    assert [run.name for run in runs_of(session, kept).values()] == theirs
    (session.run("run-1").folder / "run.json").write_text("{")
    assert [run.name for run in runs_of(session, kept).values()] == theirs

    # Another of the same name, and the first one back beside it.
    thrown = throw_away(workspace, session, kept)
    record = json.loads((thrown / RECORD_NAME).read_text())
    (thrown / RECORD_NAME).write_text(json.dumps(record | {"created": "2026-01-01T00:00:00+00:00"}))
    earlier = KeptComparison(thrown).note_of("a")
    prepare_run(session, fit_shape=False, name="mine-p1-s0-2", last=2, note=earlier)
    other = new_comparison(place_of(session, "mine"), plan())
    _, back = bring_back(workspace, thrown.name)
    assert back.name != "mine"
    assert [run.name for run in runs_of(session, back).values()] == ["mine-p1-s0-2"]
    assert earlier not in runs_of(session, other)


def test_points_are_judged_by_what_every_run_has() -> None:
    drawn = plan()
    outcomes = made_up(drawn)
    without = {**outcomes[3].measured, "error": None, "worst": None, "limb_lost": None}
    outcomes[3] = replace(outcomes[3], measured=without)
    found = sweep_document(conclude_sweep(drawn, outcomes))
    assert found["measures"][0]["key"] == "error"
    assert found["best"] == {"point": "survival 0.2, particles 20", "measure": "overlap", "mean": 0.9}
    assert sweep_text(conclude_sweep(drawn, outcomes)).splitlines()[1].split()[2] == "0.9"


def test_a_grid_that_is_too_large_is_refused_before_its_values_are_read() -> None:
    with pytest.raises(SettingsError, match="6003 runs are too many"):
        plan_sweep(WALK, {"survival": ["x"] * 2001}, range(3))


def test_a_doubted_calibration_is_swept_only_if_requested(tmp_path: Path) -> None:
    session = copy_of_walk(tmp_path / "walk", "videos")
    doubt = "Cameras A and B seem to be exchanged."
    note(session, "background", "in doubt", good=False, stops=(doubt,))
    with pytest.raises(CalibrationError, match=doubt):
        plan_sweep(session, GRID, range(1))
    drawn = plan_sweep(session, GRID, range(1), allow_inconsistent=True)
    assert drawn.allow_inconsistent
    assert all(trial.arguments[ALLOW_INCONSISTENT] for trial in sweep_trials(drawn))
    assert differences(drawn, replace(drawn, allow_inconsistent=False)) == ("allow_inconsistent",)
