"""`studio export`: files, JSON, exit codes, causes and remedies."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from command_line import answer_of, call, refusal_of
from store_records import store_run

from studio.runs.tracks import Track, read_track, write_track
from studio.sessions.session import Session

FRAMES = 6


@pytest.fixture
def run(session_on_disk: Session) -> str:
    """A run of the toy session with six frames, and a derived track of three."""
    stored = store_run(session_on_disk, "first", FRAMES)
    short = Track("short", np.arange(3), np.zeros((3, 4)), np.full(3, np.nan), ("",) * 3, {"verb": "made"})
    write_track(stored, short)
    return "first"


@pytest.mark.parametrize(
    "ending", ["bvh", "glb", "trc", "mot", "c3d", "csv", "parquet", "npz", "mp4", "viser", "toml", "yml"]
)
def test_every_ending_is_written(run: str, tmp_path: Path, ending: str) -> None:
    place = tmp_path / f"arm.{ending}"
    printed = answer_of("export toy first --to", place)
    assert printed["files"] == [str(place)]
    assert printed["format"] == ending
    assert printed["frames"] == (0 if ending in ("toml", "yml") else FRAMES)
    assert printed["bytes"] == place.stat().st_size > 0
    assert "read" in printed["checked"]


def test_options_reach_the_file(run: str, tmp_path: Path) -> None:
    place = tmp_path / "arm.trc"
    done = call(
        "export toy first --to", place, "--unit", "mm", "--track", "short", "--first", "1", "--fps", "120"
    )
    assert "read back within" in done.stdout
    header = dict(zip(*(line.split("\t") for line in place.read_text().splitlines()[1:3]), strict=True))
    assert (header["Units"], header["NumFrames"], header["DataRate"]) == ("mm", "3", "120")
    assert "Brought from 60 to 120 frames" in done.stderr


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (("--to", "arm.fbx"), "There is no export format 'fbx'"),
        (("--to", "arm.glb", "--unit", "m"), "means nothing to GLB"),
        (("--to", "arm.bvh", "--track", "smooth"), "has no track 'smooth'"),
        (("--to", "arm.bvh", "--first", "3", "--last", "2"), "No frame lies from 3"),
        (("--to", "arm.mp4", "--camera", "left"), "There is no camera 'left'"),
        (("--to", "arm.bvh", "--euler", "ABC"), "Invalid value for '--euler'"),
    ],
)
def test_what_is_wrong_is_said_with_exit_code_2(
    run: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], cause: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cause in refusal_of("export toy first", *words)
    assert list(tmp_path.glob("arm*")) == []


def test_a_run_that_there_is_not(session_on_disk: Session, tmp_path: Path) -> None:
    done = refusal_of("export toy first --to", tmp_path / "arm.bvh")
    assert "first" in done
    assert "remedy" in done


def test_the_best_track_is_written_unless_another_is_named_and_the_answer_says_which(
    session_on_disk: Session, run: str, tmp_path: Path
) -> None:
    """After `smooth`, `export` writes what was smoothed; a track of another pose tells which one it was."""
    stored = session_on_disk.run(run)
    raw = read_track(stored)
    still = {"poses": np.zeros_like(raw.poses), "made_by": {"verb": "smooth", "from": "raw"}}
    write_track(stored, dataclasses.replace(raw, name="smoothed", **still))
    place = tmp_path / "arm.npz"
    done = call("export toy first --to", place)
    assert "track 'smoothed'" in done.stdout
    with np.load(place) as arrays:
        assert not arrays["poses"].any()
    named = answer_of("export toy first --to", place, "--track", "raw")
    assert named["track"] == "raw"
    with np.load(place) as arrays:
        assert arrays["poses"].any()


def test_a_better_track_that_is_out_of_date_is_passed_over_and_named(
    session_on_disk: Session, run: str, tmp_path: Path
) -> None:
    stored = session_on_disk.run(run)
    short = dataclasses.replace(read_track(stored, "short"), name="smoothed")
    write_track(stored, short)
    done = call("export toy first --to", tmp_path / "arm.trc", "--json")
    assert json.loads(done.stdout)["track"] == "raw"
    assert "'smoothed' was made before the run changed" in done.stderr
