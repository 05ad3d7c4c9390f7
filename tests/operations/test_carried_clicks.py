"""A run of clicked landmarks: a textured arm before cameras, clicked in its first and last frame."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from command_line import answer_of, refusal_of
from filmed_bodies import HEIGHT, WIDTH, cameras_around, clicks_on, write_session

import studio
from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_frames, marker_points
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.operations.overview import describe
from studio.runs import carried_clicks
from studio.sessions.landmark_clicks import keep_clicks
from studio.sessions.session import Session

BODY = load_body("planar_arm4")
JOINTS = ("Root", "Joint1", "Joint2", "Joint3", "Tip")
CAMERAS = cameras_around(2500.0, 900.0, 600.0, 3)
FRAMES = 5


def movement() -> Array:
    """(F, D): out and back, so that the frames between are not between the first pose and the last."""
    poses = np.repeat(BODY.neutral[None], FRAMES, axis=0)
    turning = np.flatnonzero(BODY.angles)
    poses[:, turning] += 0.3
    poses[:, turning] += 0.12 * np.sin(np.linspace(0.0, np.pi, FRAMES))[:, None]
    return poses


def painted(pose: Array, camera: Camera) -> Bytes:
    """The arm's limbs, each of its own grey with rings, before a ground of noise as bright as they are."""
    rng = np.random.default_rng(5)
    ground = cv2.GaussianBlur(rng.uniform(0.0, 255.0, (HEIGHT, WIDTH)).astype(np.float32), (0, 0), 6.0)
    picture = 120.0 + 1.5 * (ground - ground.mean())
    for number, (limb, frame) in enumerate(zip(BODY.drawn, limb_frames(BODY, pose)[0], strict=True)):
        shares = np.linspace(0.0, 1.0, 80)
        pixels, depths = project(camera, frame[:, 3] + shares[:, None] * limb.length * frame[:, 2])
        radii = camera.matrix[0, 0] * limb.radius_start / depths
        for share, (x, y), radius in zip(shares, 16.0 * pixels, 16.0 * radii, strict=True):
            level = 120.0 + 40.0 * np.sin(12.0 * share + 2.0 * number)
            cv2.circle(picture, (round(x), round(y)), round(radius), level, -1, shift=4)
    return np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Session:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path))
    monkeypatch.setattr(carried_clicks, "DRAWN", 120)
    made = write_session(tmp_path / "arm", BODY, movement(), CAMERAS, masks=False)
    for camera in CAMERAS:
        for frame, pose in enumerate(movement()):
            cv2.imwrite(str(made.path / "pictures" / camera.name / f"{frame:04d}.png"), painted(pose, camera))
    return made


def off(poses: Array) -> Array:
    """(F,) mm between the joints and the true ones, greatest."""
    gaps = np.linalg.norm(marker_points(BODY, poses) - marker_points(BODY, movement()), axis=2)
    return np.asarray(gaps.max(axis=1))


def clicked_in(frames: Sequence[int], session: Session) -> None:
    clicks = clicks_on(BODY, JOINTS, movement(), CAMERAS, pixels=0.3)
    keep_clicks(session, [one for one in clicks if one.frame in frames])


def test_poses_are_carried_to_the_frames_between(session: Session) -> None:
    clicked_in((0, 4), session)
    made = studio.carry_clicks(session, held=True, name="carried")
    assert (made.clicked, made.frames, made.unclicked) == ((0, 4), 5, ())
    assert made.off < 1.0
    track = studio.read_track(made.run)
    assert track.frames.tolist() == [0, 1, 2, 3, 4]
    straight = np.repeat(movement()[:1], FRAMES, axis=0)  # the first pose and the last are the same
    assert off(straight)[2] > 100.0
    assert off(track.poses).max() < 15.0


def test_a_run_of_clicks_says_how_it_was_made_and_is_exported_as_any(
    session: Session, tmp_path: Path
) -> None:
    clicked_in((0, 2), session)
    answer = answer_of("carry-clicks arm --name carried")
    assert (answer["run"], answer["frames"], answer["clicked"]) == ("carried", 3, [0, 2])
    run = studio.open_run("arm/carried")
    assert "no tracker searched them" in run.record.notes[0]
    assert run.summary().done == 3
    assert describe(run.record) == run.record.start_source, "no tracker's name"
    studio.export_run(run, tmp_path / "poses.csv")
    assert len((tmp_path / "poses.csv").read_text().splitlines()) > FRAMES - 2


def test_the_same_seed_gives_the_same_poses(session: Session) -> None:
    clicked_in((0, 2), session)
    first, again, other = (studio.carry_clicks(session, seed=seed) for seed in (3, 3, 4))
    poses = [studio.read_track(made.run).poses for made in (first, again, other)]
    assert (poses[0] == poses[1]).all()
    assert (poses[0] != poses[2]).any()


def test_what_cannot_be_carried_is_refused(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "No landmarks were clicked" in refusal_of("carry-clicks arm")
    clicked_in((0, 4), session)
    monkeypatch.setattr(carried_clicks, "MOST_FRAMES", 4)
    assert "5 frames are too many" in refusal_of("carry-clicks arm")
    assert not list((session.path / "runs").glob("*"))
