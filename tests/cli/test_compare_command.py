"""`studio compare` as a stranger calls it: the agreed JSON, a table, going on after Ctrl-C, refusals in words."""

import json
from pathlib import Path

import pytest
from command_line import answer_of, call, refusal_of
from sample_walk import copy_of_walk

from studio.operations import comparing
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

SMALL = ("--evaluations", "60", "--layers", "3", "--frames", "0:3", "--processes", "1")
FIELDS = {"tracker", "evaluations", "mean_mm", "worst_mm", "lost_frames", "seconds"}


@pytest.fixture
def walk() -> Session:
    """The bundled walk in this test's workspace."""
    workspace = Workspace()
    workspace.root.mkdir(parents=True, exist_ok=True)
    return copy_of_walk(workspace.root / "walk")


@pytest.mark.slow
def test_the_document_is_as_agreed(walk: Session, tmp_path: Path) -> None:
    out = tmp_path / "found"
    changes = ("--set", "annealed:b.crossover=0", "--set", "diffusion_scale=0.8")
    three = ("walk", "--trackers", "annealed,annealed:b,condensation", "--seeds", "2", *SMALL, *changes)
    found = answer_of("compare", *three, "--out", out)
    assert [entry["tracker"] for entry in found["trackers"]] == ["annealed", "annealed:b", "condensation"]
    for entry in found["trackers"]:
        assert entry.keys() == FIELDS | {"seeds"}
        assert entry["evaluations"] == 60
        assert [seed["seed"] for seed in entry["seeds"]] == [0, 1]
        assert all(seed.keys() == FIELDS | {"seed"} for seed in entry["seeds"])
        assert entry["mean_mm"] == pytest.approx(
            sum(seed["mean_mm"] for seed in entry["seeds"]) / 2, abs=1e-3
        )
        assert entry["worst_mm"] == max(seed["worst_mm"] for seed in entry["seeds"])
    assert found["settings"]["annealed:b"]["crossover"] == 0
    assert {found["settings"][name]["diffusion_scale"] for name in found["settings"]} == {0.8}
    assert len(found["sign_tests"]) == 3
    assert json.loads((out / "result.json").read_text())["trackers"] == found["trackers"]
    assert (out / "frames.csv").is_file()
    assert not (walk.path / "comparisons").exists()

    # The same command finds all of it there; another one is refused that folder.
    again = call("compare", *three, "--out", out)
    assert "6 of 6 trials are there already" in again.stderr
    assert "other candidates" in refusal_of(
        "compare walk --trackers annealed --seeds 2", *SMALL, "--out", out
    )


@pytest.mark.slow
def test_after_ctrl_c_the_same_command_goes_on(walk: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ("walk", "--trackers", "annealed,condensation", "--seeds", "1", *SMALL)
    really = comparing.run_comparison

    def interrupted(kept: object, session: object, _report: object, made: object, **more: object) -> object:
        def report(_step: str, done: int, _total: int) -> None:
            if done == 1:
                raise KeyboardInterrupt

        return really(kept, session, report, made, **more)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(comparing, "run_comparison", interrupted)
    stopped = call("compare", *arguments, code=130)
    assert "finished is kept" in stopped.stderr
    monkeypatch.undo()
    monkeypatch.setenv("STUDIO_WORKSPACE", str(walk.path.parent))
    done = call("compare", *arguments)
    assert "1 of 2 trials are there already" in done.stderr
    assert "annealed" in done.stdout
    assert "is nearer than" in done.stdout
    assert [path.name for path in (walk.path / "comparisons").iterdir()] == ["comparison-1"]


def test_wrong_calls_are_refused_with_a_remedy(walk: Session, session_on_disk: Session) -> None:
    for arguments, words in (
        ((session_on_disk.name,), "has no truth"),
        (("walk", "--trackers", "nobody"), "no tracker 'nobody'"),
        (("walk", "--trackers", "annealed", "--set", "annealed.nothing=1"), "no setting 'nothing'"),
        (("walk", "--trackers", "annealed", "--frames", "0:999"), "0:150"),
        (("walk", "--trackers", "annealed", "--frames", "x"), "cannot be understood"),
        (("walk", "--trackers", "annealed", "--evaluations", "1"), "too few"),
        (("walk", "--trackers", "annealed", "--body", "nobody"), "nobody"),
    ):
        result = refusal_of("compare", *arguments)
        assert words in result
        assert "remedy" in result
    assert not (walk.path / "comparisons").exists()


def test_help_explains_labels() -> None:
    text = call("compare --help").output
    assert "--set annealed:few.layers=4" in text
    assert "annealed:eq13:" in text
    assert "partitions:" in text


@pytest.mark.slow
def test_a_sweep_is_reported_of_before_and_printed_after(walk: Session) -> None:
    small = ("--seeds", "1", "--frames", "0:2", "--layers", "2", "--particles", "10", "--keep-shape")
    done = call("sweep walk --vary survival=0.2,0.5", *small, "--processes", "1", "--json")
    assert "2 runs of 2 frames, 80 evaluations; how long that takes is known once" in done.stderr
    found = json.loads(done.stdout)
    assert found["vary"] == {"survival": [0.2, 0.5]}
    assert [row[2] for row in found["tables"][0]["rows"]] == ["sweep-1-p1-s0", "sweep-1-p2-s0"]
    assert {run.name for run in walk.runs()} == {"sweep-1-p1-s0", "sweep-1-p2-s0"}
    for words, said in (("survival=7", "cannot be '7'"), ("survival", "names no values")):
        assert said in refusal_of("sweep walk --vary", words, *small)
    assert "Missing option '--vary'" in refusal_of("sweep walk", *small)
