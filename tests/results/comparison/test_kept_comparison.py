"""Comparisons on disk: made, listed, finished, deleted and restored."""

import json
from pathlib import Path

import pytest
from sample_walk import copy_of_walk
from test_comparison import made_up, plan

from studio.foundations.errors import NotFoundError, SessionError
from studio.operations.comparison_folders import (
    bring_back,
    comparison_count,
    differences,
    kept_comparison,
    kept_comparisons,
    new_comparison,
    place_of,
    throw_away,
    unfinished_like,
)
from studio.results.comparison.kept_comparison import LOCK_NAME, RECORD_NAME, KeptComparison, trial_key
from studio.results.comparison.plan import conclude, trials
from studio.sessions.process_lock import ProcessLock
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@pytest.fixture
def walk(tmp_path: Path) -> Session:
    """The bundled walk in a workspace of its own (without its pictures, which are not needed)."""
    return copy_of_walk(tmp_path / "workspace" / "walk", "videos")


@pytest.fixture
def kept(walk: Session) -> KeptComparison:
    """A comparison that was started."""
    return new_comparison(place_of(walk), plan("annealed", "condensation"))


def test_the_request_is_read_back(walk: Session, kept: KeptComparison) -> None:
    assert kept.name == "comparison-1"
    requested = plan("annealed", "condensation")
    assert kept.record().plan == requested
    assert kept.plan(walk).footage == str(walk.path)
    assert kept.status() == "interrupted"
    assert kept.result() is None
    assert comparison_count(walk) == 1
    assert place_of(walk).name == "comparison-2"


def test_records_of_older_versions_are_read(kept: KeptComparison) -> None:
    """Version 2 calls allow_inconsistent despite_findings, version 1 the candidates entrants."""
    path = kept.folder / RECORD_NAME
    written = json.loads(path.read_text())
    for version, name, before in (
        (2, "allow_inconsistent", "despite_findings"),
        (1, "candidates", "entrants"),
    ):
        written["plan"][before] = written["plan"].pop(name)
        path.write_text(json.dumps(written | {"schema": version}))
        assert kept.record().plan == plan("annealed", "condensation")


def test_nothing_is_overwritten(walk: Session, kept: KeptComparison) -> None:
    with pytest.raises(SessionError, match="already"):
        new_comparison(kept.folder, plan("annealed"))
    assert kept.record().plan.candidates[1].name == "condensation"


def test_the_newest_comes_first_and_names_are_looked_up(walk: Session, kept: KeptComparison) -> None:
    second = new_comparison(place_of(walk, "other"), plan("annealed"))
    third = new_comparison(place_of(walk), plan("annealed"))
    names = [one.name for one in kept_comparisons(walk)]
    assert set(names) == {kept.name, second.name, third.name}
    assert names.index(third.name) < names.index(kept.name)
    assert kept_comparison(walk, "other").folder == second.folder
    with pytest.raises(NotFoundError, match="no comparison 'nothing'"):
        kept_comparison(walk, "nothing")


def test_a_finished_one_has_numbers_findings_and_frames(kept: KeptComparison) -> None:
    drawn = kept.plan()
    kept.finish(conclude(drawn, made_up(drawn)))
    assert kept.status() == "done"
    result = kept.result()
    assert [entry["tracker"] for entry in result["trackers"]] == ["annealed", "condensation"]
    assert result["findings"]["verdict"] == "answered"
    assert len(result["per_frame"]["error_mm"]["annealed"]) == 3
    assert "NaN" not in json.dumps(result)
    assert (kept.folder / "frames.csv").read_text().startswith("tracker,seed,frame")


def test_the_same_request_resumes_an_unfinished_comparison(walk: Session, kept: KeptComparison) -> None:
    again = kept.plan(walk)
    found = unfinished_like(walk, again)
    assert found.folder == kept.folder
    kept.finish(conclude(again, made_up(again)))
    assert unfinished_like(walk, again) is None


def test_a_trials_key_does_not_depend_on_the_sessions_path(walk: Session, kept: KeptComparison) -> None:
    there = [trial_key(trial) for trial in trials(kept.plan(walk))]
    assert there == [trial_key(trial) for trial in trials(plan("annealed", "condensation"))]
    assert len(set(there)) == 6


def test_differences_are_named(kept: KeptComparison) -> None:
    assert differences(plan("annealed", "condensation"), kept.plan()) == ()
    assert set(differences(plan("annealed", seeds=(0,)), kept.plan())) == {"candidates", "seeds"}


def test_only_one_process_works_on_it(walk: Session, kept: KeptComparison) -> None:
    lock = ProcessLock.take(kept.folder / LOCK_NAME)
    assert kept.status() == "running"
    assert kept.lock() is None
    with pytest.raises(SessionError, match="running"):
        throw_away(Workspace(walk.path.parent), walk, kept)
    lock.free()
    assert kept.status() == "interrupted"


def test_its_end_is_stored(kept: KeptComparison) -> None:
    kept.end("failed", "The disk is full.")
    assert (kept.status(), kept.record().problem) == ("failed", "The disk is full.")
    kept.end("")
    assert kept.status() == "interrupted"


def test_it_is_restored_from_the_trash(walk: Session, kept: KeptComparison) -> None:
    workspace = Workspace(walk.path.parent)
    place = throw_away(workspace, walk, kept)
    assert comparison_count(walk) == 0
    session, back = bring_back(workspace, place.name)
    assert (session.name, back.name) == ("walk", "comparison-1")
    assert back.record().plan == plan("annealed", "condensation")


def test_a_damaged_record_is_reported(kept: KeptComparison) -> None:
    (kept.folder / "comparison.json").write_text('{"schema": 1, "name": 3}')
    with pytest.raises(SessionError, match="not a comparison's record"):
        kept.record()
