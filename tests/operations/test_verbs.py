"""The verbs for Python on a session of a planar arm: what goes in, what comes back, what is refused."""

import ast
import importlib
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from toy_footage import write_video
from toy_session import BODY, HEIGHT, WIDTH, true_poses

import studio
from studio import arena, extending
from studio.body.catalogue import load_body
from studio.body.subject import Subject
from studio.operations import person
from studio.operations.progress import reporting as shown_in
from studio.runs.setup.subject_fitting import FittedSubject
from studio.sessions.session import Session

FEW = {"particles": 20, "layers": 2}


def test_importing_studio_imports_no_room_until_a_verb_is_requested() -> None:
    code = (
        "import sys, studio; before = sorted(name for name in sys.modules if name.startswith('studio.')); "
        "studio.StudioError; print(before, 'studio.foundations.errors' in sys.modules, 'numba' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    own = ["studio.foundations", "studio.foundations.first_use"]
    assert found.stdout.strip() == f"{own} True False"


@pytest.mark.parametrize("public", [studio, extending, arena])
def test_what_editors_know_is_what_is_there(public: ModuleType) -> None:
    stub = ast.parse(Path(str(public.__file__)).with_suffix(".pyi").read_text(encoding="utf-8"))
    named = {entry.name: node.module for node in stub.body for entry in node.names}  # pyright: ignore[reportAttributeAccessIssue]
    assert sorted(named) == dir(public)
    for name, module in named.items():
        assert getattr(importlib.import_module(module), name) is getattr(public, name)


def test_all_verbs_are_there_with_a_docstring() -> None:
    for name in dir(studio):
        assert getattr(studio, name).__doc__, name
    with pytest.raises(AttributeError, match="no attribute 'trak'"):
        studio.trak  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_sessions_and_runs_go_by_name_folder_or_value(session_on_disk: Session) -> None:
    assert studio.list_sessions() == ("toy",)
    for named in ("toy", session_on_disk.path, str(session_on_disk.path), session_on_disk):
        assert studio.open_session(named).path == session_on_disk.path
    run = studio.track("toy", last=2, start_pose=true_poses()[0], knobs=FEW, name="one")
    folder = session_on_disk.path / "runs" / "one"
    for named in ("toy/one", f"{session_on_disk.path}/one", folder, str(folder), run, run.run):
        assert studio.open_run(named).folder == folder
    assert [entry.name for entry in studio.list_runs("toy")] == ["one"]


@pytest.mark.parametrize("name", ["one", "", "/one"])
def test_what_names_no_run_is_refused(name: str) -> None:
    with pytest.raises(studio.StudioError, match="names no run") as refusal:
        studio.open_run(name)
    assert "SESSION/RUN" in refusal.value.hint


def test_a_session_or_run_that_is_not_there(session_on_disk: Session) -> None:
    with pytest.raises(studio.StudioError, match="no session 'gone'"):
        studio.track("gone")
    with pytest.raises(studio.StudioError, match="no run 'gone'"):
        studio.read_track("toy/gone")


def test_track_gives_arrays_and_the_same_again_for_a_seed(session_on_disk: Session) -> None:
    start = true_poses()[0]
    runs = [
        studio.track(session_on_disk, last=4, seed=7, start_pose=start, knobs=FEW, progress=False)
        for _ in range(2)
    ]
    first, second = runs
    assert first.run.name != second.run.name
    assert first.names == tuple(entry.name for entry in load_body(BODY).parameters)
    assert first.poses.shape == (4, 4)
    assert np.array_equal(first.poses, second.poses)
    assert np.abs(first.poses - true_poses()[:4]).max() < 0.3
    assert first.run.record.start_source == "given"
    assert np.array_equal(studio.read_track(first).poses, first.poses)
    motion = studio.markers(first)
    assert motion.positions.shape == (4, len(load_body(BODY).markers), 3)
    assert motion.times.tolist() == [frame / first.run.record.fps for frame in range(4)]


def test_interrupted_tracking_is_kept_and_goes_on(session_on_disk: Session) -> None:
    def stop(_step: str, done: int, _total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    start = true_poses()[0]
    whole = studio.track("toy", last=4, start_pose=start, knobs=FEW, name="whole")
    with pytest.raises(KeyboardInterrupt):
        studio.track("toy", last=4, start_pose=start, knobs=FEW, name="cut", progress=stop)
    (summary,) = [entry for entry in studio.list_runs("toy") if entry.name == "cut"]
    assert (summary.status, summary.done) == ("cancelled", 2)
    done: list[tuple[int, int]] = []
    run = studio.go_on("toy/cut", progress=lambda _, at, total: done.append((at, total)))
    assert np.array_equal(run.poses, whole.poses)
    assert done[-1] == (4, 4)


def test_a_run_is_corrected_smoothed_and_exported(session_on_disk: Session, tmp_path: Path) -> None:
    truth = true_poses()
    run = studio.track("toy", last=6, start_pose=truth[0], knobs=FEW)
    with pytest.raises(studio.StudioError, match="needs a pose"):
        studio.correct(run, 3)
    with pytest.raises(studio.StudioError, match="needs a pose"):
        studio.correct(run, 3, truth[3], from_track="raw")
    fixed = studio.correct(run, 3, truth[3], name="fixed")
    assert np.array_equal(fixed.poses[:3], run.poses[:3])
    assert fixed.frames.tolist() == list(range(6))
    back = studio.correct(run, 3, truth[3], back_to=1, name="back")
    assert np.array_equal(back.poses[4:], run.poses[4:])
    assert back.poses.shape == run.poses.shape
    made = studio.smooth(run, knobs={"least_confidence": 0.0})
    assert made.track.poses.shape == (6, 4)
    with pytest.raises(studio.StudioError, match="smoothed"):
        studio.smooth(run)
    report = studio.export_run(run, tmp_path / "arm.npz", track="smoothed")
    assert report.files == (tmp_path / "arm.npz",)
    with pytest.raises(studio.StudioError, match="no truth"):
        studio.evaluate(run)
    with pytest.raises(studio.StudioError, match="wings"):
        studio.export_run(run, tmp_path / "arm.npz", wings=2)
    with pytest.raises(studio.StudioError, match="format 'doc'"):
        studio.export_run(run, tmp_path / "arm.doc")


def test_knobs_that_do_not_exist_are_named(session_on_disk: Session) -> None:
    for verb in (
        lambda: studio.track("toy", knobs={"partikles": 3}),
        lambda: studio.smooth(studio.track("toy", last=1, knobs=FEW), knobs={"partikles": 3}),
        lambda: studio.learn(["walk"], "steps", knobs={"partikles": 3}),
    ):
        with pytest.raises(studio.StudioError, match="partikles"):
            verb()


def test_exclusions_are_painted_and_taken_back(session_on_disk: Session) -> None:
    place = session_on_disk.path / "exclusions" / "front.png"
    studio.background("toy", "median", exclude={"front": [(0, 0), (40, 0), (40, 40), (0, 40)]}, tune=False)
    assert place.exists()
    studio.background("toy", "median", exclude={"front": None}, tune=False)
    assert not place.exists()


def test_a_fit_that_no_disk_would_keep_is_refused_before_it_begins(
    session_on_disk: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = list[Session]()

    def fit(session: Session, *_: object, **__: object) -> FittedSubject:
        begun.append(session)
        subject, none = Subject(body="planar_arm4"), np.zeros(0)
        return FittedSubject(subject, session.body(), (), (0,), np.zeros((1, 4)), none, none, "", 1)

    monkeypatch.setattr(person, "fit_session_subject", fit)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.setattr(os, "access", lambda place, _mode: Path(place) == elsewhere)
    with pytest.raises(studio.StudioError, match=r"'.*toy' cannot be written") as refusal:
        studio.fit_subject("toy")
    assert "another place" in refusal.value.hint
    assert not begun
    assert studio.fit_subject("toy", keep=False).file is None
    assert studio.fit_subject("toy", into=elsewhere / "subject.toml").file == elsewhere / "subject.toml"
    assert not (session_on_disk.path / "subject.toml").exists()


def test_a_height_in_metres_is_refused(session_on_disk: Session) -> None:
    with pytest.raises(studio.StudioError, match=r"'height_mm' cannot be 1\.76"):
        studio.subject("toy", 1.76)
    assert studio.subject("toy").name == BODY


def test_who_is_reported_decides_the_body_of_new_runs(session_on_disk: Session) -> None:
    assert studio.subject("toy", 1700.0, body="human31").name == "human31"
    assert Session(session_on_disk.path).manifest.body == "human31"
    assert Session(session_on_disk.path).body().name == "human31"


def test_cameras_of_a_session_are_not_replaced_unasked(session_on_disk: Session) -> None:
    with pytest.raises(studio.StudioError, match="there already"):
        studio.calibrate("toy", "chessboard:4x7,60", extrinsics="anywhere")
    with pytest.raises(studio.StudioError, match="no session and no folder"):
        studio.calibrate("nowhere", "chessboard:4x7,60")


def test_nobody_looks_at_a_bar_in_a_log_and_a_bar_can_be_asked_for(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for request, shown in ((None, False), (False, False), (True, True)):
        with shown_in(request, "Rendering") as report:
            report("frames", 1, 2)
        assert ("frames" in capsys.readouterr().err) == shown


def test_a_replayed_camera_is_recorded_into_a_session(session_on_disk: Session, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    pictures = [rng.integers(60, 190, (HEIGHT, WIDTH, 3), dtype=np.uint8) for _ in range(30)]
    video = write_video(tmp_path / "front.mp4", pictures, fps=30)
    steps: list[str] = []
    taken = studio.record(
        {"front": str(video)}, "take", "toy", fps=30.0, progress=lambda step, *_: steps.append(step)
    )
    assert taken.session.name == "take"
    assert [camera.name for camera in taken.session.cameras()] == ["front"]
    # Frames go by the clock: a busy machine records pictures late, and the one before stands in.
    assert taken.session.manifest.footage.frame_count >= 1
    assert steps
    with pytest.raises(studio.StudioError, match="No camera"):
        studio.record({}, "other", "toy")
