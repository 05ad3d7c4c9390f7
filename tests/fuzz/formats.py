"""Every format that the studio reads: where its small valid files come from, and all that reads them."""

import contextlib
import dataclasses
import json
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from toy_session import make_session, true_poses
from tracked_runs import finish

from studio.body.motion_files.c3d import read_c3d
from studio.body.motion_files.reading import read_recording
from studio.body.motion_files.trc import read_trc
from studio.body.motion_files.truth_files import read_truth
from studio.body.reader import read_body
from studio.body.robots import read_robot
from studio.body.subject import Subject, write_subject
from studio.footage.calibration.floor import clicked_floor, read_clicks
from studio.footage.capture.calibration_files import find_calibrations, read_calibration, read_intrinsics
from studio.footage.capture.camera_addresses import camera_address
from studio.footage.capture.pictures import check_picture, list_pictures, read_picture
from studio.footage.capture.stream_files import mend_recording
from studio.footage.capture.timestamps import offsets_from_times, read_timestamps
from studio.footage.capture.video import VideoReader, measure_video, probe_video
from studio.foundations.errors import StudioError
from studio.results.arena.problem import Problem
from studio.results.arena.problem_files import read_problems
from studio.results.verifying import verify
from studio.runs.new_run import prepare_run
from studio.runs.setup.session_settings import session_settings
from studio.runs.tracks import BEST, RAW, read_track, write_track
from studio.search.behaviour.model_file import read_model
from studio.search.settings import changed_settings, default_settings
from studio.sessions.archives import unpack
from studio.sessions.importers.bodytrack import read_numbers
from studio.sessions.importers.folder_layout import plan_folder
from studio.sessions.importers.mask_forms import form_of_masks
from studio.sessions.importers.writing import carried_truth, check_person
from studio.sessions.landmark_clicks import clicks_of_file, keep_clicks, stored_clicks
from studio.sessions.live_recordings import read_sets
from studio.sessions.named_rows import write_pose, write_sigma
from studio.sessions.run_log import append_to_log, read_log
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

SEEDS = Path(__file__).resolve().parent / "seeds"
Read = Callable[[Path], object]


@dataclass(frozen=True, slots=True)
class Format:
    """readers : each is given the folder. files : pattern of those that are malformed. made : fills the folder where
    its files are not in `seeds`.
    """

    readers: tuple[Read, ...]
    files: str = "*"
    made: Callable[[Path], object] | None = None

    def fill(self, name: str, folder: Path) -> None:
        """The valid files."""
        if self.made is None:
            shutil.copytree(SEEDS / name, folder)
        else:
            self.made(folder)


def _each(read: Read, pattern: str = "*") -> Read:
    """Read each file of a folder."""

    def all_of_them(folder: Path) -> None:
        for path in sorted(folder.glob(pattern)):
            read(path)

    return all_of_them


def _make_session(folder: Path) -> None:
    """A session with a finished run, a derived track and everything else that is kept as a file."""
    session = make_session(folder / "toy", 3)
    changes = {"particles": 5, "layers": 1, "start_repeats": 1}
    body = session.body()
    run = prepare_run(session, name="a", start_pose=true_poses()[0], knobs=changes)
    finish(session, run)
    write_track(run, dataclasses.replace(read_track(run, RAW), name="smooth", made_by={"verb": "smooth"}))
    append_to_log(run.folder, "info", "Finished.")
    names = tuple(entry.name for entry in body.parameters)
    write_pose(session.path / "start_pose.csv", names, body.neutral)
    write_sigma(session.path / "sigma.csv", names, np.full(len(names), 0.05), 60.0)
    write_subject(Subject(session.manifest.body), session.path / "subject.toml")
    (session.path / "evidence.json").write_text('{"schema": 1, "knobs": {"background_model": "median"}}')
    verify(session)


def _make_landmarks(folder: Path) -> None:
    """A session beside a file of landmarks that were clicked in its pictures."""
    session = make_session(folder / "toy", 3)
    rows = [
        f"{frame},{source.name},arm1 tip,{30.5 + frame},20"
        for frame in range(3)
        for source in session.manifest.footage.cameras
    ]
    (folder / "landmarks.csv").write_text("\n".join(["frame,camera,landmark,x,y", *rows]) + "\n")


def _read_landmarks(folder: Path) -> None:
    session = Session(folder / "toy")
    clicks = clicks_of_file(session, folder / "landmarks.csv")
    keep_clicks(session, clicks)
    assert len(stored_clicks(session)) == len(clicks)


def _projects(folder: Path) -> None:
    """Folders as other tools leave them, whose videos are empty."""
    shutil.copytree(SEEDS / "projects", folder)


def _read_session(folder: Path) -> None:
    """All that a page or a command asks of a session; what is refused does not end it."""
    session = Session(folder / "toy")
    for read in (
        lambda: session.manifest,
        session.cameras,
        session.body_with_notes,
        session.start_pose,
        session.sigma,
        lambda: session_settings(session),
        lambda: session.footage().picture(session.manifest.footage.cameras[0].name, 1),
        lambda: verify(session),
        lambda: _read_run(session.run("a")),
    ):
        with contextlib.suppress(StudioError):
            read()


