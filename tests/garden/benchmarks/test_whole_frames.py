"""Whole frames are measured with every stage of them; the table says how far each figure is from its aim."""

import json
import math
import os
from pathlib import Path

import pytest
from click.testing import CliRunner

from studio.cli.bench_commands import bench_command
from studio.foundations.progress import no_progress
from studio.garden.benchmarks.results_table import in_lines, remember, rows_of, this_machine
from studio.garden.benchmarks.timing import IdleShare, resident_megabytes
from studio.garden.benchmarks.whole_frames import BODYTRACK, DEFAULT, IMPROVED, SWARM, measure_frames


def stages(figures: dict[str, object]) -> set[tuple[str, str]]:
    rows = figures["stages"]
    assert isinstance(rows, list)
    return {(row["thread"], row["stage"]) for row in rows}


def test_a_whole_frame_has_all_its_stages() -> None:
    figures = measure_frames(DEFAULT, no_progress, frames=2).figures()
    assert (figures["frames"], figures["evaluations"]) == (2, 1000)
    main = {"search", "refine", "conclude", "wait for the frame"}
    assert {("MainThread", stage) for stage in main} <= stages(figures)
    assert {("view", "decode"), ("view", "mask"), ("view", "edges")} <= stages(figures)
    assert {("next-frame", "prepare"), ("next-frame", "distances"), ("storing", "store")} <= stages(figures)
    assert 0.0 < figures["quickest_ms"] <= figures["ms"]
    assert figures["refinement_ms"] > 0.0


@pytest.mark.parametrize(("workload", "evaluations"), [(IMPROVED, 2000), (SWARM, 1000)])
def test_the_papers_searches_refine_nothing(workload: str, evaluations: int) -> None:
    figures = measure_frames(workload, no_progress, frames=2).figures()
    assert figures["evaluations"] == evaluations
    assert not any(stage in ("refine", "distances") for _, stage in stages(figures))


def test_the_idle_share_is_of_all_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    idle, now = iter((100.0, 103.0)), iter((10.0, 12.0))
    monkeypatch.setattr("studio.garden.benchmarks.timing._idle_seconds", lambda: next(idle))
    monkeypatch.setattr("studio.garden.benchmarks.timing.time.monotonic", lambda: next(now))
    monkeypatch.setattr("studio.garden.benchmarks.timing.os.cpu_count", lambda: 2)
    assert IdleShare().so_far() == 0.75


def test_memory_is_what_processes_have_in_use() -> None:
    fields = dict(
        line.split(":") for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    )
    kibibytes = float(fields["VmRSS"].split()[0])
    assert resident_megabytes(os.getpid()) == pytest.approx(kibibytes * 1024 / 1e6, rel=0.05)
    assert resident_megabytes(os.getpid(), os.getpid()) == pytest.approx(
        2.0 * resident_megabytes(os.getpid()), rel=0.05
    )
    assert math.isnan(resident_megabytes(os.getpid(), 0))


def test_who_asks_for_minutes_asks_for_the_live_run_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path / "workspace"))
    measured: list[float | None] = []

    def live(report: object, minutes: float | None) -> dict[str, object]:
        measured.append(minutes)
        return {"scene_open": {"frames_per_second": 29.9, "memory_growth": 0.1}}

    monkeypatch.setattr("studio.cli.bench_commands.run_live_benchmark", live)
    monkeypatch.setattr("studio.cli.bench_commands.in_words", lambda found: "")
    answer = CliRunner().invoke(bench_command, ["--minutes", "20", "--json"], catch_exceptions=False)
    assert measured == [20.0]
    rows = {row["name"]: row["reached"] for row in json.loads(answer.stdout)["rows"]}
    assert rows == {"live, scene open, 30 Hz": 0.997, "live, growth of memory": 0.5}


def test_the_trace_and_the_history(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path / "workspace"))
    monkeypatch.setattr("studio.cli.bench_commands.measure_frames", lambda kind, report: _short(kind))
    options = ["--workload", BODYTRACK, "--trace", str(tmp_path / "trace.json"), "--json"]
    answer = CliRunner().invoke(bench_command, options, catch_exceptions=False)
    document = json.loads(answer.stdout)
    frame = document["frames"][BODYTRACK]
    assert frame["evaluations"] == 5000
    assert not any(stage == "refine" for _, stage in stages(frame))
    assert [row["name"] for row in document["rows"]] == ["a whole frame of the benchmark's"]
    names = {
        event["name"] for event in json.loads((tmp_path / "trace.json").read_text("utf-8"))["traceEvents"]
    }
    assert {"decode", "prepare", "search", "conclude", "store"} <= names
    entry = json.loads(Path(document["history"]).read_text("utf-8"))
    assert entry["rows"] == document["rows"]
    assert entry["machine"]["cores"] >= 1


def _short(kind: str):
    return measure_frames(kind, no_progress, frames=2)


def test_bars_are_full_where_the_aim_is_reached() -> None:
    document = {
        "edge_region": {"evaluations_per_second": 0.425e6, "load_limit_per_second": 1e6},
        "frames": {"default": {"ms": 20.0, "refinement_ms": 10.0}},
    }
    rows = {row["name"]: row for row in rows_of(document)}
    assert [row["reached"] for row in rows.values()] == [0.5, 1.0, 0.5]
    kernel, frame, refinement = in_lines(list(rows.values()))[1:]
    assert kernel.endswith("█" * 10 + "░" * 10)
    assert " 0.42 " in kernel
    assert frame.endswith("█" * 20)
    assert "≤ 25 ms" in frame
    assert refinement.endswith("█" * 10 + "░" * 10)


def test_a_live_runs_rows() -> None:
    run = {"frames_per_second": 30.0, "dropped_share": 0.0, "latency_ms": {"p95": 40.0}, "idle_share": 0.5}
    rows = {row["name"]: row for row in rows_of({"live": {"scene_open": run, "frame_ms": 24.0}})}
    assert rows["live, picture to pose, 95 % of frames"]["reached"] == 1.0
    assert rows["live, idle share of all cores"]["value"] == 50.0
    assert rows["a live frame on one core"]["reached"] == 0.5


def test_the_history_grows(tmp_path: Path) -> None:
    place = tmp_path / "there" / "history.jsonl"
    for reached in (0.5, 0.75):
        remember(this_machine(), [{"name": "a", "reached": reached}], place)
    entries = [json.loads(line) for line in place.read_text("utf-8").splitlines()]
    assert [entry["rows"][0]["reached"] for entry in entries] == [0.5, 0.75]
