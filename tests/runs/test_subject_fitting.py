"""Which frames a subject is fitted to, what is refused, and that what is written is what was found."""

from pathlib import Path

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.subject import Subject, fit_subject, read_subject
from studio.foundations.errors import StudioError
from studio.runs.setup.subject_fitting import (
    FitRequest,
    FittedSubject,
    fit_session_subject,
    keep_subject,
    subject_of,
)
from studio.runs.setup.subject_frames import varied_frames
from studio.sessions.session import Session


def test_frames_with_the_most_different_poses_are_chosen() -> None:
    body = load_body("human31")
    poses = np.repeat(body.neutral[None], 30, axis=0)
    knee = [entry.name for entry in body.parameters].index("left_knee_ry")
    hip = [entry.name for entry in body.parameters].index("right_hip_ry")
    poses[7, knee] = -2.0
    poses[21, hip] = 1.5
    chosen = varied_frames(body, np.arange(100, 130), poses, 3)
    assert {107, 121} <= set(chosen)
    assert list(chosen) == sorted(chosen)


def test_a_place_in_the_room_is_no_posture() -> None:
    body = load_body("human31")
    poses = np.repeat(body.neutral[None], 10, axis=0)
    place = [entry.name for entry in body.parameters].index("pelvis_x")
    knee = [entry.name for entry in body.parameters].index("left_knee_ry")
    poses[2, place] = 5000.0
    poses[6, knee] = -1.0
    assert 6 in varied_frames(body, np.arange(10), poses, 2)


def test_without_poses_frames_are_spread() -> None:
    body = load_body("human31")
    assert varied_frames(body, np.arange(100), None, 4) == (12, 37, 62, 87)
    assert varied_frames(body, np.arange(2), None, 5) == (0, 1)


def test_a_written_subject_is_that_very_body(tmp_path: Path) -> None:
    body, _ = fit_subject(load_body("human31"), Subject(body="human31", height_mm=1750.0))
    subject = subject_of(Subject(body="human31", height_mm=1750.0), body)
    found = FittedSubject(subject, body, (), (0,), np.zeros((1, 31)), np.zeros(1), np.zeros(1), "nowhere", 0)
    session = Session.__new__(Session)
    session.path = tmp_path
    assert keep_subject(session, found) == tmp_path / "subject.toml"
    again, notes = fit_subject(load_body("human31"), read_subject(tmp_path / "subject.toml"))
    assert not notes
    assert dict(again.dimensions) == pytest.approx(dict(body.dimensions))
    keep_subject(session, found)
    assert (tmp_path / "subject-before.toml").exists()


def test_impossible_requests_are_refused(session_on_disk: Session) -> None:
    for request, message in (
        (FitRequest(lengths=False, radii=False), "Neither"),
        (FitRequest(frames=(100000,)), "does not lie"),
        (FitRequest(count=0), "1 to 24"),
        (FitRequest(run="nobody"), "nobody"),
    ):
        with pytest.raises(StudioError, match=message):
            fit_session_subject(session_on_disk, request)
