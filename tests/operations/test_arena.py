"""The arena's verbs on a toy set: races are kept, go on where they were ended, and are drawn from their own numbers."""

import importlib
import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from toy_arena import JOINTS, PART, ToyArena, make_arena

import studio
from studio.operations.jobs.trials import run_jobs
from studio.results.arena.profiles import running_time
from studio.search.likelihood.devices import DEVICE_MODULE
from studio.sessions.process_lock import ProcessLock

FAST = ("random-search", "cma-es")
HEAD = "from studio.arena import Racer\n"
MINE = f"""{HEAD}
def search(problem, seed):
    while True:
        problem.log_likelihood(problem.prior.start[None].repeat(10, axis=0))


RACER = Racer("mine", "Mine", search)
"""


@pytest.fixture(autouse=True)
def _in_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Trials run in this process: how processes are started is measured by the tests of commands and of the API."""
    with ThreadPoolExecutor(1) as executor:
        monkeypatch.setattr("studio.operations.arena.run_jobs", partial(run_jobs, executor=executor))
        yield


@pytest.fixture(scope="module")
def arena(tmp_path_factory: pytest.TempPathFactory) -> ToyArena:
    return make_arena(tmp_path_factory.mktemp("arena"))


def race(arena: ToyArena, out: Path, racers: tuple[str, ...] = FAST, **more: object) -> "studio.arena.Raced":
    given = {
        "evaluations": 300,
        "seeds": 2,
        "file": arena.file,
        "out": out,
        "processes": 1,
        "progress": False,
    }
    return studio.arena.race(racers=racers, **(given | more))


def test_a_race_has_its_poses_weighed_by_the_device_that_is_asked_for(
    arena: ToyArena, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here without a card: `gpu` is refused, `auto` weighs as the processor does, as trials of their own."""
    monkeypatch.setattr(importlib.import_module(DEVICE_MODULE), "missing", lambda: "no card here")
    here = race(arena, tmp_path, ("random-search",), seeds=1)
    with pytest.raises(studio.StudioError, match="no card here"):
        race(arena, tmp_path, ("random-search",), seeds=1, device="gpu")
    auto = race(arena, tmp_path, ("random-search",), seeds=1, device="auto")
    assert (here.kept, auto.kept) == (0, 0)
    assert [one.gaps for one in auto.trials] == [one.gaps for one in here.trials]
    assert race(arena, tmp_path, ("random-search",), seeds=1).kept == 2


def test_problems_are_those_of_the_file_with_nothing_spent(arena: ToyArena) -> None:
    problems = studio.arena.problems(arena.file)
    assert [one.name for one in problems] == [arena.whole.name, arena.part.name]
    assert [one.dimensions for one in problems] == [4, 2]
    problems[0].log_likelihood(problems[0].prior.start[None])
    assert [one.evaluations for one in studio.arena.problems(arena.file)] == [0, 0]
    with pytest.raises(studio.StudioError, match="no set of problems"):
        studio.arena.problems(arena.file.with_name("gone.npz"))


def test_problems_of_a_run_and_their_file(arena: ToyArena, tmp_path: Path) -> None:
    done: list[tuple[int, int]] = []
    given = {"limbs": JOINTS, "evaluations": 10_000}
    (one,) = studio.arena.problems_of(
        arena.run.run, [PART], progress=lambda _, at, total: done.append((at, total)), **given
    )
    assert one.parameters == JOINTS
    assert done[-1] == (100, 100)
    exported = studio.arena.export(arena.run.run, tmp_path / "part.npz", [PART], progress=False, **given)
    assert exported.problems == (one.name,)
    assert exported.size == (tmp_path / "part.npz").stat().st_size
    (read,) = studio.arena.problems(tmp_path / "part.npz")
    assert read.hash == one.hash
    with pytest.raises(studio.StudioError, match="No frame is named"):
        studio.arena.problems_of(arena.run.run, [])


