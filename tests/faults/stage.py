"""The small session that faults are planted into, what is done in it, and how all of that ends where nothing fails."""

import contextlib
import hashlib
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from flipped_bytes import flip_stored
from toy_session import facing_camera, make_session, true_poses

from faults.seams import watched
from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.geometry.camera import Camera
from studio.operations.jobs.batch import track_to_end
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.results.verifying import repair, verify
from studio.runs.new_run import prepare_run
from studio.sessions.importers.importing import ImportOptions, import_source
from studio.sessions.named_rows import write_pose
from studio.sessions.results_codec import particle_arrays
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

FRAMES = 4
QUICK = {"particles": 20, "layers": 2, "start_repeats": 2}
TOY, NEW, DONE, DAMAGED, IMPORTED = "toy", "new", "done", "damaged", "imported"


def new_run(session: Session, name: str) -> StoredRun:
    """A run that is tracked in a tenth of a second, not begun."""
    start = true_poses()[0] + 0.02
    return prepare_run(session, name=name, seed=7, start_pose=start, knobs=QUICK)


def track(session: Session, run: StoredRun) -> None:
    """To its end, as the command line does."""
    if run.summary().status != "finished":
        track_to_end(session, run, lambda *_: None)


def frames_of(run: StoredRun) -> dict[int, str]:
    """Of each whole frame, all numbers but the time that it took, as a digest."""
    found: dict[int, str] = {}
    with run.results() as results:
        for frame in results.frames():
            result = results.result(frame)
            assert result.carried.particles is not None
            parts = [result.estimate.pose, *particle_arrays(result.carried.particles).values()]
            for record in results.layers(frame):
                parts += [
                    record.poses,
                    record.log_weights,
                    record.best,
                    np.array([record.layer, record.beta]),
                ]
            found[frame] = hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()
    return found


@dataclass(frozen=True, slots=True)
class Place:
    """A folder in which a trial may do as it likes: a workspace, footage to be imported, room for exports."""

    folder: Path

    @property
    def workspace(self) -> Workspace:
        return Workspace(self.folder / "workspace")

    @property
    def session(self) -> Session:
        return self.workspace.session(TOY)

    def run(self, name: str) -> StoredRun:
        return self.session.run(name)


# ---------------------------------------------------------------------- what is done; doing it twice is doing it once


def _make(at: Place) -> None:
    with contextlib.suppress(NotFoundError):
        at.run("made")
        return
    new_run(at.session, "made")


def _track(at: Place) -> None:
    track(at.session, at.run(NEW))


def _export(at: Place) -> None:
    for kind in ("trc", "bvh"):
        export_run(at.session, at.run(DONE), FORMATS[kind], {}, at.folder / "exports" / f"arm.{kind}")


def _repair(at: Place) -> None:
    repair(at.session, verify(at.session).faults)


def _import(at: Place) -> None:
    with contextlib.suppress(NotFoundError):
        at.workspace.session(IMPORTED)
        return
    import_source(at.folder / "source", at.workspace.place_for(IMPORTED), ImportOptions(fps=60.0))


def _describe(at: Place) -> None:
    body = at.session.body()
    names = tuple(entry.name for entry in body.parameters)
    write_pose(at.session.path / "start_pose.csv", names, true_poses()[1])


def _run_after(name: str) -> Callable[[Place], object]:
    def after(at: Place) -> object:
        track(at.session, at.run(name))
        return frames_of(at.run(name))

    return after


def _files_after(*names: str) -> Callable[[Place], object]:
    return lambda at: {name: (at.folder / name).read_bytes() for name in names}


def _session_after(at: Place) -> object:
    session = at.workspace.session(IMPORTED)
    files = sorted(path.relative_to(session.path).as_posix() for path in session.path.rglob("*"))
    manifest = json.loads((session.path / "session.json").read_text())
    for varying in ("created", "imported_from"):
        manifest.pop(varying)
    return files, manifest, session.footage().picture("front", FRAMES - 1).tobytes()


@dataclass(frozen=True, slots=True)
class Deed:
    """Something that a person does with the studio. after : what there is once it is done."""

    do: Callable[[Place], None]
    after: Callable[[Place], object]


