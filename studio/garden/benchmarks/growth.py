"""How cost grows with each size: particles, samples, cameras, limbs, pixels, frames, runs; exponents, memory.

Whole frames are those of the bundled walk, tracked as a run tracks them (decoded, masked, searched, stored), in seconds
of all threads' work, so that other programs count little. An exponent is the slope of log time over log size at the
upper half of the sizes, where fixed costs hide it least.

`python -m studio.garden.benchmarks.growth --json FILE --document FILE` (`make growth`) prints a table and writes both.
"""

import argparse
import dataclasses
import json
import multiprocessing
import os
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import tomli_w

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource
from studio.footage.capture.video import VideoReader
from studio.foundations.arrays import Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress
from studio.garden.benchmarks.kernels import made_evidence, ring_of_cameras
from studio.garden.benchmarks.results_table import this_machine
from studio.garden.benchmarks.scale_document import document
from studio.operations.jobs.open_run import OpenRun
from studio.runs.new_run import prepare_run
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.sessions.manifest import write_manifest
from studio.sessions.results_store import ResultsWriter
from studio.sessions.samples import install_sample
from studio.sessions.session import CAMERAS_PATH, RUNS_NAME, Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

MOST_EXPONENT = 1.05
MOST_MEMORY_GROWTH = 1.1
"""Memory at ten times the frames, over that before."""
UNCOUNTED, COUNTED = 2, 6
"""Frames that warm up, and those that count."""
SEARCH_ONLY: Mapping[str, Any] = {"refine_frames": False, "layers": 4, "particles": 200}
ROUNDS = 20
TOGETHER = 50
"""Frames stored in one transaction."""


@dataclass(frozen=True, slots=True)
class Curve:
    """seconds : of each size, of `per`. memory : peak bytes of a process of each size, () where it is not measured."""

    name: str
    per: str
    sizes: tuple[int, ...]
    seconds: tuple[float, ...]
    memory: tuple[int, ...] = ()

    @property
    def exponent(self) -> float:
        """The slope of log seconds over log size, least squares over the upper half of the sizes (two at least)."""
        return slope(self.sizes, self.seconds)

    @property
    def memory_growth(self) -> float:
        """Memory of the largest size over that of the one before; NaN where it is not measured."""
        return self.memory[-1] / self.memory[-2] if self.memory else float("nan")

    @property
    def holds(self) -> bool:
        """Whether cost grows no faster than its size, and memory not at all."""
        return self.exponent <= MOST_EXPONENT and not self.memory_growth > MOST_MEMORY_GROWTH


def slope(sizes: Sequence[int], seconds: Sequence[float]) -> float:
    """The exponent of a curve at its upper half, by least squares."""
    kept = max(2, (len(sizes) + 1) // 2)
    return float(np.polyfit(np.log(sizes[-kept:]), np.log(seconds[-kept:]), 1)[0])


@dataclass(frozen=True, slots=True)
class Sizes:
    """What is measured. pictures : factors of 640 × 480. frames : stored. runs : of a workspace's session."""

    particles: tuple[int, ...] = (50, 200, 800, 3200)
    samples: tuple[int, ...] = (32, 64, 96, 128)
    cameras: tuple[int, ...] = (1, 2, 4, 8, 16)
    limbs: tuple[int, ...] = (4, 8, 16, 32, 64)
    pictures: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0, 6.0)
    frames: tuple[int, ...] = (1000, 10_000, 100_000)
    runs: tuple[int, ...] = (100, 1000, 10_000)


