"""Defaults are filled in, and errors are raised before anything is made."""

from typing import Any

import msgspec
import numpy as np
import pytest
from toy_session import FRAMES, true_poses

from studio.body.subject import Subject
from studio.foundations.errors import BodyError, RunError, SettingsError, StudioError
from studio.runs.new_run import prepare_run
from studio.runs.search_space import default_sigma, parameter_names
from studio.runs.setup.start_pose_file import keep_start_pose
from studio.sessions.named_rows import write_pose, write_sigma
from studio.sessions.session import Session, redescribe


def test_defaults_come_from_the_session(session_on_disk: Session) -> None:
    names = parameter_names(session_on_disk.body())
    write_pose(session_on_disk.path / "start_pose.csv", names, np.array([0.1, 0.2, 0.3, 0.4]))
    session = redescribe(
        session_on_disk,
        msgspec.structs.replace(session_on_disk.manifest, tracker="condensation", weighting="template"),
    )
    record = prepare_run(session).record
    assert (record.tracker, record.weighting, record.body) == ("condensation", "template", "planar_arm4")
    assert (record.first, record.last, record.fps, record.name) == (0, 8, 60.0, "run-1")
    assert record.start_pose == (0.1, 0.2, 0.3, 0.4)
    assert record.dimensions["link_1_length"] == 250.0
    assert record.software
    assert record.settings["scale_survival"] == 0.1


def test_sigma_is_half_of_the_largest_movement_in_a_frame(session_on_disk: Session) -> None:
    """180 degrees a second are 3 degrees in a frame at 60 Hz; σ0 is half of that."""
    record = prepare_run(session_on_disk).record
    assert np.allclose(np.rad2deg(record.sigma), 1.5)
    assert np.allclose(np.rad2deg(default_sigma(session_on_disk.body(), 20.0)), 4.5)


def test_the_sessions_own_sigma_goes_before_scaled_by_the_frame_rate(session_on_disk: Session) -> None:
    names = parameter_names(session_on_disk.body())
    write_sigma(session_on_disk.path / "sigma.csv", names, np.array([0.01, 0.02, 0.03, 0.04]), 120.0)
    assert np.allclose(prepare_run(session_on_disk).record.sigma, [0.02, 0.04, 0.06, 0.08])


def test_a_run_keeps_its_body_and_cameras_whatever_becomes_of_the_sessions(session_on_disk: Session) -> None:
    measures = Subject("planar_arm4", None, {}, {"link_1_length": 300.0})
    run = prepare_run(session_on_disk, subject=measures)
    cameras = (session_on_disk.path / "calibration" / "cameras.toml").read_bytes()
    (session_on_disk.path / "calibration" / "cameras.toml").write_text("")
    assert (run.folder / "cameras.toml").read_bytes() == cameras
    assert run.cameras()[0].width == 160
    assert run.body().dimensions["link_1_length"] == 300.0
    assert run.body().name == "planar_arm4"


@pytest.mark.parametrize(
    ("request_", "kind", "words"),
    [
        (dict(first=3, last=9), RunError, "3:9"),
        (dict(first=-1), RunError, "-1:8"),
        (dict(first=4, last=4), RunError, "4:4"),
        (dict(seed=-1), RunError, "seed -1"),
        (dict(tracker="magic"), SettingsError, "magic"),
        (dict(weighting="magic"), SettingsError, "magic"),
        (dict(body="nobody"), BodyError, "nobody"),
        (dict(knobs={"survival": 2.0}), SettingsError, "survival"),
        (dict(knobs={"speed": 2.0}), SettingsError, "speed"),
        (dict(start_pose=np.zeros(3)), BodyError, "4 finite numbers"),
        (dict(start_pose=np.array([0, np.nan, 0, 0])), BodyError, "finite"),
        (dict(name="../x"), StudioError, "cannot be the name"),
    ],
)
def test_refusals_leave_nothing(
    session_on_disk: Session, request_: dict[str, Any], kind: type[StudioError], words: str
) -> None:
    with pytest.raises(kind, match=words) as caught:
        prepare_run(session_on_disk, **request_)
    assert caught.value.hint
    folder = session_on_disk.path / "runs"
    assert not folder.exists() or not list(folder.iterdir())


def test_a_start_pose_of_another_body_is_refused(session_on_disk: Session) -> None:
    write_pose(session_on_disk.path / "start_pose.csv", ("a", "b"), np.zeros(2))
    with pytest.raises(BodyError, match="lacks 4"):
        prepare_run(session_on_disk)


def test_a_run_begins_in_the_frame_of_the_start_pose(session_on_disk: Session) -> None:
    session, body = session_on_disk, session_on_disk.body()
    assert session.start_pose_frame() == 0
    keep_start_pose(session, body, true_poses()[3], 3)
    assert session.start_pose_frame() == 3
    run = prepare_run(session, name="usual")
    assert (run.record.first, run.record.last) == (3, FRAMES)
    assert np.allclose(run.record.start_pose or (), true_poses()[3])
    made = prepare_run(session, name="named", first=1, last=2)
    assert (made.record.first, made.record.last) == (1, 2)
    assert "begins in frame 1, the session's start pose is of frame 3" in made.record.notes[-1]
    given = prepare_run(session, name="given", start_pose=true_poses()[0])
    assert given.record.first == 0
    keep_start_pose(session, body, true_poses()[0])
    assert session.start_pose_frame() == 3
    with pytest.raises(RunError, match="is of frame 3, after the last requested frame") as refusal:
        prepare_run(session, last=2)
    assert "first frame" in refusal.value.hint
    with pytest.raises(RunError, match="has no frame 99"):
        keep_start_pose(session, body, true_poses()[0], 99)


def test_start_poses_of_older_sessions_are_of_frame_0(session_on_disk: Session) -> None:
    names = tuple(entry.name for entry in session_on_disk.body().parameters)
    write_pose(session_on_disk.path / "start_pose.csv", names, true_poses()[0])
    assert prepare_run(session_on_disk).record.first == 0
    write_pose(session_on_disk.path / "start_pose.csv", names, true_poses()[0], FRAMES + 3)
    assert session_on_disk.start_pose_frame() == 0
