"""The best source of masks: judged by agreement and by edges, camera by camera."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from patched_ball import FRAMES, patched_ball
from rendered_people import overlap

from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError
from studio.foundations.geometry.projection import project
from studio.foundations.progress import no_progress
from studio.results.drawing_footage.cameras import placed_camera
from studio.runs.setup.background_setup import candidates, set_up_background
from studio.runs.setup.best_source import SampledMasks, can_be_subject, choose_sources
from studio.runs.setup.contrast import border_support
from studio.sessions.background_files import read_evidence
from studio.sessions.session import Session

CAMERAS = tuple(
    placed_camera(f"cam{n}", (x, y, 1500.0), (0.0, 0.0, 900.0), size=(240, 180), focal_px=165.0)
    for n, (x, y) in enumerate([(3200.0, 0.0), (-1600.0, 2800.0), (-1600.0, -2800.0)])
)


def ball(camera: int, radius: float = 400.0) -> Bytes:
    """The mask of a ball in the middle."""
    pixels, depths = project(CAMERAS[camera], np.array([[0.0, 0.0, 900.0]]))
    mask = np.zeros((180, 240), np.uint8)
    centre = np.round(pixels[0]).astype(int).tolist()
    cv2.circle(mask, centre, round(165.0 * radius / float(depths[0])), 255, cv2.FILLED)
    return mask


def sampled(*masks: Bytes, borders: tuple[float, ...] = (0.9, 0.9, 0.9)) -> dict[str, SampledMasks]:
    return {
        camera.name: SampledMasks((mask,), border)
        for camera, mask, border in zip(CAMERAS, masks, borders, strict=True)
    }


def test_each_camera_gets_the_source_that_suits_it() -> None:
    halved = ball(2)
    halved[:, 120:] = 0
    noise = cv2.circle(np.zeros((180, 240), np.uint8), (30, 30), 20, 255, cv2.FILLED)
    sources = {
        "median": sampled(ball(0), ball(1), halved),
        "person": sampled(noise, ball(1), ball(2)),
        "combined": sampled(ball(0) | noise, ball(1) | noise, ball(2) | noise),
    }
    found = choose_sources(CAMERAS, (0,), sources, no_progress)
    assert {found.by_camera[name] for name in ("cam0", "cam1")} <= {"median", "person"}
    assert (found.by_camera["cam0"], found.by_camera["cam2"]) == ("median", "person")
    assert found.mixed.worst > 0.8 > max(one.worst for one in found.tried)


def test_a_shadow_that_all_masks_hold_is_seen_by_their_borders() -> None:
    sources = {
        "combined": sampled(*(ball(n, 600.0) for n in range(3)), borders=(0.6, 0.6, 0.6)),
        "strokes": sampled(*(ball(n) for n in range(3)), borders=(0.9, 0.9, 0.9)),
    }
    found = choose_sources(CAMERAS, (0,), sources, no_progress)
    assert set(found.by_camera.values()) == {"strokes"}


def test_what_is_all_around_is_no_subject() -> None:
    around = [np.where(ball(n) > 0, np.uint8(0), np.uint8(255)) for n in range(3)]
    assert not can_be_subject(around[0])
    with pytest.raises(FootageError, match="no source"):
        choose_sources(CAMERAS, (0,), {"threshold": sampled(*around)}, no_progress)


def test_borders_on_edges_are_supported() -> None:
    mask = ball(0)
    picture = np.where(mask[..., None] > 0, np.uint8(180), np.uint8(60)).repeat(3, axis=2)
    assert border_support(picture, mask) > 0.95
    assert border_support(picture, np.asarray(cv2.erode(mask, np.ones((21, 21), np.uint8)))) < 0.05
    assert border_support(picture, np.zeros_like(mask)) == 0.0


@pytest.mark.slow
def test_all_sources_of_a_session_are_tried_and_the_best_is_used(tmp_path: Path) -> None:
    made_ball = patched_ball(tmp_path / "ball")
    session = made_ball.session
    assert candidates(session) == ["median", "combined", "person", "threshold"]
    setup = set_up_background(session, "best", strokes=made_ball.strokes(0), tune=False)
    tried = {one.source: one for one in setup.choice.tried}
    assert {"median", "combined", "strokes", "threshold"} <= set(tried)
    assert any(note.startswith("person: No camera sees a person") for note in setup.notes)
    assert tried["strokes"].worst > 0.7
    assert setup.choice.mixed.worst >= tried["strokes"].worst
    now = Session(session.path)
    footage = now.footage()
    if set(setup.choice.by_camera.values()) == {"strokes"}:
        assert now.manifest.footage.cameras[0].masks == "stroke_masks/1/cam0"
        for key, true in made_ball.masks.items():
            mask = footage.mask(*key)
            assert mask is not None
            assert overlap(mask, true) > 0.9
    footage.close()


@pytest.mark.slow
def test_masks_of_several_sources_become_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_ball = patched_ball(tmp_path / "ball")
    choose = choose_sources

    def mixed(*args: object, **more: object) -> object:
        found = choose(*args, **more)  # pyright: ignore[reportArgumentType]
        found.by_camera.update(cam0="threshold", cam1="strokes", cam2="strokes")
        return found

    monkeypatch.setattr("studio.runs.setup.background_setup.choose_sources", mixed)
    setup = set_up_background(
        made_ball.session,
        "best",
        strokes=made_ball.strokes(0),
        tune=False,
        knobs={"mask_darkest": 100, "mask_hue": 30.0, "mask_hue_reach": 20.0, "mask_saturation": 0.5},
    )
    assert setup.source == "best"
    now = Session(made_ball.session.path)
    assert [one.masks for one in now.manifest.footage.cameras] == [f"chosen_masks/1/cam{n}" for n in range(3)]
    assert read_evidence(now).knobs == {"background_model": "auto"}
    assert read_evidence(now).given_masks == {f"cam{n}": "" for n in range(3)}
    footage = now.footage()
    for frame in range(FRAMES):
        spot = footage.mask("cam0", frame)
        whole = footage.mask("cam1", frame)
        assert spot is not None
        assert whole is not None
        # The threshold's hue is that of the spot on the ball.
        assert 0.15 < overlap(spot, made_ball.masks["cam0", frame]) < 0.8
        assert overlap(whole, made_ball.masks["cam1", frame]) > 0.9
    footage.close()


def test_one_camera_cannot_be_compared(session_on_disk: Session) -> None:
    with pytest.raises(FootageError, match="two calibrated cameras"):
        set_up_background(session_on_disk, "best")