def test_a_race_is_kept_and_goes_on(arena: ToyArena, tmp_path: Path) -> None:
    def stop(_: str, done: int, total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        race(arena, tmp_path, progress=stop)
    kept = {file.name: file.read_bytes() for file in (tmp_path / "trials").iterdir()}
    assert len(kept) == 3
    done = race(arena, tmp_path)
    assert (done.measured, done.kept, len(done.trials)) == (5, 3, 8)
    for name, content in kept.items():
        assert (tmp_path / "trials" / name).read_bytes() == content
    again = race(arena, tmp_path)
    assert (again.measured, again.kept) == (0, 8)
    assert again.trials == done.trials
    more = race(arena, tmp_path, (*FAST, "differential-evolution"))
    assert (more.measured, more.kept) == (4, 8)
    other = race(arena, tmp_path, evaluations=200)
    assert other.kept == 0


def test_the_document_is_made_of_the_trials(arena: ToyArena, tmp_path: Path) -> None:
    done = race(arena, tmp_path)
    document = json.loads((tmp_path / "race.json").read_text())
    assert document == json.loads(json.dumps(done.document))
    findings = document["findings"]
    times = next(table for table in findings["tables"] if " 50 % of the way" in table["title"])
    row = dict(zip(times["columns"], times["rows"][0], strict=True))
    own = [one for one in done.trials if (one.problem, one.racer) == (arena.whole.name, "cma-es")]
    assert row["problem"] == arena.whole.name
    assert row["cma-es"].startswith(f"{running_time(own, 0.5).expected:.0f} [")
    chart = findings["charts"][0]
    assert [series["name"] for series in chart["series"]] == list(FAST)
    assert all(np.all(np.diff(series["y"]) >= 0.0) for series in chart["series"])
    assert findings["settings"]["seeds"] == 2
    assert (tmp_path / "race.html").read_text().startswith("<!doctype html>")


def test_the_race_is_drawn_where_the_poses_are(arena: ToyArena, tmp_path: Path) -> None:
    done = race(arena, tmp_path)
    drawn = done.document["drawn"][0]
    assert drawn["counts"] == [10, 30, 100, 300]
    own = next(
        one for one in done.trials if (one.problem, one.racer, one.seed) == (arena.whole.name, "cma-es", 0)
    )
    last = drawn["racers"]["cma-es"]["300"]
    assert last["left"] == pytest.approx(own.share_left, rel=1e-3, abs=1e-9)
    assert len(last["lines"]) == len(drawn["best"]) == len(arena.run.body.drawn)
    mask = arena.whole.maps.views[0].mask
    ends = np.round(np.array(drawn["best"]).reshape(-1, 2)).astype(int)
    seen = [mask[row, column] > 0 for column, row in ends]
    assert np.mean(seen) > 0.8
    points = np.array([point for line in drawn["outline"] for point in line])
    rows, columns = np.nonzero(mask)
    assert (points.min(axis=0) == (columns.min(), rows.min())).all()
    assert (points.max(axis=0) == (columns.max(), rows.max())).all()


def test_a_racer_s_file_that_changed_is_raced_again(arena: ToyArena, tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(MINE)
    first = race(arena, tmp_path / "out", (str(file),))
    assert {one.racer for one in first.trials} == {"mine"}
    assert race(arena, tmp_path / "out", (str(file),)).measured == 0
    file.write_text(MINE.replace("repeat(10", "repeat(20"))
    assert race(arena, tmp_path / "out", (str(file),)).measured == 4


def test_a_racer_that_goes_wrong_ends_the_race_and_what_is_done_stays(
    arena: ToyArena, tmp_path: Path
) -> None:
    file = tmp_path / "wrong.py"
    file.write_text(
        f"{HEAD}def search(problem, seed):\n    1 / 0\n\nRACER = Racer('wrong', 'Wrong', search)\n"
    )
    with pytest.raises(
        studio.StudioError, match=r"Racer 'wrong' on problem .* failed with ZeroDivisionError"
    ):
        race(arena, tmp_path / "out", ("random-search", str(file)))
    assert race(arena, tmp_path / "out", ("random-search",)).kept == 2


def test_what_cannot_be_raced_is_refused(arena: ToyArena, tmp_path: Path) -> None:
    with pytest.raises(studio.StudioError, match="no problem 'gone'"):
        race(arena, tmp_path, problems=("gone",))
    with pytest.raises(studio.StudioError, match="no racer 'gone'"):
        race(arena, tmp_path, ("gone",))
    with pytest.raises(studio.StudioError, match="same name"):
        race(arena, tmp_path, ("cma-es", "cma-es"))
    held = ProcessLock.take(tmp_path / "arena.lock")
    assert held is not None
    with pytest.raises(studio.StudioError, match="Another process races"):
        race(arena, tmp_path)
    held.free()
    assert race(arena, tmp_path, problems=(arena.part.name,)).measured == 4
