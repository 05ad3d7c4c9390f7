"""Work on other machines with the real commands: workers that see a store alone, workers that are killed, and the same
results, bit for bit, as on this machine.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import psutil
import pytest
from distributed import LocalCluster
from s3_server import BUCKET, s3_server, used_here
from sample_walk import copy_of_walk
from toy_experiments import toy
from waiting import until

import studio
from studio.foundations.errors import SessionError
from studio.garden.reproduction.runner import reproduce
from studio.operations.comparison_folders import new_comparison, place_of
from studio.operations.jobs.comparison_run import run_comparison
from studio.results.comparison.sweep import conclude_sweep, plan_sweep
from studio.results.comparison.trials import Scale
from studio.sessions.object_stores import Store
from studio.sessions.remote_sessions import address_of, remote_runs, remote_session, sessions_at
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

FOLDER = f"s3://{BUCKET}/sessions"
PATIENCE = 240.0
KNOBS = {"layers": 2, "particles": 20}
GRID = {"survival": [0.2, 0.5]}


class Far:
    """Another machine: a worker that has an empty cache of its own and sees nothing of this test's folders."""

    def __init__(self, scheduler: str, home: Path, variables: Mapping[str, str]) -> None:
        home.mkdir()
        self.home = home
        command = [str(Path(sys.executable).parent / "dask"), "worker", scheduler]
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--memory-limit", "0"]
        own = {"STUDIO_CACHE": str(home / "cache"), "STUDIO_WORKSPACE": str(home / "none"), "HOME": str(home)}
        environment = {**os.environ, **variables, **own}
        self.process = subprocess.Popen([*command, *options], cwd=home, env=environment)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture(scope="module")
def server() -> Iterator[Mapping[str, str]]:
    with s3_server() as variables:
        yield variables


