"""`studio live`: tracks on the clock, says what was dropped, replays bit for bit."""

import json

import pytest
from arm_behaviour import keep_arm_model
from command_line import answer_of, call, refusal_of
from toy_session import FRAMES, true_poses

from studio.garden.benchmarks.live_stages import in_words, stage_rows
from studio.runs.new_run import prepare_run
from studio.search.settings import DEFAULT_TRACKER
from studio.sessions.named_rows import write_pose
from studio.sessions.session import Session

QUICK = ("--tracker", "annealed", "--weighting", "edge-region", "--particles", "30", "--layers", "2")


@pytest.fixture
def started(session_on_disk: Session) -> Session:
    """The toy session with a start pose."""
    names = tuple(entry.name for entry in session_on_disk.body().parameters)
    write_pose(session_on_disk.path / "start_pose.csv", names, true_poses()[0])
    return session_on_disk


def test_a_live_run_and_its_replay(started: Session) -> None:
    result = call("live toy", *QUICK, "--seconds", "0.5", "--repeat", "--json", "--name", "now")
    printed = json.loads(result.stdout)
    assert printed["run"] == "now"
    assert printed["frames"] + len(printed["dropped"]) == 30
    assert printed["footage_frames_per_second"] == 60.0
    latency = printed["latency_ms"]
    assert 0.0 < latency["median"] <= latency["p95"] <= latency["worst"]
    assert started.run("now").record.ping_pong
    again = answer_of("live toy --replay now")
    assert (again["frames"], again["different"]) == (printed["frames"], [])


def test_words_for_a_person(started: Session) -> None:
    result = call("live toy", *QUICK, "--from", "2")
    assert "frames tracked" in result.stdout
    assert "picture to pose" in result.stdout
    assert started.runs()[-1].record.first == 2
    assert started.runs()[-1].record.last == FRAMES
    assert "bit for bit" in call("live toy --replay", started.runs()[-1].name).stdout


def test_without_a_model_it_tracks_as_any_new_run_does(started: Session) -> None:
    few = ("--particles", "20", "--layers", "2")
    printed = answer_of("live toy", *few)
    assert (printed["tracker"], printed["weighting"]) == (DEFAULT_TRACKER, started.manifest.weighting)


def test_a_named_model_is_followed(started: Session) -> None:
    keep_arm_model(started.path.parent)
    run = prepare_run(started, behaviour="swings", live=True)
    assert (run.record.tracker, run.record.weighting) == ("behaviour", "blobs")
    other = prepare_run(
        started, tracker="condensation", weighting="edge-region", behaviour="swings", live=True
    )
    assert (other.record.tracker, other.record.weighting) == ("condensation", "edge-region")


@pytest.mark.parametrize(
    ("sent", "cause"),
    [
        (("--repeat",), "has no end"),
        (("--seconds", "0"), "0<x<=86400"),
        (("--seconds", "nan"), "'seconds' cannot be nan"),
        (("--set", "online_learning=true"), "cannot train"),
        (("--from", "8"), "do not lie in the footage"),
        (("--replay", "nobody"), "nobody"),
    ],
)
def test_refusals(started: Session, sent: tuple[str, ...], cause: str) -> None:
    assert cause in refusal_of("live toy", *QUICK, *sent)
    assert not started.runs()


def test_the_benchmarks_table() -> None:
    found = {
        "decoding": 2.0,
        "reconstruction": 6.0,
        "blob fitting": 1.0,
        "prediction and evaluation": 4.0,
        "the rest": 0.1,
        "whole frame": 13.1,
    }
    rows = stage_rows(found)
    assert [row["paper_ms"] for row in rows] == [None, 28.1, 14.8, 45.3, None, pytest.approx(88.2)]
    figures = {
        "frames_per_second": 30.0,
        "tracked": 598,
        "dropped": 2,
        "latency_ms": {"median": 17.0, "p95": 21.0, "worst": 40.0},
    }
    words = in_words({"setting": "five views", "stages": rows, "scene_open": figures})
    assert "28.1" in words
    assert "with the scene open: 30.0 frames a second, 2 of 600 dropped, picture to pose 17 ms" in words