def measure_growth(sizes: Sizes, progress: Progress) -> tuple[list[Curve], dict[str, float]]:
    """The curves, and what a frame of the bundled walk costs by default. progress : called with (step, done, total)."""
    with tempfile.TemporaryDirectory(prefix="studio-growth-") as place:
        walk = install_sample(Workspace(Path(place)), "walk")
        made: Sequence[Callable[[], Curve]] = (
            lambda: _of_frames("particles", sizes.particles, walk, lambda size: {"particles": size}),
            lambda: _of_frames(
                "samples a limb and view", sizes.samples, walk,
                lambda size: {"edge_samples": size, "region_samples": size * 3 // 2},
            ),
            lambda: _of_sessions("cameras", sizes.cameras, walk, with_cameras),
            lambda: _of_limbs(sizes.limbs),
            lambda: _of_pictures(sizes.pictures, walk),
            lambda: _of_stored_frames(sizes.frames, walk),
            lambda: _of_runs(sizes.runs, walk),
        )  # fmt: skip
        curves = list[Curve]()
        for number, make in enumerate(made):
            progress("growth", number, len(made) + 1)
            curves.append(make())
        progress("growth", len(made), len(made) + 1)
        usual = usual_frame(walk)
        progress("growth", len(made) + 1, len(made) + 1)
    return curves, usual


# ------------------------------------------------------------------ whole frames


@contextmanager
def _opened(session: Session, last: int, knobs: Mapping[str, Any]) -> Generator[OpenRun]:
    run = prepare_run(session, last=last, knobs=knobs, fit_shape=False, allow_inconsistent=True)
    opened = OpenRun(str(session.path), str(run.folder))
    try:
        opened.warm_up()
        yield opened
    finally:
        opened.close()


def _frame(opened: OpenRun) -> None:
    while True:
        stepped = opened.step_layer()
        if stepped is not None and stepped.result is not None:
            return


def busy_frame(session: Session, knobs: Mapping[str, Any]) -> float:
    """Seconds of all threads' work on a frame that is searched only, the mean of some."""
    with _opened(session, UNCOUNTED + COUNTED, {**SEARCH_ONLY, **knobs}) as opened:
        for _ in range(UNCOUNTED):
            _frame(opened)
        began = time.process_time()
        for _ in range(COUNTED):
            _frame(opened)
        return (time.process_time() - began) / COUNTED


def usual_frame(walk: Session, frames: int = 30) -> dict[str, float]:
    """What one of `frames` frames of the default tracker costs: seconds of all threads' work, bytes of footage, bytes
    stored, and stored where only the set at a frame's end is kept.
    """
    with _opened(walk, UNCOUNTED + frames, {}) as opened:
        for _ in range(UNCOUNTED):
            _frame(opened)
        busy = time.process_time()
        for _ in range(frames):
            _frame(opened)
        busy = (time.process_time() - busy) / frames
        whole = opened.stored
    with _opened(walk, UNCOUNTED + COUNTED, {"record_particles": 0}) as opened:
        for _ in range(UNCOUNTED + COUNTED):
            _frame(opened)
        few = opened.stored
    footage = sum(path.stat().st_size for path in (walk.path / "videos").iterdir())
    return {
        "busy": busy,
        "stored": _stored(whole) / (UNCOUNTED + frames),
        "stored_few": _stored(few) / (UNCOUNTED + COUNTED),
        "footage": footage / walk.manifest.frame_count,
        "cameras": float(len(walk.manifest.footage.cameras)),
    }


def _stored(run: StoredRun) -> int:
    return sum(path.stat().st_size for path in run.folder.glob("results.sqlite*"))


def busy(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Seconds of all threads' work on a task in its quickest round; a first one, which compiles, does not count."""
    times = list[float]()
    for _ in range(rounds + 1):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times[1:])


def _of_frames(
    name: str, sizes: Sequence[int], walk: Session, knobs: Callable[[int], Mapping[str, Any]]
) -> Curve:
    seconds = tuple(busy_frame(walk, knobs(size)) for size in sizes)
    return Curve(name, "a whole frame", tuple(sizes), seconds)


def _of_sessions(
    name: str, sizes: Sequence[int], walk: Session, make: Callable[[Session, Path, int], Session]
) -> Curve:
    seconds = list[float]()
    for size in sizes:
        with tempfile.TemporaryDirectory(dir=walk.path.parent) as place:
            seconds.append(busy_frame(make(walk, Path(place) / "made", size), {}))
    return Curve(name, "a whole frame", tuple(sizes), tuple(seconds))


def with_cameras(walk: Session, place: Path, count: int) -> Session:
    """The walk seen by its cameras over and over, so many of them."""
    shutil.copytree(walk.path, place, ignore=shutil.ignore_patterns(RUNS_NAME))
    known, sources = walk.cameras(), walk.manifest.footage.cameras
    numbers = [number % len(sources) for number in range(count)]
    cameras = tuple(
        dataclasses.replace(known[one], name=f"camera{at}") for at, one in enumerate(numbers, start=1)
    )
    write_calibration(cameras, place / CAMERAS_PATH)
    seen = tuple(
        dataclasses.replace(sources[one], name=camera.name)
        for one, camera in zip(numbers, cameras, strict=True)
    )
    return _described(walk, place, seen)


def with_pictures(walk: Session, place: Path, factor: float) -> Session:
    """The first frames of the walk, its pictures that much larger."""
    shutil.copytree(walk.path, place, ignore=shutil.ignore_patterns(RUNS_NAME, "videos", "background"))
    (place / "background").mkdir()
    footage, sources, cameras = walk.footage(), list[CameraSource](), list[Camera]()
    try:
        for source, camera in zip(walk.manifest.footage.cameras, walk.cameras(), strict=True):
            size = (round(camera.width * factor), round(camera.height * factor))
            folder = place / "pictures" / source.name
            folder.mkdir(parents=True)
            for frame in range(UNCOUNTED + COUNTED):
                _write_larger(folder / f"{frame:04d}.jpg", footage.picture(source.name, frame), size)
            plate = f"background/{source.name}.png"
            empty = VideoReader(walk.path / source.background, 0)
            _write_larger(place / plate, empty.read(0), size)
            empty.close()
            cameras.append(camera.resized(*size))
            sources.append(
                CameraSource(
                    source.name, "pictures", f"pictures/{source.name}", *size, UNCOUNTED + COUNTED, background=plate
                )
            )  # fmt: skip
    finally:
        footage.close()
    write_calibration(tuple(cameras), place / CAMERAS_PATH)
    return _described(walk, place, tuple(sources))


def _write_larger(path: Path, picture: Bytes, size: tuple[int, int]) -> None:
    cv2.imwrite(str(path), cv2.resize(picture, size, interpolation=cv2.INTER_CUBIC))


def _described(walk: Session, place: Path, cameras: tuple[CameraSource, ...]) -> Session:
    source = walk.manifest.footage
    count = min(camera.frame_count for camera in cameras)
    footage = dataclasses.replace(source, cameras=cameras, frame_count=count)
    write_manifest(place, msgspec.structs.replace(walk.manifest, name=place.name, footage=footage))
    return Session(place)


def _of_pictures(factors: Sequence[float], walk: Session) -> Curve:
    def made(walk: Session, place: Path, size: int) -> Session:
        return with_pictures(walk, place, factor_of[size])

    camera = walk.cameras()[0]
    factor_of = {round(camera.width * one) * round(camera.height * one): one for one in factors}
    return _of_sessions("pixels of a picture", tuple(factor_of), walk, made)


# ------------------------------------------------------------------ limbs


def chain(limbs: int, folder: Path) -> BodyModel:
    """A body of so many short links one after the other, each turned by its own parameter."""
    names = [f"link_{number}" for number in range(1, limbs + 1)]
    length = 1600.0 / limbs

    def steps(at: int) -> list[dict[str, str]]:
        along = [{"move": "z", "by": f"{names[at - 1]}_length"}] if at else []
        return [*along, {"turn": "y", "by": f"x{at + 1}"}]

    text = {
        "title": f"Chain of {limbs}",
        "source": "Made to be measured.",
        "parameters": [
            {
                "name": f"x{at}", "label": f"x{at}", "kind": "angle", "limb": "arm",
                "lower": -60, "upper": 60, "max_step": 180,
            }
            for at in range(1, limbs + 1)
        ],
        "joints": [
            {
                "name": name, "parent": names[at - 1] if at else "world", "type": "hinge", "sequence": steps(at),
            }
            for at, name in enumerate(names)
        ],
        "limbs": [
            {
                "name": name, "joint": name, "length": f"{name}_length", "side": "middle",
                "radius_start": f"{name}_radius", "radius_end": f"{name}_radius", "scale_x": 1, "scale_y": 1,
            }
            for name in names
        ],
        "markers": [{"name": "Root", "joint": names[0], "at": [0, 0, 0]}],
        "dimensions": {
            **{f"{name}_length": {"mm": length} for name in names},
            **{f"{name}_radius": {"mm": 40.0} for name in names},
        },
    }  # fmt: skip
    path = folder / f"chain{limbs}.toml"
    path.write_bytes(tomli_w.dumps(text).encode())
    return load_body(str(path))


def _of_limbs(sizes: Sequence[int], poses: int = 496) -> Curve:
    """Poses weighed, bodies that fill the same room with more links."""
    works = dict[int, Callable[[], object]]()
    with tempfile.TemporaryDirectory() as place:
        for limbs in sizes:
            rng = np.random.default_rng(0)
            body = chain(limbs, Path(place))
            cameras = ring_of_cameras(body)
            evidence = made_evidence(body, cameras, rng)["proximity"]
            likelihood = EdgeRegionSilhouetteLikelihood(body, cameras, EdgeRegionSilhouetteSettings())
            problem = likelihood.problem(evidence)
            drawn = body.neutral + 0.02 * rng.normal(size=(poses, limbs))
            works[limbs] = lambda problem=problem, drawn=drawn: problem.log_likelihood(drawn)
        seconds = {size: busy(work) for size, work in works.items()}
    return Curve("limbs", f"{poses} poses weighed", tuple(sizes), tuple(seconds[size] for size in sizes))


# ------------------------------------------------------------------ frames and runs that are stored


def _of_stored_frames(sizes: Sequence[int], walk: Session) -> Curve:
    """Frames stored and read back, by a process of its own for each size."""
    seconds, memory = list[float](), list[int]()
    spawned = multiprocessing.get_context("spawn")
    for size in sizes:
        run = prepare_run(walk, last=2, knobs={**SEARCH_ONLY, "layers": 1, "particles": 10}, fit_shape=False)
        with spawned.Pool(1) as process:
            took, peak = process.apply(store_frames, (str(walk.path), run.name, size))
        seconds.append(took)
        memory.append(peak)
        shutil.rmtree(run.folder)
    return Curve("frames of a run", "all stored, timeline read", tuple(sizes), tuple(seconds), tuple(memory))


def store_frames(session: str, run_name: str, count: int) -> tuple[float, int]:
    """Seconds to store one tracked frame so often under other numbers and to read the timeline; and this process's peak
    memory, bytes.
    """
    opened = OpenRun(session, str(Session(Path(session)).run(run_name).folder))
    try:
        opened.warm_up()
        stepped = opened.step_layer()
        while stepped is None or stepped.result is None:
            stepped = opened.step_layer()
        record, result = stepped.record, stepped.result
        run, settings = opened.stored, opened.stored.record.settings
    finally:
        opened.close()
    began = time.process_time()
    with ResultsWriter(run.folder) as writer:
        writer.write_settings(1, 0, 0, settings)
        for first in range(0, count, TOGETHER):
            with writer.together():
                for frame in range(first, min(first + TOGETHER, count)):
                    numbered = dataclasses.replace(record, frame=frame)
                    writer.write_frame(dataclasses.replace(result, frame=frame), [numbered])
    peak = peak_memory()
    with run.results() as results:
        assert len(results.timeline().frames) == count
    return time.process_time() - began, peak


def peak_memory() -> int:
    """The most memory that this process had at once, bytes."""
    try:
        # What getrusage says begins, on Linux, at what the parent had.
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _of_runs(sizes: Sequence[int], walk: Session) -> Curve:
    """A workspace's list of sessions, as the page asks for it; a session with so many runs of one frame each."""
    run = prepare_run(walk, last=1, knobs={**SEARCH_ONLY, "layers": 1, "particles": 10}, fit_shape=False)
    store_frames(str(walk.path), run.name, 1)
    workspace = Workspace(walk.path.parent)
    seconds, made = list[float](), 1
    for size in sizes:
        for number in range(made, size):
            folder = walk.path / RUNS_NAME / f"copy-{number}"
            shutil.copytree(run.folder, folder, copy_function=os.link)
        made = size
        seconds.append(busy(workspace.sessions, 2))
    return Curve("runs of a workspace", "the list of sessions", tuple(sizes), tuple(seconds))


# ------------------------------------------------------------------ what is printed and kept


def as_json(curves: Sequence[Curve], usual: Mapping[str, float]) -> dict[str, Any]:
    """All that was measured, with the machine."""
    rows = [
        {
            **dataclasses.asdict(curve),
            "exponent": round(curve.exponent, 3),
            "memory_growth": round(curve.memory_growth, 3) if curve.memory else None,
            "holds": curve.holds,
        }
        for curve in curves
    ]
    return {"machine": dataclasses.asdict(this_machine()), "curves": rows, "usual_frame": dict(usual)}


def table(document: Mapping[str, Any]) -> str:
    """A row a curve."""
    lines = [f"{'':26}{'from':>10}{'to':>12}{'cost grows':>12}{'exponent':>10}{'memory':>8}"]
    for row in document["curves"]:
        memory = "" if row["memory_growth"] is None else f"× {row['memory_growth']:.2f}"
        growth = row["seconds"][-1] / row["seconds"][0]
        sizes = f"{row['sizes'][0]:>10}{row['sizes'][-1]:>12}"
        mark = "" if row["holds"] else "  grows faster than it should"
        lines.append(
            f"{row['name']:26}{sizes}{f'× {growth:.1f}':>12}{row['exponent']:>10.2f}{memory:>8}{mark}"
        )
    return "\n".join(lines)


def main() -> int:
    """Measure, print, write; 1 where anything grows faster than it should."""
    parser = argparse.ArgumentParser(prog="growth", description=__doc__)
    parser.add_argument("--json", type=Path, help="all figures")
    parser.add_argument("--document", type=Path, help="the page on scale, made from them")
    parser.add_argument("--machine", default="", help="the machine in words, for that page")
    asked = parser.parse_args()

    def report(step: str, done: int, total: int) -> None:
        sys.stderr.write(f"{step}: {done} of {total}\n")

    grown = as_json(*measure_growth(Sizes(), report))
    sys.stdout.write(table(grown) + "\n")
    if asked.json:
        asked.json.write_text(json.dumps(grown, indent=1) + "\n", encoding="utf-8")
    if asked.document:
        asked.document.write_text(document(grown, asked.machine), encoding="utf-8")
    return 0 if all(row["holds"] for row in grown["curves"]) else 1


if __name__ == "__main__":
    sys.exit(main())