DEEDS: Mapping[str, Deed] = {
    "make a run": Deed(_make, _run_after("made")),
    "track": Deed(_track, _run_after(NEW)),
    "export": Deed(_export, _files_after("exports/arm.trc", "exports/arm.bvh")),
    "repair": Deed(_repair, _run_after(DAMAGED)),
    "import": Deed(_import, _session_after),
    "set a start pose": Deed(_describe, _files_after("workspace/toy/start_pose.csv")),
}


@dataclass
class Stage:
    """frames : of a run where nothing fails. touches : of each deed then; afters : what there is after it. files : of
    the session, which no deed changes, by path.
    """

    folder: Path
    frames: dict[int, str] = field(init=False)
    touches: dict[str, list[str]] = field(init=False)
    afters: dict[str, object] = field(init=False)
    files: dict[str, bytes] = field(init=False)

    def __post_init__(self) -> None:
        first = Place(self.folder / "first")
        session = build_session(first, (DONE, DAMAGED), NEW)
        rng = np.random.default_rng(1)
        while verify(session).faults == ():
            flip_stored(session.run(DAMAGED).folder / "results.sqlite", rng)
        build_source(first)
        (first.folder / "exports").mkdir()
        self.frames = frames_of(first.run(DONE))
        self.files = files_of(first)
        self.touches, self.afters = {}, {}
        for name, deed in DEEDS.items():
            at = self.place(name.replace(" ", "-"))
            with watched(at.folder, lambda _: None) as self.touches[name]:
                deed.do(at)
            self.afters[name] = deed.after(at)
            shutil.rmtree(at.folder)
        assert self.afters["track"] == self.frames

    def place(self, name: str) -> Place:
        """A fresh copy for a trial."""
        shutil.copytree(self.folder / "first", self.folder / name)
        return Place(self.folder / name)


def build_session(
    at: Place,
    tracked: Sequence[str],
    fresh: str,
    frames: int = FRAMES,
    cameras: tuple[Camera, ...] = (facing_camera(),),
) -> Session:
    """The small session. tracked, fresh : the names of its runs, tracked to their end and not begun."""
    session = make_session(at.workspace.place_for(TOY), frames, cameras=cameras)
    for name in tracked:
        track(session, new_run(session, name))
    new_run(session, fresh)
    return session


def build_source(at: Place) -> None:
    """A folder of footage and calibration that can be imported."""
    source = at.folder / "source"
    shutil.copytree(at.session.path / "calibration", source / "calibration")
    with contextlib.closing(at.session.footage()) as footage:
        for camera in at.session.cameras():
            (source / camera.name).mkdir()
            for frame in range(at.session.manifest.frame_count):
                picture = footage.picture(camera.name, frame)
                cv2.imwrite(str(source / camera.name / f"{frame:04d}.png"), picture)


def files_of(at: Place) -> dict[str, bytes]:
    """The session's own files, which no deed changes."""
    root = at.session.path
    names = ("session.json", *(path.relative_to(root).as_posix() for path in root.glob("*/**/*.*")))
    return {
        name: (root / name).read_bytes()
        for name in names
        if not name.startswith("runs/") and "/." not in f"/{name}" and (root / name).is_file()
    }


def problems_of(stage: Stage, at: Place) -> list[str]:
    """What is not as it has to be whenever nobody does anything: nothing is lost, nothing false is said."""
    wrong: list[str] = []
    if files_of(at) != stage.files:
        wrong.append("a file of the session is not what it was")
    names = {session.name for session in at.workspace.sessions()}
    if not {TOY} <= names <= {TOY, IMPORTED}:
        wrong.append(f"sessions {sorted(names)}")
    for run in at.session.runs():
        try:
            frames, summary = frames_of(run), run.summary()
        except SessionError as error:
            wrong.append(f"run {run.name} cannot be read: {error.message}")
            continue
        if any(stage.frames[frame] != digest for frame, digest in frames.items()):
            wrong.append(f"run {run.name} has a frame that was never tracked so")
        if run.name == DONE and frames != stage.frames:
            wrong.append(f"frames {sorted(stage.frames.keys() - frames)} of run done are lost")
        if summary.status == "tracking":
            wrong.append(f"run {run.name} is said to be tracked, and nobody does")
        if (summary.status == "finished") != (len(frames) == FRAMES) or summary.done != len(frames):
            wrong.append(f"run {run.name} is said to be {summary.status} with {len(frames)} frames")
    return wrong
