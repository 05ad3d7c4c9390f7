"""Masks judged by the views' agreement: a body of cones seen by four cameras, with planted faults."""

import dataclasses
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from toy_session import facing_camera, make_session, side_camera

from studio.foundations.errors import FootageError, SessionError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.cameras import placed_camera
from studio.runs.problem_source import ProblemSource
from studio.runs.setup import mask_quality as quality
from studio.runs.setup.background_setup import set_up_background
from studio.runs.setup.initialising import initialise
from studio.runs.setup.person_hull import spread_frames
from studio.runs.setup.subject_masks import seen_subjects
from studio.sessions.manifest import write_manifest
from studio.sessions.provenance import origin_of
from studio.sessions.session import Session

CENTRE, RADIUS = np.array([0.0, 0.0, 900.0]), 350.0


def ring() -> tuple[Camera, ...]:
    """Four cameras around the origin."""
    places = [(3500.0, 0.0), (0.0, 3500.0), (-3500.0, 0.0), (0.0, -3500.0)]
    return tuple(
        placed_camera(f"c{n}", (x, y, 1600.0), (0.0, 0.0, 900.0), size=(320, 240), focal_px=260.0)
        for n, (x, y) in enumerate(places)
    )


def ball_mask(camera: Camera) -> np.ndarray:
    """The exact silhouette of a ball: pixels whose ray passes within its radius."""
    y, x = np.mgrid[: camera.height, : camera.width]
    inverse = np.linalg.inv(camera.matrix)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ inverse.T @ camera.rotation
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    away = CENTRE - camera.centre
    along = rays @ away
    return np.where(away @ away - along**2 < RADIUS**2, np.uint8(255), np.uint8(0))


def judged(masks: list[np.ndarray], cameras: tuple[Camera, ...]) -> quality.MaskQuality:
    """The quality of one frame's masks."""
    counted = [quality.count_frame(masks, cameras)]
    return quality.summed((0,), tuple(camera.name for camera in cameras), counted)


def test_good_masks_agree_in_every_view() -> None:
    cameras = ring()
    found = judged([ball_mask(camera) for camera in cameras], cameras)
    assert found.agreeing
    assert not found.usable, "nothing but agreement was measured"
    for view in found.views:
        assert view.covered > 0.97
        assert view.inside > 0.93
        assert view.denied == 0.0
        assert view.note == ""
    exact = 4.0 / 3.0 * np.pi * RADIUS**3 * 1e-6
    assert exact < found.hull_litres[0] < 1.5 * exact


def test_more_cameras_than_a_hull_can_have_are_refused_before_a_picture_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = make_session(tmp_path / "toy", 1)
    cameras = tuple(dataclasses.replace(session.cameras()[0], name=f"c{n}") for n in range(33))
    monkeypatch.setattr(Session, "cameras", lambda _: cameras)
    monkeypatch.setattr(Session, "footage", lambda _: pytest.fail("footage is opened"))
    with pytest.raises(FootageError, match="33 cameras"):
        quality.measure_masks(session)
    # A start pose asks the footage who has a picture, and reads none.
    monkeypatch.undo()
    monkeypatch.setattr(ProblemSource, "cameras_in", lambda *_: cameras)
    monkeypatch.setattr(ProblemSource, "evidence", lambda *_: pytest.fail("a picture is read"))
    with pytest.raises(FootageError, match="33 cameras"):
        initialise(session)


def test_a_bystander_in_one_view_is_reported_for_that_view_only() -> None:
    cameras = ring()
    masks = [ball_mask(camera) for camera in cameras]
    masks[1][20:120, 20:60] = 255
    found = judged(masks, cameras)
    own = np.count_nonzero(ball_mask(cameras[1]))
    assert found.views[1].covered == pytest.approx(own / (own + 4000), abs=0.03)
    assert not found.views[1].usable
    assert "seen by no other camera" in found.views[1].note
    assert all(view.usable for view in found.views if view.camera != "c1")


