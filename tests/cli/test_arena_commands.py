"""`studio arena`: what is listed, exported and raced, as text and as JSON."""

from pathlib import Path

import pytest
from command_line import answer_of, call, refusal_of
from toy_arena import PART, ToyArena, make_arena


@pytest.fixture(scope="module")
def arena(tmp_path_factory: pytest.TempPathFactory) -> ToyArena:
    return make_arena(tmp_path_factory.mktemp("arena"))


def test_problems_are_listed(arena: ToyArena) -> None:
    listed = answer_of("arena list --file", arena.file)
    assert [one["name"] for one in listed["problems"]] == [arena.whole.name, arena.part.name]
    assert listed["problems"][1]["parameters"] == ["x3", "x4"]
    assert "cma-es" in [one["name"] for one in listed["racers"]]
    shown = call("arena list --file", arena.file).output
    assert arena.whole.about in shown
    assert "gone.npz" in refusal_of("arena list --file", arena.file.with_name("gone.npz"))


def test_frames_are_exported_and_raced(arena: ToyArena, tmp_path: Path) -> None:
    session, file = arena.run.session.path, tmp_path / "own.npz"
    words = ["--frames", PART, "--limb", "x3", "--limb", "x4", "--evaluations", 10_000]
    done = answer_of("arena export", session, arena.run.run.name, "--to", file, *words)
    assert done["bytes"] == file.stat().st_size
    race = ["--file", file, "--out", tmp_path / "race", "--seeds", 2, "--evaluations", 200, "--processes", 1]
    words = ["arena race", *race, "--racer", "random-search", "--racer", "cma-es"]
    answer = answer_of(*words)
    assert answer["measured"] == 4
    assert [chart["kind"] for chart in answer["charts"]] == ["lines"]
    said = call(*words).output
    assert "Expected evaluations" in said
    assert "0 trials run, 4 kept from before" in said
    assert "no racer 'gone'" in refusal_of("arena race", *race, "--racer", "gone")
    assert "gone.py" in refusal_of("arena race", *race, "--racer", "gone.py")