@pytest.fixture
def store(server: Mapping[str, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[str]:
    """A folder of the store that this machine may use, too; it has a cache of its own."""
    with used_here(server, monkeypatch, tmp_path / "cache of this machine"):
        yield f"{FOLDER}/{tmp_path.name}"


@pytest.fixture
def scheduler() -> Iterator[str]:
    with LocalCluster(n_workers=0, dashboard_address="127.0.0.1:0") as made:
        yield made.scheduler_address


@pytest.fixture
def far(scheduler: str, server: Mapping[str, str], tmp_path: Path) -> Iterator[list[Far]]:
    machines = [Far(scheduler, tmp_path / f"machine-{number}", server) for number in range(2)]
    yield machines
    for machine in machines:
        machine.kill()


def same_search(one: StoredRun, other: StoredRun) -> None:
    """Frames, poses and every layer's particles, bit for bit."""
    with one.results() as found, other.results() as wanted:
        assert found.frames() == wanted.frames()
        np.testing.assert_array_equal(found.poses()[1], wanted.poses()[1])
        for frame in wanted.frames():
            for layer, expected in zip(found.layers(frame), wanted.layers(frame), strict=True):
                np.testing.assert_array_equal(layer.poses, expected.poses)
                np.testing.assert_array_equal(layer.log_weights, expected.log_weights)


@pytest.mark.slow
def test_a_sweep_of_a_session_in_a_store_with_a_machine_lost(
    store: str, scheduler: str, far: list[Far], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walk = copy_of_walk(tmp_path / "walk")
    address = studio.upload(walk, f"{store}/walk")
    killed: list[int] = []

    def kill_one_at_work() -> None:
        until(lambda: sessions_at(address)[0].runs, PATIENCE)
        killed.append(far[0].process.pid)
        far[0].kill()

    killer = threading.Thread(target=kill_one_at_work)
    killer.start()
    options = {"vary": GRID, "seeds": 2, "knobs": KNOBS, "last": 2, "fit_shape": False}
    found = studio.sweep(address, cluster=scheduler, **options)
    killer.join()
    assert killed

    plan = plan_sweep(walk, GRID, range(2), knobs=KNOBS, last=2, fit_shape=False)
    kept = new_comparison(place_of(walk, sweep=True), plan)
    with ThreadPoolExecutor(1) as here:
        serial = run_comparison(kept, walk, lambda *_: None, conclude_sweep, executor=here)
    assert [replace(run, milliseconds=0) for run in found.sweep.runs] == [
        replace(run, milliseconds=0) for run in serial.runs
    ]
    # The workers saw the store alone, and brought the session from there.
    assert not any("runs" in path.name for path in tmp_path.glob("cache of this machine/*/walk/*"))
    assert list((far[1].home / "cache").glob("*/walk/session.json"))
    back = studio.download(address, tmp_path / "back" / "walk")
    assert {run.name for run in back.runs()} == {run.name for run in walk.runs()}
    for run in walk.runs():
        same_search(back.run(run.name), run)
    assert (back.path / "comparisons" / found.kept.name / "result.json").is_file()
    assert not [name for name in Store(store)._files.find(address) if ".partial" in name]

    # Outcomes lost, runs kept: the same command on another machine goes on, and tracks nothing again.
    kept_there = Store(f"{address}/comparisons/{found.kept.name}")
    kept_there.remove([name for name in kept_there.listed() if name != "comparison.json"])
    before = {name: one.stamp for name, one in Store(f"{address}/runs").listed().items()}
    monkeypatch.setenv("STUDIO_CACHE", str(tmp_path / "cache of another machine"))
    again = studio.sweep(address, cluster=scheduler, **options)
    assert [run.run for run in again.sweep.runs] == [run.run for run in found.sweep.runs]
    assert {name: one.stamp for name, one in Store(f"{address}/runs").listed().items()} == before


@pytest.mark.slow
def test_a_batch_compares_and_tracks_at_addresses(
    store: str, scheduler: str, far: list[Far], tmp_path: Path
) -> None:
    walk = copy_of_walk(tmp_path / "walk")
    for name in ("first", "second"):
        studio.upload(walk, f"{store}/{name}")
    options = {"knobs": KNOBS, "last": 2, "fit_shape": False}
    done = studio.batch([store], cluster=scheduler, name="many", **options)
    assert [(line.session, line.failure) for line in done.lines] == [("first", ""), ("second", "")]
    here = studio.track(walk, **options)
    there = studio.track(f"{store}/first", **options)
    assert there.run.name == "run-2"
    assert remote_runs(remote_session(f"{store}/first")) == {"many", "run-2"}
    back = studio.download(f"{store}/first", tmp_path / "back" / "first")
    for name in ("many", "run-2"):
        same_search(back.run(name), here.run)

    again = studio.batch([store], cluster=scheduler, name="many", **options)
    assert [asdict(line) for line in again.lines] == [asdict(line) for line in done.lines]
    assert remote_runs(remote_session(f"{store}/second")) == {"many"}

    wanted = {"trackers": ["annealed"], "evaluations": 40, "seeds": 2, "last": 2, "layers": 2}
    far_away = studio.compare(f"{store}/first", cluster=scheduler, **wanted)
    at_home = studio.compare(walk, processes=1, **wanted)
    assert [result.mean_mm for result in far_away.comparison.trackers[0].seeds] == [
        result.mean_mm for result in at_home.comparison.trackers[0].seeds
    ]
    names = Store(f"{store}/first/comparisons").listed()
    assert f"{far_away.kept.name}/result.json" in names

    # One that is half there stops the batch before anything is tracked.
    Store(f"{store}/second").remove(["session.json"])
    with pytest.raises(SessionError, match=r"second' is no complete session"):
        studio.batch([store], cluster=scheduler, **options)


@pytest.mark.slow
def test_an_interrupted_run_goes_on_from_its_store(store: str, tmp_path: Path) -> None:
    walk = copy_of_walk(tmp_path / "walk")
    address = studio.upload(walk, f"{store}/walk")

    def enough(step: str, done: int, _total: int) -> None:
        if step.startswith("walk /") and done == 2:
            raise KeyboardInterrupt

    options = {"knobs": KNOBS, "last": 3, "fit_shape": False}
    with pytest.raises(KeyboardInterrupt):
        studio.track(address, name="broken", progress=enough, **options)
    assert remote_runs(remote_session(address)) == {"broken"}
    copy = remote_session(address)
    with copy.run("broken").results() as results:
        assert results.frames() == [0, 1]
    assert address_of(copy) == address
    studio.go_on(copy.run("broken"))
    back = studio.download(address, tmp_path / "back" / "walk")
    same_search(back.run("broken"), studio.track(walk, **options).run)


@pytest.mark.slow
def test_a_reproduction_is_kept_at_an_address(
    store: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    experiment, place = toy("toy", tmp_path / "log"), f"{store}/papers"
    options = {"scale": Scale((0, 1)), "report": lambda *_: None, "processes": 1}
    first = reproduce((experiment,), place, **options)
    assert (first.measured, first.kept) == (4, 0)
    names = Store(place).listed()
    assert {"results.json", "report.html"} <= set(names)
    assert sum(name.startswith("trials/") for name in names) == 4
    monkeypatch.setenv("STUDIO_CACHE", str(tmp_path / "cache of another machine"))
    again = reproduce((experiment,), place, **options)
    assert (again.measured, again.kept) == (0, 4)


@pytest.mark.slow
def test_24_runs_on_two_workers_one_killed_are_those_of_a_serial_sweep(tmp_path: Path) -> None:
    """`studio sweep` as it is typed, of the bundled walk; issue 15, Shows 4."""
    here, there = copy_of_walk(tmp_path / "here" / "walk"), copy_of_walk(tmp_path / "there" / "walk")
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", memory_limit=0
    ) as made:
        killed: list[int] = []

        def kill_one_at_work() -> None:
            until(lambda: len(finished(there)) >= 4, 10 * PATIENCE)
            worker = psutil.Process(made.workers[0].pid)
            killed.append(worker.pid)
            os.kill(worker.pid, signal.SIGKILL)

        killer = threading.Thread(target=kill_one_at_work)
        killer.start()
        on_two = swept(there, "--cluster", made.scheduler_address)
        killer.join()
        assert killed
        assert killed[0] not in [nanny.pid for nanny in made.workers.values()]
    serial = swept(here, "--processes", "1")
    assert len(serial.splitlines()) == 1 + 24 * 3
    assert on_two == serial
    assert len(here.runs()) == 24
    for run in here.runs():
        same_search(there.run(run.name), run)


def finished(session: Session) -> list[str]:
    return [path.name for path in session.path.glob("comparisons/*/trials/*.json")]


def swept(session: Session, *options: str) -> str:
    """The table of 24 runs: knobs, seed, run, frame, error."""
    grid = ["--vary", "survival=0.2,0.5", "--vary", "particles=10,20,30,40", "--seeds", "3"]
    few = ["--frames", ":3", "--set", "layers=2", "--keep-shape", "--json"]
    command = [str(Path(sys.executable).parent / "studio"), "sweep", str(session.path), *grid, *few, *options]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return (Path(json.loads(done.stdout)["folder"]) / "frames.csv").read_text()