def _read_run(run: StoredRun) -> None:
    for read in (
        run.summary,
        run.body,
        run.cameras,
        run.behaviour,
        lambda: read_track(run, "smooth"),
        lambda: read_track(run, BEST),
        lambda: read_log(run.folder),
    ):
        with contextlib.suppress(StudioError):
            read()
    with run.results() as results:
        results.settings_history()
        results.timeline()
        results.partial()
        results.ended()
        results.arrivals()
        for frame in results.frames():
            results.result(frame)
            results.layers(frame)


def _read_settings(folder: Path) -> None:
    """The values of knobs, of any type; what is no JSON is a client's matter."""
    with contextlib.suppress(ValueError, RecursionError):
        found = json.loads((folder / "settings.json").read_bytes())
        if isinstance(found, dict):
            changed_settings(default_settings("annealed", "edge-region"), found)


def _read_clicks(folder: Path) -> None:
    cameras = read_calibration(SEEDS / "toml-calibration" / "cameras.toml").cameras
    clicked_floor(read_clicks(folder / "clicks.json"), cameras)


def _read_video(path: Path) -> None:
    probe_video(path)
    reader = VideoReader(path, measure_video(path).frame_count)
    try:
        reader.read(1)
    finally:
        reader.close()


def _read_project(folder: Path) -> None:
    """What an import makes of a folder before it decodes its footage."""
    plan = plan_folder(folder, None)
    assert plan.calibration is not None
    read = read_calibration(plan.calibration)
    check_person(plan)
    carried_truth(plan, read, 60.0, 3, "")


def _read_problems(path: Path) -> None:
    for problem in map(Problem, read_problems(path)):
        problem.log_likelihood(problem.prior.start[None])


def _unpack(path: Path) -> None:
    with tempfile.TemporaryDirectory(dir=path.parent.parent) as into:
        unpack(path, Path(into))


CALIBRATION = (_each(read_calibration), _each(read_intrinsics), find_calibrations)
PICTURE = (_each(read_picture), _each(check_picture))

FORMATS: Mapping[str, Format] = {
    "toml-calibration": Format(CALIBRATION),
    "freemocap-calibration": Format(CALIBRATION),
    "opencv-yaml": Format(CALIBRATION),
    "opencv-xml": Format(CALIBRATION),
    "easymocap": Format(CALIBRATION),
    "bouguet": Format(CALIBRATION),
    "qualisys": Format(CALIBRATION),
    "numbers": Format((_each(read_numbers),)),
    "clicks": Format((_read_clicks,)),
    "timestamps": Format((_each(lambda path: offsets_from_times(read_timestamps(path))),)),
    "body": Format((_each(read_body),)),
    "urdf": Format((_each(read_robot),)),
    "mjcf": Format((_each(read_robot),)),
    "acclaim": Format((_each(read_recording, "*.amc"),)),
    "bvh": Format((_each(read_recording),)),
    "humanoid-npz": Format((_each(read_recording),)),
    "trc": Format((_each(read_trc), _each(lambda path: read_truth(path, 60.0, 2)))),
    "points": Format((_each(lambda path: read_truth(path, 60.0, 2)),)),
    "points-h5": Format((_each(lambda path: read_truth(path, 60.0, 2)),)),
    "points-mat": Format((_each(lambda path: read_truth(path, 60.0, 2)),)),
    "points-npy": Format((_each(lambda path: read_truth(path, 60.0, 2)),)),
    "dannce": Format(CALIBRATION),
    "opencap": Format((lambda folder: read_calibration(folder / "Videos"),), "Videos/*/*"),
    **{
        f"project-{tool}": Format(
            (lambda folder, tool=tool: _read_project(folder / tool),), f"{tool}/**/*.*", _projects
        )
        for tool in ("anipose", "freemocap", "pose2sim", "opencap", "caliscope", "dannce")
    },
    "c3d": Format((_each(read_c3d),)),
    "png": Format((*PICTURE, lambda folder: form_of_masks(folder, len(list_pictures(folder))))),
    "jpeg": Format(PICTURE),
    "bmp": Format(PICTURE),
    "tiff": Format(PICTURE),
    "video": Format((_each(_read_video), _each(mend_recording))),
    "behaviour": Format((_each(read_model),)),
    "arena": Format((_each(_read_problems),)),
    "zip": Format((_each(_unpack),)),
    "tar": Format((_each(_unpack),)),
    "tar-gz": Format((_each(_unpack),)),
    "tar-xz": Format((_each(_unpack),)),
    "take": Format((read_sets,), "live/*"),
    "log": Format((read_log,)),
    "settings": Format((_read_settings,)),
    "address": Format((_each(lambda path: camera_address("cam1", path.read_text("latin-1"), replays=True)),)),
    "landmarks": Format((_read_landmarks,), "landmarks.csv", _make_landmarks),
    "session-record": Format((_read_session,), "toy/session.json", _make_session),
    "session-files": Format((_read_session,), "toy/*.*", _make_session),
    "run-record": Format((_read_session,), "toy/runs/a/run.json", _make_session),
    "run-files": Format((_read_session,), "toy/runs/a/**/*.*", _make_session),
    "results": Format((_read_session,), "toy/runs/a/results.sqlite", _make_session),
}