def test_a_hole_is_blamed_on_the_camera_that_has_it() -> None:
    cameras = ring()
    masks = [ball_mask(camera) for camera in cameras]
    pixels, _ = project(cameras[2], CENTRE[None])
    masks[2][: int(pixels[0, 1])] = 0
    found = judged(masks, cameras)
    blame = [view.denied for view in found.views]
    assert blame[2] > 0.2
    assert max(blame[:2] + blame[3:]) < 0.02
    assert "holes" in found.views[2].note
    assert min(view.covered for view in found.views if view.camera != "c2") < 0.9


def test_empty_masks_are_reported() -> None:
    cameras = ring()
    found = judged([np.zeros((240, 320), np.uint8) for _ in cameras], cameras)
    assert not found.usable
    assert "empty" in found.views[0].note


def test_footage_without_frames_has_no_quality(tmp_path: Path) -> None:
    session = make_session(tmp_path / "toy", 3, cameras=(facing_camera(), side_camera()))
    empty = msgspec.structs.replace(
        session.manifest, footage=dataclasses.replace(session.manifest.footage, frame_count=0)
    )
    write_manifest(session.path, empty)
    with pytest.raises(FootageError, match="'toy' has no frame whose masks could be measured"):
        quality.measure_masks(Session(session.path))


def test_more_cameras_than_a_hull_takes_are_refused_before_a_picture_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cameras = tuple(dataclasses.replace(facing_camera(), name=f"c{number}") for number in range(33))
    session = make_session(tmp_path / "toy", 1, cameras=cameras)

    def read(*_: object) -> None:
        raise AssertionError("a picture is read")

    monkeypatch.setattr(cv2, "imdecode", read)
    for verb in (
        lambda: quality.measure_masks(session),
        lambda: initialise(session, 0),
        lambda: seen_subjects(session),
        lambda: set_up_background(session, "median"),
        lambda: set_up_background(session, "best", tune=False),
    ):
        with pytest.raises(FootageError, match="from 33 cameras") as refusal:
            verb()
        assert "1 to 32" in refusal.value.hint


def test_what_a_disk_cannot_keep_is_measured_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = make_session(tmp_path / "toy", 3, cameras=(facing_camera(), side_camera()))

    def refused(*_: object) -> None:
        raise SessionError("The disk cannot be written.", "")

    monkeypatch.setattr("studio.sessions.record_files.write_bytes", refused)
    assert len(quality.measure_masks(session).views) == 2
    assert origin_of(session, quality.MEASURED) is None


def test_frames_are_spread_over_the_footage() -> None:
    assert spread_frames(100, 5) == (10, 30, 50, 70, 90)
    assert spread_frames(3, 5) == (0, 1, 2)


def test_without_one_camera_leaves_the_others_as_they_are() -> None:
    cameras = ring()
    masks = [ball_mask(camera) for camera in cameras]
    changed = quality.without(masks, 0)
    assert (changed[0] == 255).all()
    assert all(one is other for one, other in zip(changed[1:], masks[1:], strict=True))


def test_the_camera_to_look_at_is_named() -> None:
    def view(name: str, agreement: float, denied: float = 0.0) -> quality.ViewQuality:
        return quality.ViewQuality(name, agreement, agreement, denied, ())

    good = quality.MaskQuality((0,), (view("a", 0.95), view("b", 0.92)), (80.0,))
    assert good.worst == ""
    assert "0.92" in good.in_words()
    poor = quality.MaskQuality((0,), (view("a", 0.7), view("b", 0.85)), (80.0,))
    assert poor.worst == "a"
    denying = quality.MaskQuality((0,), (view("a", 0.7), view("b", 0.85, denied=0.2)), (80.0,))
    assert denying.worst == "b"
    assert "camera b" in denying.in_words()


def test_what_is_below_the_mark_does_not_read_like_the_mark() -> None:
    views = tuple(
        quality.ViewQuality(name, agreement, agreement, 0.0, ())
        for name, agreement in (("a", 0.94), ("b", 0.8996))
    )
    found = quality.MaskQuality((0,), views, (80.0,))
    assert not found.usable
    assert found.in_words() == "least agreement 0.899, below the mark of 0.9: check camera b"
